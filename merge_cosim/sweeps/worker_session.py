"""What a worker process keeps from one chunk to the next: an open SUMO."""

from __future__ import annotations

from merge_cosim.ramps.ramp import Ramp, Way
from merge_cosim.simulation.worlds.tiles import TiledWorld

TILES = 256
"""Encounters side by side in one SUMO. From 192 to 256 tiles a case costs the same: more of them spread the cost of a
cycle's Python over more cars, but SUMO's own step costs more per car, as more cars fit its cache less well."""


class WorkerSession:
    """Keeps one tiled world open, as long as ramp, seed and the hosts' path stay the same.

    libsumo holds one simulation per process.
    """

    def __init__(self, tiles: int = TILES) -> None:
        self._tiles = tiles
        self._open: tuple[str, int, int, Way] | None = None
        self._world: TiledWorld | None = None

    def world(self, ramp: Ramp, cases: int, seed: int, host: Way = "main") -> TiledWorld:
        """The open world on this ramp, or a new one; it has at most as many tiles as there are cases."""
        tiles = min(self._tiles, cases)
        wanted = (str(ramp.net), tiles, seed, host)
        if self._world is None or self._open != wanted:
            self.close()
            self._world, self._open = TiledWorld(ramp, tiles, seed, host=host), wanted
        return self._world

    def close(self) -> None:
        """End the simulation."""
        if self._world is not None:
            self._world.close()
            self._world = None
