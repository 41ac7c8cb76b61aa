"""Sweeps of methods made of objects: their rows, and what the manifest keeps of them."""

import json
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from merge_cosim.core.errors import UserError
from merge_cosim.estimators.base import Estimator
from merge_cosim.scenarios.methods import MethodSpec
from merge_cosim.sweeps.plan import SweepRequest, plan
from merge_cosim.sweeps.sweep import sweep

FEW = {"encounters.host_speed.step": 20, "encounters.merging_speed.step": 10, "encounters.host_offset.step": 10}


class LeadRule(Estimator):
    """YIELD only to a host that leads."""

    lead: float = 10.0

    def update(self, seen):
        return np.where(seen.host_station - seen.merging_station > self.lead, -1.0, 1.0)


def named(name: str, **values: float) -> LeadRule:
    """A rule under a name of its own."""
    rule = LeadRule(**values)
    rule.name = name
    return rule


def request(*methods: MethodSpec, **settings: float) -> SweepRequest:
    """A sweep of a few cases of Designed Test II."""
    return SweepRequest(["designed-2"], methods, settings=FEW | {k.replace("__", "."): v for k, v in settings.items()})


def test_a_sweep_of_objects(tmp_path: Path) -> None:
    asked = request(named("short", lead=5), named("long", lead=30), (LeadRule, "lqr"), "acc", short__lead=0)
    sweep(asked, tmp_path)
    delay = pq.read_table(tmp_path / "results.parquet").to_pandas().groupby("method")["delay_s"].mean()
    assert set(delay.index) == {"short", "long", "lead-rule+lqr", "acc"}
    assert delay["short"] < delay["long"]
    manifest = json.loads((tmp_path / "manifest.json").read_text())
    assert manifest["parameters"]["short"]["short.lead"] == 0.0
    assert manifest["parameters"]["long"]["long.lead"] == 30.0
    assert manifest["parameters"]["lead-rule+lqr"]["lqr.headway"] == 1.5
    assert set(manifest["components"]) == {"lead-rule"}
    assert "class LeadRule(Estimator)" in manifest["components"]["lead-rule"]


def test_what_cannot_be_distinguished_or_reached_is_refused() -> None:
    with pytest.raises(UserError, match="two methods are called 'lead-rule'"):
        plan(request(LeadRule(lead=5.0), LeadRule(lead=6.0)))
    assert len(plan(request(LeadRule, LeadRule(lead=10.0)))) == 1
    with pytest.raises(UserError, match=r"lead-rule\.lad: 'lead-rule' has no parameter 'lad'; did you mean 'lead'"):
        plan(request(LeadRule, **{"lead-rule.lad": 3}))
