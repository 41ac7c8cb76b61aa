"""Classes of scripts, notebooks and files beside them reach worker processes and Dask workers."""

import os
import subprocess
import sys

import pytest

BESIDE = """
import numpy as np
import merge_cosim as mc

def leads(seen, lead):
    return np.where(seen.host_station - seen.merging_station > lead, -1.0, 1.0)

@mc.estimator
class Beside(mc.Estimator):
    lead: float = 3.0

    def update(self, seen):
        return leads(seen, self.lead)
"""
SCRIPT = """
import dataclasses
import sys
import numpy as np
import pandas as pd
import merge_cosim as mc
import beside

THRESHOLD = 0.0

class Refused(Exception):
    pass

@mc.estimator
class Known(mc.Estimator):
    def update(self, seen):
        return np.where(seen.host_station > seen.merging_station + THRESHOLD, -1.0, 1.0)

class Lead(mc.Estimator):
    lead: float = 10.0
    weights: list[float] = dataclasses.field(default_factory=list)

    def update(self, seen):
        assert self.weights == []
        if self.lead < 0:
            raise Refused(f"lead = {self.lead}")
        return beside.leads(seen, self.lead)

@mc.merging_car
class Steady(mc.MergingCar):
    def next_speed(self, age, now):
        return now.merging_speed

states = {"host_station": np.linspace(-95, -80, 6), "host_speed": 20.0, "merging_station": -90.0, "merging_speed": 18.0}
scenario = {"mine": mc.Encounters.from_frame(pd.DataFrame(states))}
methods = ["known", "beside", Lead(lead=5)]
more = {"settings": {"merging.model": "steady"}, "progress": False}
alone = mc.sweep(scenario, methods, jobs=1, **more)
print(len(alone), alone.rows["failed"].sum(), *sorted(alone.manifest["components"]))
assert mc.sweep(scenario, methods, jobs=2, **more).rows.equals(alone.rows)
try:
    mc.sweep(scenario, [Lead(lead=-1), "acc"], jobs=2, start="forkserver", **more)
except Refused as error:
    print(error)
if "dask" in sys.argv:
    assert mc.sweep(scenario, methods, jobs=1, dask="local", **more).rows.equals(alone.rows)
"""


@pytest.mark.slow
def test_a_script_without_a_guard_with_classes_of_its_own(tmp_path):
    pytest.importorskip("distributed", reason="dask.distributed is an extra: pip install 'merge-cosim[dask]'")
    (tmp_path / "beside.py").write_text(BESIDE, encoding="utf-8")
    (tmp_path / "study.py").write_text(SCRIPT, encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "study.py", "dask"], cwd=tmp_path, env=os.environ, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[0].split()[0] == "18"
    assert done.stdout.splitlines()[0].split()[2:] == ["beside", "known", "lead", "steady"]
    assert done.stdout.splitlines()[1:] == ["lead = -1"]  # the script ran once, and its own error came back


def test_what_a_sweep_depends_on():
    """Another text or parameter of a class is another sweep."""
    import merge_cosim as mc
    from merge_cosim.sweeps.identity import identity
    from merge_cosim.sweeps.plan import SweepRequest, plan

    def what(text, **values):
        scope = {"mc": mc, "__name__": "elsewhere"}
        exec(f"class Own(mc.Estimator):\n    lead: float = 1.0\n    def update(self, seen): return {text}", scope)
        few = {"encounters.host_speed.step": 24, "encounters.merging_speed.step": 24}
        request = SweepRequest(["designed-2"], [scope["Own"](**values)], settings=few)
        return identity(request, plan(request))

    assert what("seen.host_speed") == what("seen.host_speed")
    for other in (what("-seen.host_speed"), what("seen.host_speed + 1.0"), what("seen.host_speed", lead=2.0)):
        assert other != what("seen.host_speed")
