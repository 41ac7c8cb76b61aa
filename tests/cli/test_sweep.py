"""Sweeps through the real command line."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time

import pyarrow.parquet as pq
import pytest
from command import merge_cosim, refused, small_scenario, summary

from merge_cosim.core.errors import UserError
from merge_cosim.core.files import shipped
from merge_cosim.results.store import ResultFolder
from merge_cosim.scenarios.scenario import scenario_names
from merge_cosim.sweeps.cases import PairCases

CONTRACT = [
    "scenario",
    "source",
    "case",
    "method",
    "failed",
    "failure_kind",
    "censored",
    "host_reached",
    "host_first",
    "label",
    "distance_m",
    "gap_m",
    "min_gap_m",
    "min_ttc_s",
    "delay_s",
    "hardest_braking",
    "decision_flips",
    "correct_at_merge",
]
SUMMARY_CONTRACT = [
    "scenario",
    "source",
    "method",
    "n",
    "failures",
    "failure_pct",
    "ci_low_pct",
    "ci_high_pct",
    "distance_m",
    "delay_s",
    "cycle_us",
    "cycle_us_single",
]


@pytest.mark.slow
def test_a_sweep_writes_the_promised_files(tmp_path):
    scenario = small_scenario(tmp_path)
    done = merge_cosim("sweep", scenario, "--out", "out", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    document = json.loads(done.stdout)
    rows = pq.read_table(tmp_path / "out/results.parquet").to_pandas()
    methods = sorted(rows["method"].unique())
    assert {"acc", "slot", "pgm", "always-go", "always-yield", "always-brake", "oracle-best"} <= set(methods)
    assert "oracle-label" not in methods  # there is no label here
    assert (rows.groupby("method").size() == 75).all()
    assert set(CONTRACT) <= set(rows.columns)
    listed = document["summary"]
    assert set(SUMMARY_CONTRACT) <= set(listed[0])
    for row in listed:
        own = rows[rows["method"] == row["method"]]
        assert row["failures"] == own["failed"].sum()
        assert row["n"] == (~own["censored"]).sum()
        assert row["ci_low_pct"] is None  # a fixed grid is no sample
    manifest = json.loads((tmp_path / "out/manifest.json").read_text())
    assert manifest["vehicle_steps"] > 0
    assert manifest["worst_station_difference_m"] < 1e-6
    assert not (tmp_path / "out/parts").exists()
    best = summary(tmp_path / "out")["oracle-best"]
    assert best["failures"] <= min(
        summary(tmp_path / "out")[name]["failures"] for name in ("always-go", "always-yield")
    )


def test_one_process_or_two_give_the_same_bytes(tmp_path):
    scenario = small_scenario(tmp_path)
    for jobs in (1, 2):
        arguments = ("sweep", scenario, "--method", "pgm", "--method", "slot", "--out", f"out{jobs}", "--jobs", jobs)
        assert merge_cosim(*arguments, cwd=tmp_path).returncode == 0
    one, two = ((tmp_path / f"out{jobs}/results.parquet").read_bytes() for jobs in (1, 2))
    assert one == two


def test_a_case_alone_ends_as_in_the_sweep(tmp_path):
    scenario = small_scenario(tmp_path)
    merge_cosim("sweep", scenario, "--method", "acc", "--out", "out", cwd=tmp_path)
    in_sweep = {row["case"]: row for row in pq.read_table(tmp_path / "out/results.parquet").to_pylist()}
    for case in ("d+0_h15_m15", "d-4_h25_m5"):
        alone = merge_cosim(
            "run", scenario, "--case", case, "--method", "acc", "--trace", f"{case}.csv", "--json", cwd=tmp_path
        )
        assert alone.returncode == 0, alone.stderr
        row = {name: float(v) if v in ("inf", "-inf") else v for name, v in json.loads(alone.stdout).items()}
        assert row == in_sweep[case]
        assert (tmp_path / f"{case}.csv").read_text().startswith("time_s,host_station_m")


def test_variations_and_settings(tmp_path):
    scenario = small_scenario(tmp_path)
    done = merge_cosim(
        *("sweep", scenario, "--method", "acc", "--method", "always-go", "--set", "test.horizon=2"),
        *("--vary", "merging.ahead=clear,any", "--vary", "pgm.nodes=1:3:1", "--vary", "speed_limit=20,29,20"),
        *("--method", "pgm", "--out", "out"),
        cwd=tmp_path,
    )
    assert done.returncode == 0, done.stderr
    rows = json.loads((tmp_path / "out/summary.json").read_text())
    seen = {(row["variation"], row["method"]) for row in rows}
    assert ("merging.ahead=any", "acc") in seen
    assert ("speed_limit=20", "always-go") in seen
    assert ("pgm.nodes=2", "pgm") in seen
    assert ("pgm.nodes=2", "acc") not in seen  # it has no such parameter, so nothing would change
    assert all(row["n"] == 75 for row in rows)  # also where a value is named twice
    by = {(row["variation"], row["method"]): row["failures"] for row in rows}
    assert by["merging.ahead=any", "acc"] <= by["merging.ahead=clear", "acc"]


def interrupt(tmp_path, sent, *arguments, once="*.parquet"):
    """Start a sweep and send it, and its workers, a signal once a part is there; returns its status and last words."""
    running = subprocess.Popen(
        [sys.executable, "-c", IN_SMALL_CHUNKS, "sweep", *arguments, "--out", "out", "--jobs", "2"],
        cwd=tmp_path,
        env=os.environ,
        stderr=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # a shell's background jobs ignore it
    )
    deadline = time.monotonic() + 60
    while not list(tmp_path.glob(f"out/parts/{once}")) and time.monotonic() < deadline:
        time.sleep(0.02)
    os.killpg(running.pid, sent)
    _, error = running.communicate(timeout=60)
    return running.returncode, error


IN_SMALL_CHUNKS = """
from merge_cosim.cli.main import main
from merge_cosim.sweeps.cases import PairCases
if __name__ == "__main__":
    PairCases.most = 40
    main()
"""
LONG = ("designed-random", "--set", "encounters.count=400")


@pytest.fixture(scope="module")
def unbroken(tmp_path_factory):
    """The rows of a sweep that nothing interrupts."""
    folder = tmp_path_factory.mktemp("unbroken")
    arguments = (*LONG, "--method", "acc", "--method", "slot-time")
    assert merge_cosim("sweep", *arguments, "--out", "whole", cwd=folder).returncode == 0
    return (folder / "whole/results.parquet").read_bytes()


@pytest.mark.slow
@pytest.mark.parametrize("sent", [signal.SIGINT, signal.SIGKILL])
def test_an_interrupted_sweep_goes_on_to_the_same_bytes(tmp_path, sent, unbroken, monkeypatch):
    monkeypatch.setattr(PairCases, "most", 40)
    arguments = (*LONG, "--method", "acc", "--method", "slot-time")
    status, error = interrupt(tmp_path, sent, *arguments)
    assert status == (130 if sent == signal.SIGINT else -sent)
    assert ("--resume" in error) == (sent == signal.SIGINT)
    assert "Traceback" not in error
    kept = {file.name: file.stat().st_mtime_ns for file in tmp_path.glob("out/parts/*.parquet")}
    assert 0 < len(kept) < 20
    if sent == signal.SIGKILL:
        refused_without_leave(tmp_path, arguments)
    assert {file.name: file.stat().st_mtime_ns for file in tmp_path.glob("out/parts/*.parquet")} == kept
    next(tmp_path.glob("out/parts/*.parquet")).write_bytes(b"")  # as after a fault of the disk
    in_another_order = (*LONG, "--method", "slot-time", "--method", "acc")
    resumed = merge_cosim("sweep", *in_another_order, "--out", "out", "--resume", cwd=tmp_path)
    assert resumed.returncode == 0, resumed.stderr
    assert (tmp_path / "out/results.parquet").read_bytes() == unbroken


def test_an_interrupt_before_the_workers_are_ready_is_one_line(tmp_path):
    status, error = interrupt(tmp_path, signal.SIGINT, "designed-random", "--method", "acc", once="plan.json")
    assert (status, error) == (130, "interrupted: what was finished is kept in out; go on with --resume\n")


def refused_without_leave(tmp_path, arguments):
    """An interrupted sweep is neither overwritten nor mixed with another, nor shown."""
    with pytest.raises(UserError, match="unfinished sweep"):
        ResultFolder(tmp_path / "out").results()
    again = ("sweep", *arguments, "--out", "out")
    assert "--resume" in refused(*again, cwd=tmp_path)
    assert "scenarios, settings changed" in refused(*again, "--set", "test.horizon=2", "--resume", cwd=tmp_path)
    plan = tmp_path / "out/parts/plan.json"
    held = json.loads(plan.read_text())
    plan.write_text(json.dumps(held | {"versions": held["versions"] | {"merge-cosim's source": "another"}}))
    assert "versions changed" in refused(*again, "--resume", cwd=tmp_path)
    plan.write_text(json.dumps(held))


SLIPS = (
    ("misspelt", "ramp =", "rmap ="),
    ("backwards", "host_speed = { from = 5", "host_speed = { from = -5"),
    ("kind", 'kind = "grid"', 'kind = "gird"'),
    ("model", 'model = "designed"', 'model = "designd"'),
    ("step", "step = 4", "stp = 4"),
)


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (("sweep", "designed2"), "did you mean 'designed-2'"),
        (("sweep", "small.toml", "--method", "pgn"), "did you mean 'pgm'"),
        (("sweep", "small.toml", "--method", "acc+foo"), "unknown controller 'foo'"),
        (("sweep", "small.toml", "--set", "acc.headwy=1"), "did you mean 'headway'"),
        (("sweep", "small.toml", "--set", "acc.headway=x"), "headway = 'x'"),
        (("sweep", "small.toml", "--method", "acc", "--set", "lqr.headway=1"), "no chosen method has"),
        (("sweep", "small.toml", "./small.toml"), "another scenario is called 'small', too"),
        (("sweep", "small.toml", "--set", "test.horizn=1"), "small.toml: unknown key 'test.horizn'"),
        (("sweep", "small.toml", "--set", "speed_limit=nan"), "speed_limit"),
        (("sweep", "small.toml", "--set", "ramp=nosuch"), "no ramp 'nosuch'"),
        (("sweep", "small.toml", "--set", "encounters.merging_station=-900"), "off the net"),
        (("sweep", "small.toml", "--set", "merging.model=replay"), "replay"),
        (("sweep", "small.toml", "--vary", "acc.headway=1:2:0"), "NAME=A:B:STEP"),
        (("sweep", "small.toml", "--model", "nosuch", "--method", "pgm"), "nosuch: no such model file"),
        (("sweep", "small.toml", "--method", "acc", "--out", ""), "an argument is empty"),
        (("sweep", "small.toml", "--method", "acc", "--out="), "an argument is empty"),
        (("sweep", "small.toml", "--method", "acc", "--model", "nosuch.json"), "nosuch.json"),
        (("sweep", "small.toml", "--plugin", "nosuch.py"), "nosuch.py: no such plugin file"),
        (("sweep", "us101-replay", "--source", "ngsim"), "MERGE_COSIM_DATA"),
        (("sweep", "us101-replay", "--data", "nosuch"), "nosuch: no such folder"),
        (("sweep", "misspelt.toml"), "misspelt.toml: unknown key 'rmap'; did you mean 'ramp'"),
        (("sweep", "us101-replay", "--data", "elsewhere"), "elsewhere: no row of i80 or us101"),
        (("sweep", "small.toml", "--vary", "acc.headway"), "--vary acc.headway: write NAME=A:B:STEP"),
        (("sweep", "small.toml", "--out", "small.toml"), "small.toml: is a file"),
        (("sweep", "small.toml", "--out", "small.toml/out"), "small.toml/out"),
        (("sweep", "backwards.toml"), "backwards.toml: encounters.host_speed: a speed must not be negative"),
        (("sweep", "kind.toml"), "kind.toml: encounters.kind = 'gird': there is no such kind"),
        (("sweep", "model.toml"), "model.toml: unknown merging car 'designd'; did you mean 'designed'"),
        (("sweep", "step.toml"), "unknown key 'encounters.host_offset.stp'; did you mean 'step'"),
        (("sweep", "empty.toml"), "empty.toml: the key 'title' is missing"),
        (
            ("sweep", "small.toml", "--set", "ramp=no-edge"),
            "no-edge/ramp.toml: main: the net designed.net.xml has no edge",
        ),
        (("sweep", "small.toml", "--set", "ramp=no-net"), "designed.net.xml: no such net"),
        (("sweep", "small.toml", "--model", "empty.toml", "--method", "pgm"), "empty.toml: not a merge-cosim model"),
        (("sweep",), "Missing argument 'SCENARIO...'"),
        (("sweep", "small.toml", "--jobs", "0"), "--jobs"),
        (("sweep", "small.toml", "--source", "nosuch"), "'nosuch' is not one of"),
        (("train", "--data", "elsewhere", "--out", "m.json"), "elsewhere: no row of i80 or us101"),
        (("train", "--source", "surrogate", "--out", "m.txt"), "m.txt: a model file ends in .json"),
        (("export", "small.toml", "--case", "d+0_h5_m5", "--out", "small.toml"), "small.toml: cannot be"),
        (("report", "elsewhere"), "elsewhere/results.parquet: no results here"),
        (("ngsim", "import", "elsewhere", "--out", "imported"), "elsewhere: cannot be read: Is a directory"),
        (("ngsim", "import", "empty.toml", "--out", "imported"), "empty.toml: not trajectory data: it is empty"),
        (("ngsim", "summary", "elsewhere"), "elsewhere: no trajectories of i80 or us101"),
        (("run", "small.toml", "--case", "nosuch", "--method", "acc"), "no case 'nosuch'"),
        (
            ("run", "small.toml", "--case", "d+0_h5_m5", "--method", "acc", "--trace", "small.toml/x.csv"),
            "small.toml: cannot be",
        ),
        (("sweep", "small.toml", "--method", "acc", "--against", "slto"), "--against slto: no such method"),
        (("sweep", "small.toml", "--method", "human"), "nothing to run"),
        (("sweep", "designed-3", "--set", "encounters.cuont=5"), "did you mean 'count'"),
        (("bounds", "traffic-light"), "bounds are for two cars alone"),
        (("run", "small.toml", "--case", "d+0_h5_m5", "--method", "acc", "--trace", "x.txt"), "x.txt"),
    ],
)
def test_mistakes_get_one_line_and_status_2(tmp_path, arguments, expected):
    text = small_scenario(tmp_path).read_text()
    for name, right, wrong in SLIPS:
        assert right in text
        (tmp_path / f"{name}.toml").write_text(text.replace(right, wrong, 1))
    (tmp_path / "empty.toml").touch()
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere/note.csv").write_text("Vehicle_ID,Location\n1,lankershim\n")
    for name in ("no-edge", "no-net"):
        shutil.copytree(shipped("sumo_nets") / "designed", tmp_path / name)
    (tmp_path / "no-net/designed.net.xml").unlink()
    ramp = tmp_path / "no-edge/ramp.toml"
    ramp.write_text(ramp.read_text().replace("main_in", "main_on"))
    assert expected in refused(*arguments, cwd=tmp_path)


def test_a_plugin_drives_like_ours(tmp_path):
    scenario = small_scenario(tmp_path)
    (tmp_path / "own").mkdir()
    (tmp_path / "own/mine.py").write_text(
        """
from dataclasses import dataclass
from typing import ClassVar
import numpy as np
from merge_cosim.estimators.base import Estimator, estimators

@estimators.register
@dataclass(kw_only=True)
class Hesitant(Estimator):
    \"\"\"YIELD only when far ahead.\"\"\"
    name: ClassVar[str] = "hesitant"
    lead: float = 10.0

    def update(self, seen):
        return np.where(seen.host_station - seen.merging_station > self.lead, -1.0, 1.0)
"""
    )
    listed = merge_cosim("methods", "--plugin", "own/mine.py", "--json", cwd=tmp_path)
    assert "hesitant" in {row["name"] for row in json.loads(listed.stdout)}
    arguments = (
        "--plugin",
        "own/mine.py",
        "--method",
        "hesitant",
        "--set",
        "hesitant.lead=2",
        "--jobs",
        2,
        "--out",
        "out",
    )
    done = merge_cosim("sweep", scenario, *arguments, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert summary(tmp_path / "out")["hesitant"]["n"] == 75
    listed = merge_cosim("cases", "out", cwd=tmp_path).stdout
    assert "--plugin own/mine.py" in listed  # as it was given, so that the command can be pasted


def test_a_plugin_that_breaks_is_named(tmp_path):
    small_scenario(tmp_path)
    (tmp_path / "broken.py").write_text("1 / 0")
    done = merge_cosim("sweep", "small.toml", "--plugin", "broken.py", cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr.startswith("merge-cosim: broken.py: cannot be imported: ")
    assert done.stderr.endswith("broken.py, line 1, in <module>: 1 / 0: ZeroDivisionError: division by zero\n")


HERE = ("--world", "closed-form", "--out", "out")
LATE = """
import merge_cosim as mc


@mc.estimator
class Late(mc.Estimator):
    name = "late"

    def update(self, seen):
        raise OSError(28, "No space left on device") if {full} else ValueError("too late")
"""


@pytest.mark.parametrize("full", [False, True])
def test_a_sweep_that_ran_no_case_leaves_nothing_unfinished(tmp_path, full):
    small_scenario(tmp_path)
    (tmp_path / "late.py").write_text(LATE.format(full=full))
    done = merge_cosim("sweep", "small.toml", "--method", "late", *HERE, "--plugin", "late.py", cwd=tmp_path)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert not (tmp_path / "out").exists()
    assert merge_cosim("sweep", "small.toml", "--method", "acc", *HERE, cwd=tmp_path).returncode == 0
    before = sorted(file.name for file in (tmp_path / "out").iterdir())
    again = ("sweep", "small.toml", "--method", "late", *HERE, "--plugin", "late.py", "--overwrite")
    assert merge_cosim(*again, cwd=tmp_path).returncode == 2
    assert sorted(file.name for file in (tmp_path / "out").iterdir()) == before


def test_help_lists_and_cache(tmp_path):
    assert "sweep" in merge_cosim("--help", cwd=tmp_path).stdout
    scenarios = json.loads(merge_cosim("scenarios", "--json", cwd=tmp_path).stdout)
    assert {"designed-1", "designed-2", "us101-replay", "i80-replay"} <= {one["scenario"] for one in scenarios}
    assert json.loads(merge_cosim("cache", "--json", cwd=tmp_path).stdout)["folder"]


@pytest.mark.slow
def test_replay_on_real_data(tmp_path, data_dir):
    methods = ("--method", "acc,pgm,human,oracle-label")
    done = merge_cosim("sweep", "us101-replay", "--data", data_dir, *methods, "--out", "out", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    rows = pq.read_table(tmp_path / "out/results.parquet").to_pandas()
    assert set(rows["source"]) == {"ngsim"}
    assert set(rows["label"]) == {"YIELD", "NOT_YIELD"}
    assert rows.loc[rows["method"] == "pgm", "model"].unique().tolist() == ["us101-ngsim"]
    human = rows[rows["method"] == "human"]
    assert len(human) == rows["case"].nunique()
    assert not human["failed"].any()
    assert human["human_station_rms_m"].max() < 1e-6
    assert human["correct_at_merge"].isna().all()
    assert (rows["world"] == "closed-form").equals(rows["method"] == "human")
    oracle = rows[rows["method"] == "oracle-label"]
    assert oracle["correct_at_merge"].dropna().all()


@pytest.mark.slow
def test_a_model_is_not_tested_on_its_own_training_cars(tmp_path, data_dir):
    done = merge_cosim(
        *("sweep", "us101-replay", "--data", data_dir, "--method", "pgm", "--set", "encounters.seed=5"), cwd=tmp_path
    )
    assert done.returncode == 2
    assert "was trained on" in done.stderr


def test_hidden_intentions_through_the_command_line(tmp_path):
    settings = ("--set", "encounters.count=60", "--set", "merging.sigma=0.2")
    methods = [word for name in ("slot-time", "pgm", "oracle-label", "human") for word in ("--method", name)]
    done = merge_cosim(
        "sweep", "designed-3", *settings, *methods, "--against", "slot-time", "--out", "out1", cwd=tmp_path
    )
    assert done.returncode == 0, done.stderr
    rows = summary(tmp_path / "out1")
    assert set(rows) == {"slot-time", "pgm", "oracle-label"}  # there is no logged host
    assert rows["pgm"]["against"] == "slot-time"
    assert rows["pgm"]["only_this_fails"] is not None
    assert rows["pgm"]["ci_high_pct"] > rows["pgm"]["failure_pct"]  # drawn cases are a sample
    assert {"belief.csv", "calibration.csv", "strata.csv"} <= {file.name for file in (tmp_path / "out1").iterdir()}
    case = pq.read_table(tmp_path / "out1/results.parquet").to_pylist()[5]
    alone = merge_cosim(
        *("run", "designed-3", *settings, "--case", case["case"], "--method", case["method"], "--json"), cwd=tmp_path
    )
    row = {name: float(v) if v in ("inf", "-inf") else v for name, v in json.loads(alone.stdout).items()}
    assert row == case
    report = merge_cosim("report", "out1", "--against", "oracle-label", cwd=tmp_path)
    assert report.returncode == 0, report.stderr
    assert "against oracle-label" in (tmp_path / "out1/report.html").read_text()
    unknown = merge_cosim("report", "out1", "--against", "nosuch", cwd=tmp_path)
    assert unknown.returncode == 2
    assert "--against nosuch" in unknown.stderr


def test_a_family_of_scenarios_is_run_as_one(tmp_path):
    words = (
        "--world",
        "closed-form",
        "--method",
        "acc,pgm",
        "--set",
        "encounters.count=2",
        "--traces",
        0,
        "--out",
        "out",
    )
    done = merge_cosim("sweep", "shifted", "designed-3", "shifted-idm", *words, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    rows = pq.read_table(tmp_path / "out/results.parquet").to_pandas()
    assert set(rows["scenario"]) == {"designed-3", *(name for name in scenario_names() if name.startswith("shifted-"))}
    assert len(rows) == 10 * 2 * 2
