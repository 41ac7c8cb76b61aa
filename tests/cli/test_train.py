"""Training through the command line, on real data."""

import json

import numpy as np
from command import merge_cosim

from merge_cosim.estimators.learned.model import IntentionModel
from merge_cosim.studies.judging import DENSITIES, JUDGED


def test_the_shipped_model_is_what_training_makes(tmp_path, data_dir):
    done = merge_cosim("train", "--data", data_dir, "--source", "ngsim", "--out", "mine.json", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    report = json.loads(done.stdout)
    assert report["source"] == "ngsim"
    assert {row["estimator"] for row in report["held_out"]} == set(JUDGED)
    assert all(row["transitions"] > 0 and set(DENSITIES) <= set(row) for row in report["densities"])
    mine, shipped = IntentionModel.load(tmp_path / "mine.json"), IntentionModel.load("us101-ngsim")
    assert mine.trained_on == shipped.trained_on
    for lag, speed in shipped.speeds.items():
        np.testing.assert_array_equal(mine.speeds[lag].histogram.counts, speed.histogram.counts)
        np.testing.assert_allclose(mine.speeds[lag].gaussian.sigma, speed.gaussian.sigma, atol=1e-6)
        np.testing.assert_allclose(mine.speeds[lag].mixture.covariances, speed.mixture.covariances, atol=1e-4)


def test_a_model_file_ends_in_json(tmp_path, data_dir):
    done = merge_cosim("train", "--data", data_dir, "--source", "ngsim", "--out", "model.txt", cwd=tmp_path)
    assert done.returncode == 2
    assert "ends in .json" in done.stderr
    assert not (tmp_path / "model.txt").exists()
