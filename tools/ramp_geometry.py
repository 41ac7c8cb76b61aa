"""Draw US-101 and I-80 from their survey: python tools/ramp_geometry.py --data DIR writes and builds sumo_nets/.

DIR holds `geometry/` with the lane centre lines and road boundaries of NGSIM.jl, and NGSIM's trajectories, of which
the cars with an even number set the zero of Local_X and correct the drawn lines of US-101's lanes 7 and 8.
"""

import argparse
import re
from pathlib import Path

import pandas as pd
from geometry.plain_xml import write_sources
from geometry.plan import Plan
from geometry.positions import positions
from geometry.sites import i80, us101

from merge_cosim.ramps.build import build
from merge_cosim.ramps.check import check
from merge_cosim.ramps.definition import FILE_NAME, RampFile, read_ramp_file

NETS = Path(__file__).parent.parent / "sumo_nets"


def fitted(cars: pd.DataFrame) -> pd.Series:
    """Which rows the alignment is fitted to; the others judge it."""
    return cars["Vehicle_ID"] % 2 == 0


def plan_of(name: str, data: Path, file: RampFile) -> Plan:
    """Draw one ramp."""
    assert file.ngsim is not None
    geometry, gore = data / "geometry", file.ngsim.gore_local_y
    cars = positions(data, name)
    cars = cars[fitted(cars)]
    if name == "i80":
        return i80(geometry, gore, file.lengths["merge"], cars)
    return us101(geometry, gore, file.lengths["weave"], cars)


def update(path: Path, plan: Plan) -> None:
    """Bring lengths and the survey's reach in a `ramp.toml` up to date."""
    text = path.read_text(encoding="utf-8")
    values = {edge.name: edge.length for edge in plan.edges} | {k: round(v) for k, v in plan.surveyed.items()}
    for key, value in values.items():
        text = re.sub(rf"^{key} = [-\d.]+", f"{key} = {float(value)}", text, flags=re.MULTILINE)
    path.write_text(text, encoding="utf-8")


def main() -> None:
    """Write and build both."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", type=Path, required=True, help="folder with geometry/ and NGSIM's trajectories")
    data = parser.parse_args().data
    for name in ("us101", "i80"):
        folder = NETS / name
        file = read_ramp_file(folder)
        plan = plan_of(name, data, file)
        write_sources(plan, folder, file.speed_limit)
        update(folder / FILE_NAME, plan)
        print("\n".join([f"wrote {build(folder)}", *check(folder)]))


if __name__ == "__main__":
    main()
