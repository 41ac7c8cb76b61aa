"""One case as a CommonRoad scenario: the host as the planning problem, the merging car as a dynamic obstacle.

Althoff, Koschi, Manzinger: CommonRoad: Composable benchmarks for motion planning on roads, IV 2017; format 2020a.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from importlib.util import find_spec
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import pandas as pd
import sumolib

from merge_cosim import __version__
from merge_cosim.core.encounter import Encounters
from merge_cosim.core.errors import UserError
from merge_cosim.core.units import DT, FloatArray
from merge_cosim.ramps.export.lanelets import Lanelet, lanelets
from merge_cosim.ramps.export.poses import poses
from merge_cosim.ramps.ramp import Ramp, Way

if TYPE_CHECKING:
    from commonroad.common.common_scenario import Location, ScenarioID
    from commonroad.planning.planning_problem import PlanningProblem
    from commonroad.scenario.lanelet import LaneletNetwork, LaneletType
    from commonroad.scenario.obstacle import DynamicObstacle
    from commonroad.scenario.state import InitialState
    from commonroad.scenario.traffic_sign import TrafficSign

CAR_WIDTH = 1.8
"""Width of both cars [m], SUMO's for passenger cars; encounters hold lengths only."""
DECIMALS = 4
"""Digits after the point in the file."""


def need_library() -> None:
    """Say how to get commonroad-io where it is missing.

    Raises:
        UserError: It is not installed.
    """
    if find_spec("commonroad") is None:
        raise UserError("--commonroad needs commonroad-io: pip install 'merge-cosim[commonroad]'")


Car = Literal["host", "merging"]


def write_commonroad(
    folder: Path, ramp: Ramp, encounters: Encounters, record: pd.DataFrame, number: int, story: str, host: Way = "main"
) -> Path:
    """Write a scenario file, named by its benchmark id, into a folder.

    Args:
        folder: Made if need be; a file of the same name is written anew.
        ramp: The ramp.
        encounters: The one case.
        record: Its record, one row per cycle.
        number: Number of the case in its scenario from 1 on, the configuration in the benchmark id.
        story: Where the case comes from, the file's attribute `source`.
        host: The host's path; the other car is on the other one.
    """
    from commonroad.common.file_writer import CommonRoadFileWriter
    from commonroad.common.util import FileFormat
    from commonroad.common.writer.file_writer_interface import OverwriteExistingFile
    from commonroad.planning.planning_problem import PlanningProblemSet
    from commonroad.scenario.scenario import Scenario, Tag

    road = lanelets(ramp)
    name, ids = _benchmark_id(ramp, number), count(1)
    scenario = Scenario(DT, name)
    scenario.add_objects(_network(road, ramp, ids))
    paths: dict[Car, Way] = {"host": host, "merging": "ramp" if host == "main" else "main"}

    def states(car: Car) -> list[dict[str, Any]]:
        return _states(car, paths[car], road, ramp, encounters, record)

    scenario.add_objects(_merging_car(next(ids), states("merging"), float(encounters.merging_length[0])))
    problem = _host(next(ids), states("host"), road, ramp, float(encounters.merge_position[0]))
    tags = [Tag.HIGHWAY, Tag.MERGING_LANES, Tag.SPEED_LIMIT]
    tags += [Tag.LANE_CHANGE] if ramp.changes_lane else []
    tags += [Tag.SIMULATED] if encounters.log is None else []
    writer = CommonRoadFileWriter(
        scenario,
        PlanningProblemSet([problem]),
        author=f"merge-cosim {__version__}",
        affiliation="",
        source=story,
        tags=tags,  # a list, so that their order is always the same
        decimal_precision=DECIMALS,
        file_format=FileFormat.XML,
    )
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / f"{name}.xml"
    file.unlink(missing_ok=True)  # the library would print that it replaces it
    writer.write_to_file(str(file), OverwriteExistingFile.ALWAYS)
    return file


def _benchmark_id(ramp: Ramp, number: int) -> ScenarioID:
    """Such as USA_US101Merge-1_17_T-1; ZAM is CommonRoad's country for roads of no known country."""
    from commonroad.common.common_scenario import ScenarioID

    country = "ZAM" if ramp.ngsim is None else "USA"
    return ScenarioID(False, country, f"{ramp.name.upper()}Merge", 1, number, "T", 1)


def _location(ramp: Ramp) -> Location:
    """The net's projection; the translation is what was taken off the projected coordinates."""
    from commonroad.common.common_scenario import GeoTransformation, Location

    (location,) = sumolib.xml.parse(str(ramp.net), "location")
    if location.projParameter == "!":  # none
        return Location()
    x, y = map(float, location.netOffset.split(","))
    return Location(geo_transformation=GeoTransformation(location.projParameter, -x, -y, 0.0, 1.0))


def _network(road: Mapping[str, Lanelet], ramp: Ramp, new_ids: Iterator[int]) -> LaneletNetwork:
    from commonroad.scenario.lanelet import Lanelet as CommonRoadLanelet
    from commonroad.scenario.lanelet import LaneletNetwork, LineMarking, RoadUser

    ids = {lane: next(new_ids) for lane in road}
    parts = []
    for lane, lanelet in road.items():
        left, right = (ids.get(side or "") for side in (lanelet.left_lane, lanelet.right_lane))
        parts.append(
            CommonRoadLanelet(
                lanelet.left,
                lanelet.middle,
                lanelet.right,
                ids[lane],
                predecessor=[ids[other] for other in lanelet.follows],
                successor=[ids[other] for other in lanelet.leads_to],
                adjacent_left=left,
                adjacent_left_same_direction=None if left is None else True,
                adjacent_right=right,
                adjacent_right_same_direction=None if right is None else True,
                line_marking_left_vertices=LineMarking.SOLID if left is None else LineMarking.DASHED,
                line_marking_right_vertices=LineMarking.SOLID if right is None else LineMarking.DASHED,
                lanelet_type={_kind(lanelet, ramp)},
                user_one_way={RoadUser.VEHICLE},
            )
        )
    network = LaneletNetwork.create_from_lanelet_list(parts)
    network.location = _location(ramp)
    for limit in sorted({lanelet.speed_limit for lanelet in road.values()}):
        limited = [lane for lane, lanelet in road.items() if lanelet.speed_limit == limit]
        first = [lane for lane in limited if not set(road[lane].follows) & set(limited)]
        begin = road[first[0]].right[0]
        sign = _limit_sign(next(new_ids), limit, {ids[lane] for lane in first}, begin, ramp)
        network.add_traffic_sign(sign, {ids[lane] for lane in limited})
    return network


def _kind(lanelet: Lanelet, ramp: Ramp) -> LaneletType:
    """On-ramp with its auxiliary lane, main road, or exit (anything else that begins or ends at the ramp)."""
    from commonroad.scenario.lanelet import LaneletType

    if any((section.edge, section.lane) == (lanelet.edge, lanelet.lane) for section in ramp.ramp):
        return LaneletType.ACCESS_RAMP
    return LaneletType.HIGHWAY if lanelet.edge in ramp.main_route else LaneletType.EXIT_RAMP


def _limit_sign(number: int, limit: float, first: set[int], position: FloatArray, ramp: Ramp) -> TrafficSign:
    from commonroad.scenario.traffic_sign import (
        TrafficSign,
        TrafficSignElement,
        TrafficSignIDUsa,
        TrafficSignIDZamunda,
    )

    signs = TrafficSignIDZamunda if ramp.ngsim is None else TrafficSignIDUsa
    return TrafficSign(number, [TrafficSignElement(signs.MAX_SPEED, [str(limit)])], first, position, virtual=True)


def _merging_car(number: int, states: list[dict[str, Any]], length: float) -> DynamicObstacle:
    from commonroad.geometry.obstacle_shapes.rect_obstacle_shape import RectObstacleShape
    from commonroad.prediction.prediction import TrajectoryPrediction
    from commonroad.scenario.obstacle import DynamicObstacle, ObstacleType
    from commonroad.scenario.state import ExtendedPMState
    from commonroad.scenario.trajectory import Trajectory

    shape = RectObstacleShape(CAR_WIDTH, length)
    trajectory = Trajectory(1, [ExtendedPMState(step, **state) for step, state in enumerate(states[1:], 1)])
    return DynamicObstacle(
        number, ObstacleType.CAR, shape, _initial(states[0]), TrajectoryPrediction(trajectory, shape)
    )


def _host(
    number: int, states: list[dict[str, Any]], road: Mapping[str, Lanelet], ramp: Ramp, merge_position: float
) -> PlanningProblem:
    """The host's start; its goal is to be past the merging point, on its lane, by the end of the record."""
    import shapely
    from commonroad.common.util import Interval
    from commonroad.geometry.occupancy.polygon_occupancy import PolygonOccupancy
    from commonroad.planning.goal import GoalRegion
    from commonroad.planning.planning_problem import PlanningProblem
    from commonroad.scenario.state import CustomState

    goals = []
    for section in ramp.main:
        if section.end > merge_position:
            area = road[f"{section.edge}_{section.lane}"].area_from(max(merge_position - section.start, 0.0))
            place = PolygonOccupancy(shapely.Polygon(area))
            goals.append(CustomState(time_step=Interval(0, len(states) - 1), position=place))
    start = states[0] | {"acceleration": 0.0}  # the method's is no part of it
    return PlanningProblem(number, _initial(start), GoalRegion(goals))


def _states(
    car: Car,
    path: Way,
    road: Mapping[str, Lanelet],
    ramp: Ramp,
    encounters: Encounters,
    record: pd.DataFrame,
) -> list[dict[str, Any]]:
    """A car's states in CommonRoad's terms, one per cycle; the acceleration is the one to the next cycle."""
    station, speed = (record[f"{car}_{name}"].to_numpy() for name in ("station_m", "speed_m_s"))
    length = encounters.host_length if car == "host" else encounters.merging_length
    place, heading = poses(road, ramp, path, station, float(length[0]), float(encounters.merge_position[0]))
    acceleration = np.append(np.diff(speed) / DT, 0.0)
    return [
        {
            "position": place[step],
            "orientation": heading[step],
            "velocity": speed[step],
            "acceleration": acceleration[step],
        }
        for step in range(len(record))
    ]


def _initial(state: Mapping[str, Any]) -> InitialState:
    from commonroad.scenario.state import InitialState

    return InitialState(0, **state, yaw_rate=0.0, slip_angle=0.0)
