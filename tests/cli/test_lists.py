"""The commands that list, the commands on result folders, and the options that they share."""

import inspect
import json
from typing import get_args

import pytest
from command import merge_cosim
from typer.models import OptionInfo
from typer.testing import CliRunner

from merge_cosim.cli import lists, options, results
from merge_cosim.core.errors import UserError

runner = CliRunner()


def test_the_cache_is_shown_and_cleared(tmp_path):
    made = tmp_path / "tiles" / "a" / "one.net.xml"
    made.parent.mkdir(parents=True)
    made.write_bytes(bytes(2**20))
    shown = [
        json.loads(
            runner.invoke(lists.app, ["cache", "--json", *more], env={"MERGE_COSIM_CACHE": str(tmp_path)}).stdout
        )
        for more in ((), ("--clear",), ())
    ]
    part = {"part": "tiles", "files": 1, "mib": 1.0}
    assert [(one["cleared"], one["parts"]) for one in shown] == [(False, [part]), (True, [part]), (False, [])]
    assert not made.exists()


@pytest.mark.parametrize(
    ("words", "shown"),
    [
        (["methods"], ("estimator", "controller", "merging car", "sensor", "oracle-best", "late-accelerating")),
        (["sensors"], ("radar", "perfect")),
        (["models"], ("us101-ngsim-all", "us101-surrogate")),
        (["scenarios"], ("shifted-margins-short", "US-101 replay")),
        (["scenarios", "designed-2"], ("Designed Test II, on the ramp designed", "11 x 25 x 25 =")),
    ],
)
def test_a_list_fits_80_columns(words, shown):
    done = runner.invoke(lists.app, words, env={"COLUMNS": "80"})
    assert done.exit_code == 0
    assert [text for text in shown if text not in done.stdout] == []
    assert max(map(len, done.stdout.splitlines())) <= 80


def test_every_shared_option_has_a_help_text():
    shared = {
        name: one for name, value in vars(options).items() for one in get_args(value)[1:] if isinstance(one, OptionInfo)
    }
    assert {"Data", "Jobs", "Json", "Seed", "Sets"} <= set(shared)
    assert all(one.help and inspect.cleandoc(one.help).endswith(".") for one in shared.values())


@pytest.mark.parametrize("words", [("report", "nothing"), ("compare", "nothing", "nothing")])
def test_a_folder_without_results_is_refused(tmp_path, monkeypatch, words):
    monkeypatch.chdir(tmp_path)
    done = runner.invoke(results.app, list(words))
    assert isinstance(done.exception, UserError)
    assert "nothing/results.parquet: no results here" in str(done.exception)


def test_worlds(tmp_path):
    done = merge_cosim("worlds", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert [row["world"] for row in json.loads(done.stdout)] == ["sumo", "closed-form"]
