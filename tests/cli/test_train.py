"""Training through the command line, on real data."""

import json

import numpy as np
import pandas as pd
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


def test_every_pair_is_tested_by_the_model_that_has_not_seen_its_car(tmp_path, data_dir):
    how = ("--data", data_dir, "--source", "ngsim")
    done = merge_cosim("train", *how, "--folds", 3, "--out", "models", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert [row["train_cars"] for row in json.loads(done.stdout)] == [38, 39, 39]
    sites = "encounters.sites={us101='all'}"
    sweep = ("sweep", "us101-replay", *how, "--method", "pgm", "--set", sites, "--model", "models", "--out", "out")
    done = merge_cosim(*sweep, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    rows = pd.read_parquet(tmp_path / "out" / "results.parquet")
    trained = {path.stem: set(IntentionModel.load(path).trained_on) for path in (tmp_path / "models").glob("*.json")}
    assert rows["case"].is_unique
    assert len(rows) == 102
    assert all(row.car not in trained[row.model] for row in rows.itertuples())
    ensemble = pd.read_csv(tmp_path / "out" / "ensemble.csv").iloc[0]
    assert (ensemble["models"], ensemble["n"], ensemble["failures"]) == (3, 101, rows["failed"].sum())


def test_wrong_numbers_of_models_are_one_line(tmp_path, data_dir):
    how = ("train", "--data", data_dir, "--source", "ngsim", "--out", "models")
    for numbers, expected in (
        (("--splits", 2, "--folds", 2), "not both"),
        (("--folds", 99), "99 folds of 58 merging"),
        (("--splits", 100_000), "train --splits 100000: no more than 1000 models"),
        (("--folds", 1001), "train --folds 1001: no more than 1000 models"),
    ):
        done = merge_cosim(*how, *numbers, cwd=tmp_path)
        assert done.returncode == 2
        assert expected in done.stderr
