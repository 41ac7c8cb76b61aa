"""The page of the environments runs from top to bottom, with little training, and its policy is a method."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

import merge_cosim as mc
from merge_cosim.bench.peers import environment_steps
from merge_cosim.controllers.policy import Policy, save_policy
from merge_cosim.core.features import FEATURES
from merge_cosim.core.observation import Observation, Setting

PAGE = Path(__file__).parents[2] / "docs" / "gym.md"


def test_every_snippet_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = PAGE.read_text(encoding="utf-8")
    long = "GENERATIONS, CANDIDATES, CASES, HIDDEN, SEED = 60, 64, 192, 8, 0"
    assert long in text
    text = text.replace(long, "GENERATIONS, CANDIDATES, CASES, HIDDEN, SEED = 2, 8, 4, 8, 0")
    text = text.replace('mc.sweep("designed-3"', 'mc.sweep("designed-3", settings={"encounters.count": 40}')
    names = {}
    for number, block in enumerate(re.findall(r"```python\n(.*?)```", text, re.DOTALL)):
        exec(compile(block, f"snippet {number}", "exec"), names)
    assert names["picture"].shape == (220, 800, 3)
    assert names["results"].methods == ["acc", "policy:policy.json"]


def test_the_speed_is_measured():
    assert environment_steps(64, warm_up=2, steps=2, settings={"encounters.count": 40}) > 100


def test_a_policy_is_the_network_that_was_saved(tmp_path):
    random = np.random.default_rng(1)
    layers = [(random.normal(size=(5, 8)), random.normal(size=5)), (random.normal(size=(1, 5)), np.array([0.3]))]
    mean, scale = random.normal(size=8), np.full(8, 30.0)
    save_policy(tmp_path / "one.json", FEATURES, layers, mean, scale)
    policy = Policy(file=str(tmp_path / "one.json"))
    policy.start(7, Setting())
    states = random.uniform(-50.0, 20.0, (2, 7)), random.uniform(5.0, 25.0, (2, 7))
    seen = Observation(states[0][0], states[1][0], states[0][1], states[1][1], *np.full((2, 7), 5.0))
    given = policy.command(seen, np.zeros(7), np.zeros(7, dtype=bool))
    x = np.array([seen.host_station, seen.host_speed, seen.merging_station, seen.merging_speed, seen.host_arrival])
    x = np.concatenate([x, [seen.merging_arrival, seen.gap, seen.merging_station - seen.host_station]])
    (first, bias), (last, offset) = layers
    wanted = last @ np.tanh(first @ ((x - mean[:, None]) / scale[:, None]) + bias[:, None]) + offset
    assert given == pytest.approx(np.clip(wanted[0], -4.0, 2.0), rel=1e-12)
    assert (np.abs(wanted) < 2.0).sum() > 0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"mean": [0.0, 0.0]}, "one number per feature"),
        ({"layers": [[[[1.0]], [0.0, 0.0]]]}, "do not fit each other"),
        ({"layers": [[[[float("nan")]], [0.0]]]}, "no finite number"),
        ({"observation": ["speed"]}, "no feature 'speed'"),
        ({"scale": None}, "not a policy"),
    ],
)
def test_damaged_policies_are_refused(tmp_path, change, message):
    file = tmp_path / "one.json"
    save_policy(file, ["host_speed"], [([[1.0]], [0.0])])
    file.write_text(json.dumps(json.loads(file.read_text("utf-8")) | change), encoding="utf-8")
    with pytest.raises(mc.UserError, match=message):
        Policy(file=str(file)).start(1, Setting())


def test_an_absent_policy_is_refused_in_one_line():
    with pytest.raises(mc.UserError, match="absent\\.json: cannot be read"):
        mc.sweep("designed-3", methods=["policy:absent.json"], world="closed-form", jobs=1)
