"""Files of small scenes."""

from pathlib import Path

from merge_cosim.ramps.ramp import Ramp

SMALL = """
title = "A minute of traffic"
ramp = "us101"

[encounters]
kind = "traffic"
replications = 2

[encounters.demand]
duration = 60
warm_up = 5
through = 3000
merging = 900
hosts = 700

[merging]
model = "sumo"
"""

ROUTES = """<routes>
<vType id="host"><param key="merge-cosim.role" value="host"/></vType>
<vType id="car"/>
<route id="main" edges="main_in weave main_out"/>
<flow id="joining" type="car" begin="0" number="10" period="4" departLane="first" departSpeed="15">
<route edges="ramp weave main_out"/></flow>
<flow id="h" type="host" route="main" begin="1" number="8" period="5" departLane="0" departSpeed="20"/>
</routes>
"""


def small_scene(folder: Path) -> Path:
    """Write a scenario of two scenes of a minute."""
    file = folder / "minute.toml"
    file.write_text(SMALL)
    return file


def own_files(folder: Path, routes: str = ROUTES, more: str = "") -> Path:
    """Write an ordinary SUMO configuration beside a copy of US-101's ramp."""
    net = Ramp.load("us101").net
    for name in (net.name, "ramp.toml"):
        (folder / name).write_bytes((net.parent / name).read_bytes())
    (folder / "my.rou.xml").write_text(routes)
    file = folder / "my.sumocfg"
    file.write_text(
        f'<configuration><net-file value="{net.name}"/><route-files value="my.rou.xml"/>'
        f'<step-length value="0.1"/>{more}</configuration>'
    )
    return file
