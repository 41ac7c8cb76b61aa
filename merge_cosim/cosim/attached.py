"""A session in a SUMO, or sumo-gui, that the user has started with `--remote-port`."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import redirect_stdout
from dataclasses import dataclass
from io import StringIO

from merge_cosim.cosim.session import ApiSession, Car, RawCalls, SumoOptions, own_traci
from merge_cosim.errors import UserError
from merge_cosim.ramps.ramp import read_net
from merge_cosim.units import TOLERANCE

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
            UserError: It is something else.
        """
        host, _, port = text.rpartition(":")
        if not host or not port.isascii() or not port.isdigit() or not 0 < int(port) < 65536:
            raise UserError(f"--attach {text}: not HOST:PORT, such as localhost:8813")
        return cls(host, int(port))

    def __str__(self) -> str:
        return f"{self.host}:{self.port}"


class AttachedSession(ApiSession):
    """Drives our two cars in a running simulation of the ramp's own net; other cars in it are left alone.

    Raises:
        UserError: Nobody listens there, or SUMO runs under other conditions than ours.
    """

    def __init__(self, options: SumoOptions, address: Address) -> None:
        traci = own_traci()
        self._errors = (traci.TraCIException, traci.FatalTraCIError)
        self._address = address
        self._net = options.net
        try:
            with redirect_stdout(StringIO()):  # traci prints its attempts to connect
                traci.init(address.port, TRIES, address.host)
        except (*self._errors, OSError):
            raise UserError(
                f"--attach {address}: no SUMO listens there; start one with --remote-port {address.port}"
            ) from None
        super().__init__(traci, RawCalls(traci.vehicle.setSpeed, traci.vehicle.getLanePosition))
        wanted = {**options.conditions, "no-internal-links": "true"}  # a path is then as long as its edges
        wrong = {name: value for name, value in wanted.items() if not _same(traci.simulation.getOption(name), value)}
        if wrong:
            self.close()
            needed = " ".join(f"--{name} {value}" for name, value in wrong.items())
            raise UserError(f"--attach {address}: SUMO must be started with {needed}")

    def add(self, cars: Iterable[Car]) -> None:
        """See `Session`; another net than the ramp's, or one with cars of the same names, is the user's mistake."""
        cars = list(cars)
        self._check_net({edge for car in cars for edge in car.route})
        try:
            super().add(cars)
        except (*self._errors, RuntimeError) as error:
            self.close()
            raise UserError(f"--attach {self._address}: the cars cannot be added: {error}") from None

    def _check_net(self, edges: set[str]) -> None:
        """Refuse a net in which a lane of these edges is not there, or not as long: stations would be wrong."""
        running = set(self._api.lane.getIDList())
        net = read_net(self._net)
        for lane in (lane for edge in sorted(edges) for lane in net.getEdge(edge).getLanes()):
            name, length = lane.getID(), lane.getLength()
            if name not in running or abs(self._api.lane.getLength(name) - length) > TOLERANCE:
                self.close()
                raise UserError(
                    f"--attach {self._address}: SUMO has another net: no lane {name} of {length:g} m; load {self._net}"
                )


def _same(found: str, wanted: str) -> bool:
    try:
        return float(found) == float(wanted)
    except ValueError:
        return found == wanted
