"""A session in a SUMO, or sumo-gui, that the user has started with `--remote-port`."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import redirect_stdout
from dataclasses import dataclass
from io import StringIO
from pathlib import Path

from merge_cosim.core.errors import UserError
from merge_cosim.core.units import TOLERANCE
from merge_cosim.ramps.ramp import read_net
from merge_cosim.sumo.options import SumoOptions
from merge_cosim.sumo.session import Car, Errors, Session
from merge_cosim.sumo.start import own_traci

TRIES = 5
"""Attempts to connect, a second apart: sumo-gui takes a while to open its port."""


@dataclass(frozen=True)
class Address:
    """Where a SUMO listens."""

    host: str
    port: int

    @classmethod
    def parse(cls, text: str) -> Address:
        """Read `HOST:PORT`.

        Raises:
            UserError: It is not of this form.
        """
        host, _, port = text.rpartition(":")
        if not host or not port.isascii() or not port.isdigit() or not 0 < int(port) < 65536:
            raise UserError(f"--attach {text}: not HOST:PORT, such as localhost:8813")
        return cls(host, int(port))

    def __str__(self) -> str:
        return f"{self.host}:{self.port}"


class AttachedSession(Session):
    """A session in a running simulation of the ramp's own net."""

    def __init__(self, options: SumoOptions, address: Address) -> None:
        """Connect to a running SUMO.

        Args:
            options: What a SUMO of our own would be started with; it must have been started with the same conditions.
            address: Where it listens.

        Raises:
            UserError: No SUMO listens there, or it was started with other options.
        """
        traci = own_traci()
        errors = (traci.TraCIException, traci.FatalTraCIError)
        try:
            with redirect_stdout(StringIO()):  # traci prints its attempts to connect
                traci.init(address.port, TRIES, address.host)
        except (*errors, OSError):
            raise UserError(
                f"--attach {address}: no SUMO listens there; start one with --remote-port {address.port}"
            ) from None
        super().__init__(traci, errors)
        self._address, self._net = address, options.net
        wrong = {name: value for name, value in options.conditions.items() if not _same(self.option(name), value)}
        if wrong:
            self.close()
            needed = " ".join(f"--{name} {value}" for name, value in wrong.items())
            raise UserError(f"--attach {address}: SUMO must be started with {needed}")

    def add(self, cars: Iterable[Car]) -> None:
        """See `Session`; another net than the ramp's, or one with cars of the same names, is the user's mistake."""
        cars = list(cars)
        self.require_edges({edge for car in cars for edge in car.route})
        refused: Errors = (RuntimeError, *self.errors)
        try:
            super().add(cars)
        except refused as error:
            self.close()
            raise UserError(f"--attach {self._address}: the cars cannot be added: {error}") from None

    def require_edges(self, edges: set[str]) -> None:
        """Close the connection where SUMO runs on another net than ours.

        Raises:
            UserError: It does.
        """
        if amiss := other_net(self, self._net, edges):
            self.close()
            raise UserError(f"--attach {self._address}: {amiss}")


def other_net(session: Session, net: Path, edges: set[str]) -> str:
    """A line that says how the net of SUMO differs from ours, if these edges differ: stations would be wrong."""
    running, ours = set(session.lanes()), read_net(net)
    for lane in (lane for edge in sorted(edges) for lane in ours.getEdge(edge).getLanes()):
        name, length = lane.getID(), lane.getLength()
        if name not in running or abs(session.lane_length(name) - length) > TOLERANCE:
            return f"SUMO has another net: no lane {name} of {length:g} m; load {net}"
    return ""


def _same(found: str, wanted: str) -> bool:
    try:
        return float(found) == float(wanted)
    except ValueError:
        return found == wanted
