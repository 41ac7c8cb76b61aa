"""One run of SUMO's own traffic on a ramp: its input files, and the trajectories that come out."""

from __future__ import annotations

from pathlib import Path

from lxml import etree

from merge_cosim.ngsim.surrogate.recipe import Recipe
from merge_cosim.ramps.ramp import Ramp
from merge_cosim.sumo.options import BACKGROUND, SumoOptions, words
from merge_cosim.sumo.start import run_sumo
from merge_cosim.sumo.vehicle_types import distribution
from merge_cosim.sumo.xml import element, flow, number, speed_sign, write_xml

_FILES = {"routes": "rou.xml", "signs": "add.xml", "edges": "txt", "fcd": "parquet"}

RUN_OUT = 150.0
"""Cars leave the net this far beyond the recorded road [m], so that its end does not show."""

COLUMNS = ("id", "type", "lane", "pos", "posLat", "speed", "acceleration")
"""What SUMO writes of each car and cycle, beside the time."""


def simulate(recipe: Recipe, ramp: Ramp, seed: int, end: float, folder: Path) -> Path:
    """Run SUMO and return its trajectories (floating car data, Parquet).

    Args:
        recipe: The traffic.
        ramp: Where it drives.
        seed: SUMO's random seed.
        end: Where the recorded road ends [m past the gore].
        folder: For the files of this run.

    Raises:
        UserError: SUMO fails.
    """
    lanes = _lanes(ramp)
    files = {name: folder / f"{name}.{kind}" for name, kind in _FILES.items()}
    write_xml(files["routes"], _routes(recipe, ramp, end + RUN_OUT))
    write_xml(files["signs"], _signs(recipe, ramp, lanes))
    files["edges"].write_text("".join(f"edge:{edge}\n" for edge in lanes))
    options = {
        "route-files": files["routes"],
        "additional-files": files["signs"],
        "end": recipe.warm_up + recipe.duration,
        "lanechange.duration": recipe.change_time,
        "fcd-output": files["fcd"],
        "fcd-output.attributes": ",".join(COLUMNS),
        "fcd-output.filter-edges.input-file": files["edges"],
        "fcd-output.skip-empty": "true",
        "device.fcd.begin": recipe.warm_up,
    }
    run_sumo(SumoOptions(ramp.net, seed, tuple(words(options)), BACKGROUND))
    return files["fcd"]


def _lanes(ramp: Ramp) -> dict[str, list[str]]:
    """The SUMO lanes of each recorded edge."""
    assert ramp.ngsim is not None
    lanes: dict[str, list[str]] = {}
    for lane in (lane for along in ramp.ngsim.lanes.values() for lane in along):
        lanes.setdefault(lane.rpartition("_")[0], []).append(lane)
    return lanes


def _routes(recipe: Recipe, ramp: Ramp, end: float) -> etree._Element:
    """Drivers and demand; cars leave the main road at `end` [m past the gore]."""
    kinds = distribution(
        "drivers",
        recipe.drivers,
        car_following="EIDM",
        min_gap=recipe.min_gap,
        speed_factor="normc({},{},{},{})".format(*recipe.speed_factor),
        assertive=recipe.assertive,
        strategic=recipe.strategic,
        cooperative=recipe.cooperative,
        speed_gain=recipe.speed_gain,
        keep_right=0.0,
    )
    root = element("routes", {}, kinds)
    last = ramp.main[-1]
    exits = [edge for edge in _lanes(ramp) if edge not in (*ramp.main_route, *ramp.ramp_route)]
    shared = ramp.ramp[-1].edge
    leave = {"arrivalPos": number(end - last.start)}
    flows = {
        "through": (recipe.through, ramp.main_route, {"departLane": "random", **leave}),
        "leaving": (recipe.leaving, (*ramp.main_route[: ramp.main_route.index(shared) + 1], *exits), {}),
        "merging": (recipe.merging, ramp.ramp_route, leave),
    }
    until = recipe.warm_up + recipe.duration
    for name, (per_hour, route, how) in flows.items():
        if per_hour:
            how = {"departLane": "first", **how}
            root.append(flow(name, "drivers", route, per_hour, name == "merging", 0.0, until, **how))
    return root


def _signs(recipe: Recipe, ramp: Ramp, lanes: dict[str, list[str]]) -> etree._Element:
    """Speed signs in place of the net's speed limits."""
    signs = (speed_sign(lane, [(0.0, _limit(recipe, ramp, edge, lane))]) for edge in lanes for lane in lanes[edge])
    return element("additional", {}, *signs)


def _limit(recipe: Recipe, ramp: Ramp, edge: str, lane: str) -> float:
    """Speed limit of a lane [m/s]."""
    if edge not in ramp.main_route:
        return recipe.ramp_speed if edge in ramp.ramp_route else recipe.exit_speed
    if lane == f"{ramp.ramp[-1].edge}_{ramp.ramp[-1].lane}":
        return recipe.auxiliary_speed
    start = next(section.start for section in ramp.main if section.edge == edge)
    if start < 0.0:
        return recipe.approach_speed
    return recipe.beside_speed if start < ramp.auxiliary_end else recipe.onward_speed
