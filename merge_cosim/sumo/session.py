"""The seam to SUMO: one small protocol, by libsumo in this process or by TraCI to another."""

from __future__ import annotations

import os
import sys
import tempfile
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from merge_cosim.core.errors import UserError
from merge_cosim.core.units import DT

SPEED_MODE_UNCHECKED = 32
"""SUMO drives the commanded speed exactly: no safe-speed, right-of-way or acceleration check."""
LANE_CHANGE_MODE_NONE = 0
"""SUMO changes no lane by itself."""
SPEED_MODE_SUMO, LANE_CHANGE_MODE_SUMO = 31, 1621
"""What SUMO sets itself: it checks everything, and changes lanes as its models wish."""
SPEED_OF_SUMO = -1.0
"""The commanded speed that gives a car back to its car-following model."""
_NO_REASON = "Process Error"
"""What libsumo raises where it has told the reason elsewhere."""
_VIEW, _ZOOM = "View #0", 1500.0


@dataclass(frozen=True)
class SumoOptions:
    """What is set, and recorded, for every SUMO run.

    Attributes:
        net: The network.
        seed: SUMO's seed.
        step_length: Length of a step [s].
        collision_action: What SUMO does about a contact; `warn` reports it and leaves the cars alone.
        check_junctions: Contacts on junctions count, too.
        extra: Further options as SUMO takes them.
    """

    net: Path
    seed: int = 0
    step_length: float = DT
    collision_action: str = "warn"
    check_junctions: bool = False
    extra: tuple[str, ...] = ()

    @property
    def conditions(self) -> dict[str, str]:
        """The options that decide how an encounter goes on, by SUMO's names."""
        return {
            "step-length": str(self.step_length),
            "time-to-teleport": "-1",
            "collision.action": self.collision_action,
            "collision.mingap-factor": "0",
            "collision.check-junctions": str(self.check_junctions).lower(),
        }

    def arguments(self) -> list[str]:
        """The options as SUMO's command line has them."""
        options = {
            "--net-file": self.net,
            "--seed": self.seed,
            **{f"--{name}": value for name, value in self.conditions.items()},
            "--no-step-log": "true",
            "--no-warnings": "true",
            "--duration-log.disable": "true",
            "--xml-validation": "never",
        }
        return [str(word) for pair in options.items() for word in pair] + list(self.extra)


@dataclass(frozen=True)
class Car:
    """A car to put into the simulation.

    Attributes:
        name: SUMO's vehicle id.
        route: Edge ids.
        lane: Index of the lane on the first edge that it starts on.
        color: RGBA.
    """

    name: str
    route: tuple[str, ...]
    color: tuple[int, int, int, int]


class Session(Protocol):
    """What the loop needs of SUMO; ids are SUMO's vehicle ids."""

    def add(self, cars: Iterable[Car]) -> None:
        """Put cars in that drive exactly as commanded; they stand until they are placed."""

    def place(self, car: str, lane: str, position: float, speed: float) -> None:
        """Put a car on a lane [SUMO id], its front bumper at `position` [m], as if it had come with `speed` [m/s]."""

    def set_length(self, car: str, length: float) -> None:
        """Set a car's length [m]."""

    def change_lane(self, car: str, index: int) -> None:
        """Bring a car to the lane `index` of its edge within the next step."""

    def command(self, cars: Sequence[str], speeds: Sequence[float]) -> None:
        """Set the speeds [m/s] of the next step."""

    def step(self) -> None:
        """Simulate one step."""

    def positions(self, cars: Sequence[str]) -> Iterable[float]:
        """Positions [m] of the front bumpers on the cars' present lanes."""

    def colliding(self) -> Sequence[str]:
        """Cars in a contact that SUMO reports for the last step."""

    def close(self) -> None:
        """End the simulation."""


class RawCalls(NamedTuple):
    """The two calls that are made for every car in every step."""

    set_speed: Callable[[str, float], None]
    lane_position: Callable[[str], float]


class ApiSession:
    """What libsumo and TraCI share: the same modules with the same functions."""

    def __init__(self, api: Any, raw: RawCalls) -> None:
        self._api = api
        self._raw = raw
        self.step: Callable[[], None] = api.simulationStep

    def add(self, cars: Iterable[Car]) -> None:
        """See `Session`."""
        vehicle, types = self._api.vehicle, self._api.vehicletype
        types.copy("DEFAULT_VEHTYPE", "controlled")
        types.setImperfection("controlled", 0.0)
        types.setSpeedDeviation("controlled", 0.0)
        types.setMinGap("controlled", 0.0)
        cars = list(cars)
        for car in cars:
            self._api.route.add(f"route.{car.name}", car.route)
            vehicle.add(car.name, f"route.{car.name}", typeID="controlled", departLane="free", departSpeed="0")
            vehicle.setSpeedMode(car.name, SPEED_MODE_UNCHECKED)
            vehicle.setLaneChangeMode(car.name, LANE_CHANGE_MODE_NONE)
            vehicle.setColor(car.name, car.color)
            vehicle.setSpeed(car.name, 0.0)
        self.step()
        missing = {car.name for car in cars} - set(vehicle.getIDList())
        if missing:
            raise RuntimeError(f"SUMO did not insert {sorted(missing)[:3]} ({len(missing)} of {len(cars)} cars)")

    def place(self, car: str, lane: str, position: float, speed: float) -> None:
        """See `Session`."""
        self._api.vehicle.moveTo(car, lane, position)
        self._api.vehicle.setPreviousSpeed(car, speed)

    def set_length(self, car: str, length: float) -> None:
        """See `Session`."""
        self._api.vehicle.setLength(car, length)

    def change_lane(self, car: str, index: int) -> None:
        """See `Session`."""
        self._api.vehicle.changeLane(car, index, 0.0)

    def command(self, cars: Sequence[str], speeds: Sequence[float]) -> None:
        """See `Session`."""
        deque(map(self._raw.set_speed, cars, speeds), maxlen=0)

    def positions(self, cars: Sequence[str]) -> Iterable[float]:
        """See `Session`."""
        return map(self._raw.lane_position, cars)

    def colliding(self) -> Sequence[str]:
        """See `Session`."""
        found: Sequence[str] = self._api.simulation.getCollidingVehiclesIDList()
        return found

    def close(self) -> None:
        """See `Session`."""
        self._api.close()


class LibsumoSession(ApiSession):
    """SUMO inside this process. libsumo holds one simulation per process: opening a second one ends the first."""

    def __init__(self, options: SumoOptions) -> None:
        from libsumo import _libsumo as raw  # the raw calls spare a Python frame per car and step

        libsumo, _ = libsumo_started(options.arguments(), options.net)
        super().__init__(libsumo, RawCalls(raw.vehicle_setSpeed, raw.vehicle_getLanePosition))


class TraciSession(ApiSession):
    """SUMO, or sumo-gui, in a process of its own."""

    def __init__(self, options: SumoOptions, gui: bool = False) -> None:
        traci, _ = traci_started(options.arguments(), options.net, gui)
        super().__init__(traci, RawCalls(traci.vehicle.setSpeed, traci.vehicle.getLanePosition))

    def follow(self, car: str) -> None:
        """Let the view of sumo-gui follow a car."""
        follow(self._api, car)


def delay_option(milliseconds: float) -> tuple[str, str]:
    """The option of sumo-gui for a pause with every step, which it counts per simulated second."""
    return "--delay", str(milliseconds / DT)


def follow(api: Any, car: str) -> None:
    """Let the view of the sumo-gui behind a module traci follow a car."""
    api.gui.trackVehicle(_VIEW, car)
    api.gui.setZoom(_VIEW, _ZOOM)


def own_traci() -> Any:
    """The module traci, and not libsumo under its name."""
    import traci

    if "libsumo" in str(getattr(traci, "__file__", "")):
        raise UserError("environment: LIBSUMO_AS_TRACI is set, which turns traci into libsumo; unset it")
    return traci


@contextmanager
def connection_kept() -> Iterator[None]:
    """Turn the end of a SUMO in another process, as when its window is closed, into one line."""
    try:
        yield
    except Exception as error:
        import traci

        if not isinstance(error, traci.FatalTraCIError):
            raise
        raise UserError(f"SUMO has ended before the case was over: {error}") from None


Errors = tuple[type[Exception], ...]


def libsumo_started(arguments: Sequence[str], file: Path) -> tuple[Any, Errors]:
    """Start SUMO inside this process and return its module, and the errors that it raises.

    Raises:
        UserError: SUMO does not start; the line begins with `file`.
    """
    import libsumo

    errors = (libsumo.TraCIException, libsumo.FatalTraCIError)
    with _said() as said:
        try:
            libsumo.start(["sumo", *arguments])
        except errors as error:
            # Of some mistakes SUMO tells the reason on standard error only.
            reason = one_line(error)
            lines = said().splitlines() if reason == _NO_REASON else []
            reasons = [line.removeprefix("Error: ") for line in lines if line.startswith("Error: ")]
            raise UserError(f"{file}: SUMO cannot start: {' '.join(reasons) or reason}") from None
        told = said()
    sys.stderr.write(told)
    return libsumo, errors


@contextmanager
def _said() -> Iterator[Callable[[], str]]:
    """Keep back what this process' libraries write to standard error; the function returns it."""
    sys.stderr.flush()
    with tempfile.TemporaryFile() as file:

        def said() -> str:
            file.seek(0)
            return file.read().decode(errors="replace")

        kept = os.dup(2)
        os.dup2(file.fileno(), 2)
        try:
            yield said
        finally:
            os.dup2(kept, 2)
            os.close(kept)


def traci_started(arguments: Sequence[str], file: Path, gui: bool = False) -> tuple[Any, Errors]:
    """The same with SUMO, or sumo-gui, in a process of its own."""
    import sumolib

    traci = own_traci()
    errors = (traci.TraCIException, traci.FatalTraCIError)
    command = [sumolib.checkBinary("sumo-gui" if gui else "sumo"), *arguments]
    if gui:
        command += ["--start", "--quit-on-end", "--window-size", "1200,500"]
    with redirect_stdout(sys.stderr):  # traci prints its attempts to connect
        _start(lambda: traci.start(command, stdout=sys.stderr), file, errors)
    return traci, errors


def _start(start: Callable[[], object], file: Path, errors: Errors) -> None:
    try:
        start()
    except errors as error:
        raise UserError(f"{file}: SUMO cannot start: {one_line(error)}") from None


def one_line(error: Exception) -> str:
    """What SUMO says of an error, in one line."""
    return " ".join(str(error).split()) or "no reason given"
