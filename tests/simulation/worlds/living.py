"""Small simulations of SUMO with a host in them, for the tests of living traffic."""

from contextlib import contextmanager

import libsumo

from merge_cosim.controllers.acc import Acc
from merge_cosim.core.observation import Setting
from merge_cosim.estimators.base import estimators
from merge_cosim.merging_cars.sumo import BySumo
from merge_cosim.ramps.ramp import Ramp
from merge_cosim.scoring.rules import Rules
from merge_cosim.simulation.host_driver import HostDriver
from merge_cosim.simulation.loop import Everything, Loop
from merge_cosim.simulation.worlds.traffic import TrafficWorld
from merge_cosim.sumo.session import Session

OTHERS = '<vType id="other" length="6" sigma="0" speedDev="0"/>'
TYPES = f"""<vType id="host" length="4" minGap="1.5"><param key="merge-cosim.role" value="host"/></vType>
<vType id="merging" length="5"><param key="merge-cosim.role" value="merging"/></vType>
{OTHERS}
"""
ROUTES = """<route id="main" edges="main_in weave main_out"/><route id="ramp" edges="ramp weave main_out"/>
"""


def vehicle(name, kind, position, speed, lane=0, route="main", depart=0, more=""):
    """A vehicle of a route file."""
    return (
        f'<vehicle id="{name}" type="{kind}" route="{route}" depart="{depart}" departLane="{lane}" '
        f'departPos="{position}" departSpeed="{speed}" insertionChecks="none" {more}/>'
    )


@contextmanager
def us101(tmp_path, *vehicles, types=TYPES, method="always-go", horizon=3.0, host="", **options):
    """SUMO on US-101's net with these vehicles, and a method that drives its hosts."""
    routes = tmp_path / "test.rou.xml"
    routes.write_text("\n".join(["<routes>", types, ROUTES, *vehicles, "</routes>"]))
    ramp = Ramp.load("us101")
    conditions = {
        "step-length": "0.1",
        "no-internal-links": "true",
        "collision.action": "warn",
        "collision.mingap-factor": "0",
        "no-warnings": "true",
        "no-step-log": "true",
    }
    settings = {name.replace("_", "-"): value for name, value in options.items()}
    words = [word for name, value in (conditions | settings).items() for word in (f"--{name}", value)]
    libsumo.start(["sumo", "-n", str(ramp.net), "-r", str(routes), *words])
    try:
        yield libsumo, Driven(TrafficWorld(Session(libsumo), ramp, host=host), method, Rules(horizon=horizon))
    finally:
        libsumo.close()


class Driven:
    """A method in a world of living traffic whose steps are made by the test."""

    def __init__(self, world, method, rules):
        driver = HostDriver(estimators[method](), Acc())
        self.world = world
        self.loop = Loop(world, None, driver, BySumo(), rules, Setting(), Everything())

    def cycle(self):
        """Observe what the last step did, and command the next one."""
        self.world.read()
        self.loop.after_step()
        self.loop.before_step()

    def close(self):
        """End what is open; returns the run."""
        run = self.loop.finish()
        self.world.note_absent()
        return run


def drive(api, driven, cycles, each=None):
    """Step SUMO and the method; `each` is called with the cycle's number between them."""
    for cycle in range(cycles):
        api.simulationStep()
        if each:
            each(cycle)
        driven.cycle()
