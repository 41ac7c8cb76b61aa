"""Methods as objects and classes."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pandas as pd

import merge_cosim as mc

STATES = {"host_station": [-80.0, -90.0], "host_speed": 20.0, "merging_station": -90.0, "merging_speed": [18.0, 20.0]}


@dataclass(kw_only=True)
class Cautious(mc.Estimator):
    """YIELD only to a host that is well ahead."""

    name: ClassVar[str] = "cautious"
    lead: float = 10.0

    def update(self, seen):
        return np.where(seen.host_station - seen.merging_station > self.lead, -1.0, 1.0)


def test_objects_classes_and_pairs_are_methods():
    encounters = mc.Encounters.from_frame(pd.DataFrame(STATES))
    results = mc.sweep(encounters, ["acc", Cautious(lead=5), (Cautious, "lqr")], jobs=1)
    assert results.methods == ["acc", "cautious", "cautious+lqr"]
    run = mc.run(encounters, case="c0", method=Cautious(lead=15))
    assert run.row["method"] == "cautious"
    assert mc.sweep(encounters, Cautious, jobs=1).methods == ["cautious"]
