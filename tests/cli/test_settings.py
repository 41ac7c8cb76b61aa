"""Settings reach what they name or are refused; what the command line says of parameters; its options."""

import json

import pyarrow.parquet as pq
import pytest
from command import merge_cosim, refused, small_scenario

import merge_cosim as package


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (("--method", "pgm+lqr", "--set", "acc.headway=4"), "acc.headway: no chosen method has this parameter"),
        (("--method", "acc+lqr", "--set", "acc.headway=4"), "set lqr.headway, or choose another method"),
        (("--method", "pgm", "--vary", "lqr.q_gap=1,2"), "lqr.q_gap: no chosen method has this parameter"),
        (("--method", "human", "--set", "acc.k_free=1"), "acc.k_free: no chosen method has this parameter"),
        (("--method", "ipcb", "--set", "pcb.means=arrival"), "disagrees with ipcb.means = 'fixed'"),
        (("--set", "acc.headway=true"), "headway = True: Input should be a number"),
        (("--set", "acc.headway='1'"), "headway = '1': Input should be a number"),
        (("--set", "acc.headway=1e12"), "headway = 1000000000000.0: Input should be between -1e+09 and 1e+09"),
        (("--set", "acc.headway=-1"), "headway = -1: Input should be greater than or equal to 0"),
        (("--set", "acc.min_acceleration=-1000"), "min_acceleration = -1000: Input should be greater than or equal to"),
        (("--set", "pgm.nodes=1000000000"), "nodes = 1000000000: Input should be less than or equal to 10000"),
        (("--set", "pgm.nodes=true"), "nodes = True: Input should be a number"),
        (("--set", "pcb.candidate_step=1e-9"), "candidate_step = 1e-09: Input should be greater than or equal to 0.01"),
        (("--set", "test.horizon=true"), "test.horizon = True: Input should be a valid number"),
        (("--set", "merging.headway=true"), "headway = True: Input should be a number"),
        (("--set", "test.free.k_free=0"), "test.free.k_free = 0: Input should be greater than 0"),
        (("--set", "dbn-pf.start_yield=0.7"), "dbn-pf: start_yield and start_not_yield are more than 1 together"),
        (("--set", "dbn-pf.min_acceleration=5"), "dbn-pf: min_acceleration is above max_acceleration"),
        (("--set", "merging.model=hidden", "--set", "merging.min_margin=3"), "min_margin is above max_margin"),
        (("--set", "sensing.delay=-1"), "sensor noisy: delay = -1: Input should be greater than or equal to 0"),
        (
            ("--set", "sensing.model=lidar"),
            "unknown sensor 'lidar'; did you mean 'radar'? (choose from: camera",
        ),
        (("--set", "sensing.model=radar", "--set", "sensing.dely=1"), "no parameter 'dely'; did you mean 'delay'?"),
        (("--method", "acc,pgn"), "unknown estimator 'pgn'; did you mean 'pgm'?"),
        (("--method", ""), "an argument is empty"),
    ],
)
def test_what_reaches_nothing_or_makes_no_sense_is_refused(tmp_path, words, line):
    small_scenario(tmp_path)
    assert line in refused("sweep", "small.toml", *words, cwd=tmp_path)


def delays(folder, *words):
    done = merge_cosim("sweep", "small.toml", *words, "--out", "out", "--overwrite", "--jobs", 1, cwd=folder)
    assert done.returncode == 0, done.stderr
    return pq.read_table(folder / "out/results.parquet").to_pandas().set_index(["method", "case"])["delay_s"]


def test_the_sensor_is_a_setting(tmp_path):
    """Parameters alone are those of `noisy`; a table in the file is the same; without errors nothing changes."""
    small_scenario(tmp_path)
    usual = delays(tmp_path, "--method", "acc")
    assert delays(tmp_path, "--method", "acc", "--set", "sensing.model=noisy").equals(usual)
    words = ("--method", "acc", "--set", "sensing.delay=0.5", "--set", "sensing.station_sigma=3")
    changed = delays(tmp_path, *words)
    assert (changed != usual).mean() > 0.3
    assert delays(tmp_path, *words, "--set", "sensing.model=noisy", "--world", "closed-form").equals(changed)
    assert (delays(tmp_path, *words, "--seed", 1) != changed).any()
    with (tmp_path / "small.toml").open("a") as file:
        file.write('[sensing]\nmodel = "noisy"\ndelay = 0.5\nstation_sigma = 3\n')
    assert delays(tmp_path, "--method", "acc").equals(changed)


def test_each_setting_has_one_owner(tmp_path):
    """acc.* reaches the methods that drive with acc alone; the free driving of delays is the scenario's."""
    small_scenario(tmp_path)
    usual = delays(tmp_path, "--method", "acc, acc+lqr", "--method", "always-go")
    assert set(usual.index.get_level_values("method")) == {"acc", "acc+lqr", "always-go"}
    slower = delays(tmp_path, "--method", "acc,acc+lqr", "--set", "acc.k_free=0.2")
    assert slower["acc+lqr"].equals(usual["acc+lqr"])
    assert (slower["acc"] > usual["acc"]).any()
    slower_reference = delays(tmp_path, "--method", "acc+lqr", "--set", "test.free.k_free=0.2")
    assert (slower_reference["acc+lqr"] < usual["acc+lqr"]).any()


def test_a_component_is_described(tmp_path):
    printed = merge_cosim("methods", "acc", cwd=tmp_path).stdout
    assert "estimator acc\n" in printed
    assert "controller acc\n" in printed
    assert "headway           1.5      s      >= 0\n    Time headway T.\n" in printed
    assert "--set acc.PARAMETER=VALUE" in printed
    assert max(map(len, merge_cosim("methods", "ipcb+pcb", cwd=tmp_path).stdout.splitlines())) <= 80
    assert "--set merging.PARAMETER=VALUE" in merge_cosim("methods", "designed", cwd=tmp_path).stdout
    estimator, controller = json.loads(merge_cosim("methods", "pgm+pcb", "--json", cwd=tmp_path).stdout)
    assert (estimator["name"], estimator["controller"], controller["name"]) == ("pgm", "acc", "pcb")
    described = {row["name"]: row for row in estimator["parameters"] + controller["parameters"]}
    uniform = {"default": 0.05, "unit": "", "bounds": ">= 0, <= 1"}
    assert described["uniform"].items() >= uniform.items()
    assert described["steps"]["bounds"] == "whole, >= 1, <= 10000"
    assert described["means"]["bounds"] == "fixed, arrival"
    assert described["step"] == {
        "name": "step",
        "default": 0.5,
        "unit": "s",
        "bounds": "> 0",
        "meaning": "Length of a step.",
    }


@pytest.mark.parametrize(
    ("name", "line"),
    [
        ("pgn", "unknown component 'pgn'; did you mean 'pgm'?"),
        ("pgm+acd", "unknown component 'acd'; did you mean 'acc'?"),
        ("designed+acc", "unknown component 'designed'"),
    ],
)
def test_an_unknown_component_is_refused(tmp_path, name, line):
    assert line in refused("methods", name, cwd=tmp_path)


def test_version(tmp_path):
    done = merge_cosim("--version", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (0, f"merge-cosim {package.__version__}\n")


@pytest.mark.parametrize(
    ("typed", "offered"),
    [
        ("merge-cosim sw", ["sweep"]),
        ("merge-cosim sweep us101-re", ["us101-replay"]),
        ("merge-cosim sweep designed-2 --method acc,pgm+lq", ["acc,pgm+lqr", "acc,pgm+lqr-direct"]),
        ("merge-cosim run designed-2 --method ipc", ["ipcb"]),
    ],
)
def test_a_shell_completes(tmp_path, typed, offered):
    asked = {"_MERGE_COSIM_COMPLETE": "complete_bash", "COMP_WORDS": typed, "COMP_CWORD": str(typed.count(" "))}
    assert merge_cosim(cwd=tmp_path, **asked).stdout.split() == offered
