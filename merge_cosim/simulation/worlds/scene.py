"""One scene of living traffic: its SUMO configuration, started as a world, and the facts about its traffic."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from merge_cosim.core.units import DT, HOUR
from merge_cosim.ramps.ramp import Ramp
from merge_cosim.simulation.worlds.meetings import DEFAULT_ATTENTION, Attention
from merge_cosim.simulation.worlds.traffic import TrafficWorld
from merge_cosim.sumo.attach import Address, AttachedSession
from merge_cosim.sumo.options import TRAFFIC, SumoOptions, delay_option
from merge_cosim.sumo.session import Session
from merge_cosim.sumo.start import open_session, running

_STATISTICS = {
    "vehicles": "stats.vehicles.inserted",
    "waiting": "stats.vehicles.waiting",
    "emergency_brakings": "stats.safety.emergencyBraking",
    "mean_speed": "device.tripinfo.speed",
    "time_loss_s": "device.tripinfo.timeLoss",
}
"""What SUMO counts of a scene: cars that came in, and that wait outside; hard brakings of its own cars; and of the cars
that have left the net, their mean speed [m/s] and what they lost against free driving [s]."""


@dataclass(frozen=True)
class Scene:
    """A simulation to be run.

    Attributes:
        name: Its name in results.
        file: The `.sumocfg`.
        ramp: The ramp whose net, or copies of it, it loads.
        seed: SUMO's seed.
        end: Its end [s]; inf for when the last car has left.
        warm_up: The throughput is counted from here on [s].
        host: A vehicle, flow or type that is a host without saying so.
        announced: Ids of vehicles and flows that are hosts by the files.
        departures: When the vehicles of the files are to depart [s].
        attention: Which merging cars a host attends to.
    """

    name: str
    file: Path
    ramp: Ramp
    seed: int
    end: float
    warm_up: float = 0.0
    host: str = ""
    announced: tuple[str, ...] = ()
    departures: Mapping[str, float] = field(default_factory=dict)
    attention: Attention = DEFAULT_ATTENTION

    @contextmanager
    def opened(
        self, gui_delay: int | None = None, extra: tuple[str, ...] = (), attach: Address | None = None
    ) -> Iterator[TrafficWorld]:
        """The scene as a running world.

        Args:
            gui_delay: Milliseconds per step in sumo-gui; None runs without a window.
            extra: Further options of SUMO.
            attach: Drive the hosts of the SUMO that listens there, whatever its configuration, instead of a new one.

        Raises:
            UserError: SUMO refuses the configuration, at its start or on the way; or see `AttachedSession`.
        """
        with running(self._open(gui_delay, extra, attach), self.file) as session:
            world = TrafficWorld(session, self.ramp, self.name, self.end, self.warm_up, self.host, self.attention)
            world.shown = gui_delay is not None
            yield world

    def facts(self, world: TrafficWorld) -> dict[str, Any]:
        """Counts and means of the traffic of a finished run; None for a mean over no car."""
        statistics = {name: world.session.statistic(key) for name, key in _STATISTICS.items()}
        left = int(world.session.statistic("device.tripinfo.count"))
        counted = max(world.time - max(self.warm_up, world.begun_at), DT)
        return {
            "simulated_s": round(world.time - world.begun_at, 3),
            "throughput_veh_h": round(HOUR * world.arrived / counted, 1),
            **statistics,
            **{name: round(statistics[name], 2) if left else None for name in ("mean_speed", "time_loss_s")},
            "hosts": world.host_count,
            "meetings": world.meetings,
            "meetings_scored": len(world.kept),
            "merging_stopped": world.stopped,
            **world.notes.counts(),
        }

    def _open(self, gui_delay: int | None, extra: tuple[str, ...], attach: Address | None) -> Session:
        """SUMO with the scene's configuration, under the conditions that the world rests on."""
        window = () if gui_delay is None else delay_option(gui_delay)
        options = SumoOptions(self.ramp.net, self.seed, (*extra, *window), TRAFFIC, self.file)
        if attach is None:
            return open_session(options, gui=gui_delay is not None)
        session = AttachedSession(options, attach)
        session.require_edges({*self.ramp.main_route, *self.ramp.ramp_route})
        return session
