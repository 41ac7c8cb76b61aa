"""Scenario files: a ramp, a source of encounters, and how the merging car drives."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import (
    BaseModel,
    Field,
    ValidationError,
    model_validator,
)

from merge_cosim.controllers.law import FreeDriving
from merge_cosim.core.encounter import Encounters
from merge_cosim.core.errors import UserError
from merge_cosim.core.files import shipped
from merge_cosim.core.registry import did_you_mean, parameters
from merge_cosim.core.units import SpeedLimit
from merge_cosim.merging_cars.base import MergingCar, merging_cars
from merge_cosim.ngsim.pairing.rules import PairRules
from merge_cosim.ramps.ramp import Way, ramp_names
from merge_cosim.scenarios.sources import ByArrival, Grid, Pairs, Random, Routes, Span, Strict, Table, Traffic
from merge_cosim.scoring.rules import Rules
from merge_cosim.sensors.base import Sensor, sensors
from merge_cosim.simulation.worlds.logged_rules import FullScene
from merge_cosim.sumo.configuration import Configuration
from merge_cosim.sumo.demand import Demand
from merge_cosim.sumo.route_reader import only_pairs
from merge_cosim.sumo.vehicle_types import ReleasedDrivers

BY_SUMO = "sumo"
"""The merging-car model that stands for SUMO's own models: the scenario is run as scenes."""


class Scenario(Strict):
    """A test: where, from which states, against whom, and how it is scored.

    Attributes:
        title: One line for tables.
        about: What the test is, for the reader.
        ramp: Name or folder of the ramp.
        encounters: Where the initial states come from.
        merging: The merging car's `model` and its parameters.
        sensing: The `model` of what the host observes of the merging car, and its parameters. Parameters without a
            model are those of `noisy`; an empty table is `perfect`.
        full_scene: How all other logged cars take part; None for host and merging car only.
        test: How an encounter is scored.
        speed_limit: Speed limit [m/s]; the ramp's own if not given.
        host: Where the automated car, the host, drives: on the `main` road or on the `ramp`. The other car, which the
            results call the merging car, is on the other path.
        name: Name of the scenario, that of its file.
    """

    title: str
    about: str = ""
    ramp: str
    encounters: Annotated[Grid | Random | ByArrival | Table | Pairs | Routes | Traffic, Field(discriminator="kind")]
    merging: dict[str, Any]
    sensing: dict[str, Any] = Field(default_factory=dict)
    full_scene: FullScene | None = None
    test: Rules = Rules()
    speed_limit: SpeedLimit | None = None
    host: Way = "main"
    name: str

    def merging_car(self) -> MergingCar:
        """Make the merging car.

        Raises:
            UserError: There is no such model or parameter.
        """
        values = dict(self.merging)
        return merging_cars.build(str(values.pop("model", "")), values, "[merging]")

    def sensor(self) -> Sensor:
        """Make the sensor.

        Raises:
            UserError: There is no such model or parameter.
        """
        values = dict(self.sensing)
        model = values.pop("model", "noisy" if values else "perfect")
        return sensors.build(str(model), values, "[sensing]")

    @model_validator(mode="after")
    def _driven(self) -> Self:
        if isinstance(self.encounters, Traffic) and not self.is_scene:
            raise ValueError(f"merging.model must be '{BY_SUMO}' in traffic, which SUMO drives")
        if self.is_scene and not isinstance(self.encounters, (Traffic, Routes)):
            raise ValueError(f"merging.model = '{BY_SUMO}' needs encounters of the kind traffic or routes")
        if self.full_scene is not None:
            if not self.is_replay or not isinstance(self.encounters, Pairs):
                raise ValueError("full_scene needs logged cars: encounters.kind = 'pairs' and merging.model = 'replay'")
            if self.encounters.merge_point != "car":
                raise ValueError("full_scene needs encounters.merge_point = 'car', where the logged lane changes are")
        if self.host == "ramp":
            if self.is_scene or self.full_scene is not None:
                raise ValueError("host = 'ramp' is for two cars alone; leave out full_scene, and traffic")
            if self.test.overlap_from == "lane_change":
                raise ValueError("host = 'ramp': test.overlap_from must be 'both', as the other car changes no lane")
        return self

    @property
    def other(self) -> Way:
        """The path of the other car."""
        return "ramp" if self.host == "main" else "main"

    @property
    def is_scene(self) -> bool:
        """SUMO drives the merging cars, and all others but the hosts."""
        return self.merging.get("model") == BY_SUMO

    @property
    def encounters_key(self) -> str:
        """What its encounters depend on: scenarios with the same key share them."""
        script = self.merging if isinstance(self.encounters, ByArrival) else self.is_replay
        return repr((self.encounters, script, self.ramp, self.host))

    @property
    def is_replay(self) -> bool:
        """The merging car drives as logged, so the log's order is a label."""
        return self.merging.get("model") == "replay"


SUMO_SUFFIXES = (".sumocfg", ".cfg")
"""Endings of SUMO's configurations; the second is what older ones are called."""
SECTIONS = ("ramp", "encounters", "merging", "sensing", "full_scene", "test", "speed_limit", "host")
"""What of a scenario can be set or varied from the command line."""


def scenario_names() -> list[str]:
    """Names of the shipped scenarios."""
    return sorted(file.stem for file in shipped("scenarios").glob("*.toml"))


def family(name: str) -> list[str]:
    """The scenarios that a name stands for: of a family, as `shifted`, all shipped `shifted-...`; else itself."""
    names = scenario_names()
    members = [one for one in names if one.startswith(f"{name}-")]
    return [name] if name in names or not members or Path(name).is_file() else members


def load_scenario(scenario: str | Path | Scenario, settings: Mapping[str, Any] | None = None) -> Scenario:
    """Read a shipped scenario by name, or any by file, with some values set otherwise (`test.horizon`, `ramp`, ...).

    Example:
        >>> load_scenario("designed-2", {"test.horizon": 20}).test.horizon
        20.0

    Args:
        scenario: Name of a shipped one, scenario file, SUMO configuration, or a scenario that is to be changed.
        settings: Values by key.

    Raises:
        UserError: There is no such scenario, or a key or value in it is wrong.
    """
    if isinstance(scenario, Scenario):
        document = scenario.model_dump(mode="json", by_alias=True, exclude_unset=True)
        return _validated(document, settings, f"scenario {scenario.name}")
    name_or_file = str(scenario)
    file = shipped("scenarios") / f"{name_or_file}.toml"
    if not file.is_file():
        file = Path(name_or_file)
    if not file.is_file():
        if file.suffix:
            raise UserError(f"{file}: no such scenario file")
        raise UserError(f"unknown scenario '{name_or_file}'{did_you_mean(name_or_file, scenario_names())}")
    document = _of_sumocfg(file) if file.suffix in SUMO_SUFFIXES else _of_toml(file)
    return _validated({"name": file.stem, **document}, settings, str(file))


def scenario_of(encounters: Encounters, name: str) -> Scenario:
    """A scenario for encounters that a Python program hands over.

    The ramp is that of the designed tests, and the merging car drives as logged where there is a log, else by the
    model `designed`; settings (`ramp`, `merging`) change that.
    """
    return Scenario(
        name=name,
        title=f"Initial states '{name}'",
        ramp="designed",
        encounters=Table(kind="table"),
        merging={"model": "designed" if encounters.log is None else "replay"},
    )


def _validated(document: dict[str, Any], settings: Mapping[str, Any] | None, where: str) -> Scenario:
    """A scenario from its keys, with some set otherwise; `where` begins the message about a wrong one."""
    for name, value in (settings or {}).items():
        _set(document, name, value)
    try:
        # as JSON in strict mode: a list is a tuple and a text is a path, but true is no number
        scenario = Scenario.model_validate_json(json.dumps(document, default=_plain), strict=True)
    except ValidationError as error:
        raise UserError(f"{where}: {_first_problem(error)}") from None
    except RecursionError:
        raise UserError(f"{where}: its tables are nested too deeply") from None
    except UserError as error:
        raise UserError(f"{where}: {error}") from None
    try:
        scenario.sensor()
        if not scenario.is_scene:
            scenario.merging_car()
    except UserError as error:
        raise UserError(f"{where}: {error}") from None
    return scenario


def _of_toml(file: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(file.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise UserError(f"{file}: not a TOML file: {error}") from None


def _of_sumocfg(file: Path) -> dict[str, Any]:
    configuration = Configuration.read(file)
    configuration.note_step()
    folder = configuration.net.parent
    if str(folder) in ramp_names():  # a folder of one's own by a shipped ramp's name
        folder = folder.absolute()
    return {
        "title": f"Route files of {file.name}",
        "ramp": str(folder),
        "encounters": {"kind": "routes", "file": str(file)},
        "merging": {"model": "designed" if only_pairs(configuration) else BY_SUMO},
    }


def _plain(value: Any) -> Any:
    """A value of a Python program as JSON has it: numpy's numbers and paths."""
    return value.item() if hasattr(value, "item") else str(value)


def _set(document: dict[str, Any], name: str, value: Any) -> None:
    *parents, last = name.split(".")
    for parent in parents:
        document = document.setdefault(parent, {})
        if not isinstance(document, dict):
            raise UserError(f"{name}: '{parent}' is a value, it has no parts")
    document[last] = value


_KNOWN: dict[tuple[str, ...], type] = {
    (): Scenario,
    ("encounters", "grid"): Grid,
    ("encounters", "random"): Random,
    ("encounters", "table"): Table,
    ("encounters", "pairs"): Pairs,
    ("encounters", "drawn"): ByArrival,
    ("encounters", "routes"): Routes,
    ("encounters", "traffic"): Traffic,
    ("encounters", "traffic", "demand"): Demand,
    ("encounters", "pairs", "rules"): PairRules,
    ("full_scene",): FullScene,
    ("full_scene", "drivers"): ReleasedDrivers,
    ("test",): Rules,
    ("test", "free"): FreeDriving,
}


_KINDS = ("grid", "random", "drawn", "table", "pairs", "routes", "traffic")


def _first_problem(error: ValidationError) -> str:
    first = min(error.errors(), key=lambda one: one["type"] == "missing")  # a misspelt key is missing, too
    if not first["loc"]:
        return str(first["msg"]).removeprefix("Value error, ")  # of the scenario as a whole
    *place, key = first["loc"]
    shown = ".".join(str(part) for part in first["loc"] if part not in (*_KINDS, "[key]"))
    kinds = f"(choose from: {', '.join(_KINDS)})"
    if first["type"] in ("extra_forbidden", "unexpected_keyword_argument"):
        section = _KNOWN.get(tuple(str(part) for part in place), Span)
        if issubclass(section, BaseModel):
            known = [field.alias or name for name, field in section.model_fields.items()]
        else:
            known = list(parameters(section))
        return f"unknown key '{shown}'{did_you_mean(str(key), known)}"
    if first["type"] == "missing":
        return f"the key '{shown}' is missing"
    if first["type"] == "union_tag_not_found":
        return f"the key '{shown}.kind' is missing {kinds}"
    if first["type"] == "union_tag_invalid":
        return f"{shown}.kind = {first['input']['kind']!r}: there is no such kind {kinds}"
    value = "" if isinstance(first["input"], dict) else f" = {first['input']!r}"
    return f"{shown}{value}: {first['msg'].removeprefix('Value error, ')}"
