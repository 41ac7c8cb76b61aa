"""The model's file: what is written is read again, and what is no model is refused by name."""

import json
import subprocess
import sys
from dataclasses import fields

import numpy as np
import pytest
from small import small_model

from merge_cosim.core.errors import UserError
from merge_cosim.estimators.learned.model import IntentionModel
from merge_cosim.estimators.pgm import Pgm


def test_prior():
    assert small_model().prior_log_odds == pytest.approx(np.log(1 / 2))


def test_a_missing_lag_is_refused():
    with pytest.raises(UserError, match="transition_lag 5"):
        Pgm(transition_lag=5).use(small_model())


@pytest.mark.parametrize("name", ["small", "us101-ngsim", "us101-surrogate"])
def test_a_model_survives_its_file(tmp_path, name):
    model = small_model() if name == "small" else IntentionModel.load(name)
    model.save(tmp_path / "m.json")
    again = IntentionModel.load(tmp_path / "m.json")
    for field in fields(model):
        if field.name not in ("speeds", "arrivals", "pairs"):
            assert getattr(again, field.name) == getattr(model, field.name)
    np.testing.assert_array_equal(again.pairs, model.pairs)
    np.testing.assert_allclose(again.arrivals.shares, model.arrivals.shares, atol=1e-6)
    assert again.speeds.keys() == model.speeds.keys()
    for lag, speed in model.speeds.items():
        for part in fields(speed):
            one, other = getattr(speed, part.name), getattr(again.speeds[lag], part.name)
            for field in fields(one):
                np.testing.assert_array_equal(getattr(one, field.name), getattr(other, field.name))
    assert again.to_json() == model.to_json()


def spoil(document, *path, value):
    for key in path[:-1]:
        document = document[key]
    document[path[-1]] = value


@pytest.mark.parametrize("text", ["", "{}", "[1]", '{"schema": 99}', "not json"])
def test_what_is_no_model_is_refused_by_name(tmp_path, text):
    file = tmp_path / "bad.json"
    file.write_text(text)
    with pytest.raises(UserError, match=r"bad\.json"):
        IntentionModel.load(file)


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (("mixtures", "1", "weights", "YIELD"), [0.9, 0.9]),
        (("mixtures", "1", "covariances", "NOT_YIELD"), [[[1.0, 2.0], [2.0, 1.0]]] * 2),
        (("mixtures", "1"), {}),
        (("gaussians", "1", "sigma", "YIELD"), [0.1]),
        (("gaussians", "1", "sigma", "YIELD"), [-0.1] * 8),
        (("transitions", "1", "YIELD"), [[99, 0, 1]]),
        (("pairs",), {"YIELD": 3}),
    ],
)
def test_a_damaged_part_is_one_clear_line(tmp_path, path, value):
    document = json.loads(small_model().to_json())
    spoil(document, *path, value=value)
    file = tmp_path / "bad.json"
    file.write_text(json.dumps(document))
    with pytest.raises(UserError, match=r"bad\.json: not a merge-cosim model") as error:
        IntentionModel.load(file)
    assert "\n" not in str(error.value)


def test_running_needs_no_scikit_learn():
    """Worker processes and the command line start without it; only training loads it."""
    code = """
import sys
import numpy as np
import merge_cosim.cli.main
from merge_cosim.estimators.base import estimators
from merge_cosim.estimators.learned.model import IntentionModel
from merge_cosim.core.observation import Observation, Setting
model = IntentionModel.load("us101-ngsim")
ones = np.ones(3)
for name in estimators.names():
    estimator = estimators[name]()
    estimator.use(model)
    estimator.start(3, Setting())
    estimator.update(Observation(-9 * ones, ones, -9 * ones, ones, ones, ones))
assert "sklearn" not in sys.modules
"""
    subprocess.run([sys.executable, "-c", code], check=True)
