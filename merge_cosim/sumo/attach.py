"""A session in a SUMO, or sumo-gui, that the user has started with `--remote-port`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from contextlib import redirect_stdout
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import Any

from merge_cosim.core.errors import UserError
from merge_cosim.core.units import TOLERANCE
from merge_cosim.ramps.ramp import read_net
from merge_cosim.sumo.session import ApiSession, Car, Errors, RawCalls, SumoOptions, own_traci

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


def attached_to(address: Address, conditions: Mapping[str, str]) -> tuple[Any, Errors]:
    """Connect to a running SUMO and return traci, and the errors that it raises.

    Args:
        address: Where it listens.
        conditions: Options that it must have been started with; and it must have no lanes inside junctions, so that a
            path is as long as its edges.

    Raises:
        UserError: Nobody listens there, or SUMO runs under other conditions.
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
    wanted = {**conditions, "no-internal-links": "true"}
    wrong = {name: value for name, value in wanted.items() if not _same(traci.simulation.getOption(name), value)}
    if wrong:
        traci.close()
        needed = " ".join(f"--{name} {value}" for name, value in wrong.items())
        raise UserError(f"--attach {address}: SUMO must be started with {needed}")
    return traci, errors


class AttachedSession(ApiSession):
    """Drives our two cars in a running simulation of the ramp's own net; other cars in it are left alone.

    Raises:
        UserError: Nobody listens there, or SUMO runs under other conditions than ours.
    """

    def __init__(self, options: SumoOptions, address: Address) -> None:
        traci, errors = attached_to(address, options.conditions)
        self._errors: Errors = (RuntimeError, *errors)
        self._address = address
        self._net = options.net
        super().__init__(traci, RawCalls(traci.vehicle.setSpeed, traci.vehicle.getLanePosition))

    def add(self, cars: Iterable[Car]) -> None:
        """See `Session`; another net than the ramp's, or one with cars of the same names, is the user's mistake."""
        cars = list(cars)
        refuse_other_net(self._api, self._net, {edge for car in cars for edge in car.route}, self._address)
        try:
            super().add(cars)
        except self._errors as error:
            self.close()
            raise UserError(f"--attach {self._address}: the cars cannot be added: {error}") from None


def refuse_other_net(api: Any, net: Path, edges: set[str], address: Address) -> None:
    """Close the connection where SUMO runs on another net than ours.

    Raises:
        UserError: It does.
    """
    if amiss := other_net(api, net, edges):
        api.close()
        raise UserError(f"--attach {address}: {amiss}")


def other_net(api: Any, net: Path, edges: set[str]) -> str:
    """What is amiss with the net that SUMO runs on, if these edges are not as in ours: stations would be wrong."""
    running = set(api.lane.getIDList())
    ours = read_net(net)
    for lane in (lane for edge in sorted(edges) for lane in ours.getEdge(edge).getLanes()):
        name, length = lane.getID(), lane.getLength()
        if name not in running or abs(api.lane.getLength(name) - length) > TOLERANCE:
            return f"SUMO has another net: no lane {name} of {length:g} m; load {net}"
    return ""


def _same(found: str, wanted: str) -> bool:
    try:
        return float(found) == float(wanted)
    except ValueError:
        return found == wanted
