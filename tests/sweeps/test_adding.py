"""What is added to a finished sweep: the rows are those of one sweep of all."""

import pandas as pd
import pytest

import merge_cosim as mc
from merge_cosim.results import merged_rows, parts
from merge_cosim.results.store import SCENES_CSV, TRAFFIC_CSV
from merge_cosim.sweeps.adding import joined

TIMES = ["cycle_us", "cycle_us_single"]
GRID = {"encounters.host_speed.step": 10, "encounters.merging_speed.step": 10, "encounters.host_offset.step": 5}


SMALL = """
title = "A coarse grid"
ramp = "designed"
merging.model = "designed"

[encounters]
kind = "grid"
host_offset = { from = -4, to = 4, step = 4 }
host_speed = { from = 5, to = 25, step = 10 }
merging_speed = { from = 5, to = 25, step = 10 }
"""


def swept(out, scenarios, methods, count=None, **more):
    settings = {"encounters.count": count} if count else GRID if scenarios == "designed-2" else {}
    how = {"settings": settings, "world": "closed-form", "jobs": 1, "progress": False, "out": out}
    return mc.sweep(scenarios, methods, **(how | more))


def same(one, other):
    """The same rows, byte for byte, and the same summary, cycle times aside."""
    assert (one.path / "results.parquet").read_bytes() == (other.path / "results.parquet").read_bytes()
    pd.testing.assert_frame_equal(one.summary().drop(columns=TIMES), other.summary().drop(columns=TIMES))
    identity = [{k: v for k, v in results.manifest.items() if not k.endswith("_s")} for results in (one, other)]
    for name in ("methods", "parameters", "scenarios", "encounters", "models", "settings", "variations", "against"):
        assert identity[0][name] == identity[1][name], name


@pytest.mark.slow
def test_added_methods_scenarios_and_variations_give_the_rows_of_one_sweep(tmp_path, monkeypatch):
    for module in (parts, merged_rows):
        monkeypatch.setattr(module, "STRETCH_ROWS", 20)
    first, second = (tmp_path / f"{name}.toml" for name in ("first", "second"))
    first.write_text(SMALL)
    second.write_text(SMALL.replace("step = 4", "step = 8"))
    grown, headways = tmp_path / "grown", {"acc.headway": [1.0]}
    swept(grown, second, ["acc", "oracle-best"])
    swept(grown, second, ["pgm", "acc"], add=True)
    swept(grown, first, None, add=True)  # without methods: those that it holds
    one = swept(grown, [first, second], None, vary=headways, add=True)
    every = swept(tmp_path / "every", [second, first], ["oracle-best", "pgm", "acc"], vary=headways)
    same(one, every)
    assert set(one.traces["method"]) == {"acc", "pgm", "always-go", "always-yield"}
    assert one.summary()["cycle_us"].notna().sum() == every.summary()["cycle_us"].notna().sum()


def test_more_cases_of_a_random_scenario(tmp_path):
    swept(tmp_path / "grown", "designed-random", ["acc"], count=40)
    one = swept(tmp_path / "grown", "designed-random", None, count=60, add=True)
    assert one.manifest["command"]["added"]
    same(one, swept(tmp_path / "every", "designed-random", ["acc"], count=60))


def test_what_is_there_already_is_not_run_again(tmp_path):
    before = swept(tmp_path / "out", "designed-2", ["acc", "pgm"])
    held = (before.path / "results.parquet").read_bytes()
    again = swept(tmp_path / "out", "designed-2", ["pgm"], add=True)
    assert (again.path / "results.parquet").read_bytes() == held
    assert again.manifest["vehicle_steps"] == 0
    assert joined(before.manifest, before.manifest, "pgm", before.path)["methods"] == ["acc", "pgm"]


def test_scenes_are_added_with_their_facts_and_notes(tmp_path):
    how = {"world": "sumo", "settings": {"encounters.replications": 1, "encounters.demand.duration": 120}}
    swept(tmp_path / "grown", "traffic-light", ["acc"], **how)
    one = swept(tmp_path / "grown", "traffic-light", ["always-go"], **how, add=True)
    every = swept(tmp_path / "every", "traffic-light", ["acc", "always-go"], **how)
    same(one, every)
    for name in (SCENES_CSV, TRAFFIC_CSV):
        assert (one.path / name).read_bytes() == (every.path / name).read_bytes()
    assert one.notes() == [line.replace(str(every.path), str(one.path)) for line in every.notes()]


@pytest.mark.parametrize(
    ("methods", "more", "message"),
    [
        (["pgm"], {"settings": GRID | {"test.horizon": 5}}, "scenarios designed-2"),
        (["pgm"], {"settings": GRID | {"acc.headway": 2}}, "--set acc.headway=2"),
        (["pgm"], {"world": "sumo"}, "world"),
        (["pgm"], {"seed": 1}, "seed"),
        (["pgm"], {"against": "slot"}, "--against slot: no such method"),
        (["pgm"], {"settings": GRID | {"encounters.merging_station": -95}}, "begins otherwise there"),
    ],
)
def test_other_settings_are_refused(tmp_path, methods, more, message):
    before = swept(tmp_path / "out", "designed-2", ["acc"])
    held = (before.path / "results.parquet").read_bytes()
    with pytest.raises(mc.UserError, match=message):
        swept(tmp_path / "out", "designed-2", methods, **more, add=True)
    assert (before.path / "results.parquet").read_bytes() == held
    assert mc.load_results(before.path).methods == ["acc"]  # and not taken for unfinished


def test_there_must_be_a_finished_sweep(tmp_path):
    with pytest.raises(mc.UserError, match=r"manifest\.json: missing"):
        swept(tmp_path / "out", "designed-2", ["acc"], add=True)
