"""One encounter as ordinary SUMO files: to be shown in sumo-gui, or kept and changed by hand."""

import shutil
from dataclasses import replace
from pathlib import Path

from lxml import etree

from merge_cosim.core.encounter import Encounters
from merge_cosim.ramps.definition import FILE_NAME
from merge_cosim.ramps.ramp import Ramp, Way
from merge_cosim.ramps.view import FILE_NAME as VIEW
from merge_cosim.ramps.view import copy_view
from merge_cosim.sumo.lane_map import LaneMap
from merge_cosim.sumo.options import REAL_TIME, STEP, WRITTEN, Options
from merge_cosim.sumo.vehicle_types import COLORS, CONTROLLED, MERGE_POSITION, ROLE
from merge_cosim.sumo.xml import element, number, write_xml


def write_encounter(folder: Path, ramp: Ramp, encounters: Encounters, row: int, host: Way = "main") -> Path:
    """Write net, ramp, routes and configuration of one encounter into a folder and return the `.sumocfg`.

    The host drives on the path `host`, the other car on the other one. SUMO's own models drive both
    cars; the initial state is the encounter's.

    Raises:
        UserError: The encounter starts off the net.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for file in (ramp.net, ramp.net.parent / FILE_NAME):
        shutil.copyfile(file, folder / file.name)
    merge_position = float(encounters.merge_position[row])
    states = {
        "host": (encounters.host_station, encounters.host_speed, encounters.host_length),
        "merging": (encounters.merging_station, encounters.merging_speed, encounters.merging_length),
    }
    types, cars = [], []
    for role, (station, speed, length) in states.items():
        path: Way = "main" if (role == "host") == (host == "main") else "ramp"
        where, route = LaneMap(ramp).place(path, float(station[row]), merge_position), ramp.route(path)
        parameters = {ROLE: role} | ({MERGE_POSITION: number(merge_position)} if role == "merging" else {})
        kind = replace(CONTROLLED, id=role, length=float(length[row]), color=COLORS[role], parameters=parameters)
        types.append(kind.element())
        start = {
            "departLane": str(where.lane),
            "departPos": number(where.position),
            "departSpeed": number(speed[row]),
        }
        cars.append(
            element(
                "vehicle",
                {"id": role, "type": role, "depart": "0", **start, "insertionChecks": "none"},
                element("route", {"edges": " ".join(route[route.index(where.edge) :])}),
            )
        )
    write_xml(folder / "encounter.rou.xml", element("routes", {}, *types, *cars))
    inputs = {"net-file": ramp.net.name, "route-files": "encounter.rou.xml"}
    write_xml(folder / "encounter.sumocfg", configuration(inputs, {}, copy_view(ramp.net.parent, folder), {}))
    return folder / "encounter.sumocfg"


def configuration(inputs: Options, processing: Options, with_view: bool, time: Options) -> etree._Element:
    """A SUMO configuration with our conditions; further options by section."""
    options = {
        "input": inputs,
        "gui_only": ({"gui-settings-file": VIEW} if with_view else {}) | dict([REAL_TIME]),
        "time": {"begin": "0", **time, **STEP},
        "processing": {**WRITTEN, **processing},
    }
    parts = [element(part, {}, *(element(k, {"value": v}) for k, v in of.items())) for part, of in options.items()]
    return element("configuration", {}, *parts)
