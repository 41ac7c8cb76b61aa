"""The columns of a result folder: initial states, world, stuck hosts and version, from a real sweep; and their page."""

import json
from pathlib import Path

import measures_page
import numpy as np
import pyarrow.parquet as pq
import pytest

from merge_cosim.cli.main import main
from merge_cosim.core.errors import UserError
from merge_cosim.results.schema import SCHEMA, SCHEMA_VERSION, VERSION_KEY
from merge_cosim.results.store import ResultFolder

SCENARIO = """
title = "Four cases"
about = "Cases named by a user."
ramp = "designed"

[encounters]
kind = "grid"
merging_station = -60
host_offset = { from = -2.5, to = 2.5, step = 5 }
host_speed = { from = 10, to = 10, step = 1 }
merging_speed = { from = 10, to = 15, step = 5 }

[merging]
model = "designed"
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("schema")
    (path / "mine.toml").write_text(SCENARIO, encoding="utf-8")
    methods = ("--method", "always-brake", "--method", "always-go", "--jobs", "1")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            "sys.argv", ["merge-cosim", "sweep", str(path / "mine.toml"), *methods, "--out", str(path / "out")]
        )
        with pytest.raises(SystemExit) as ended:
            main()
    assert not ended.value.code
    return ResultFolder(path / "out")


def test_initial_states_are_columns(folder):
    rows = folder.results().to_pandas()
    brake = rows[rows["method"] == "always-brake"]
    states = brake[["host_station_0_m", "host_speed_0", "merging_station_0_m", "merging_speed_0"]]
    expected = {(offset - 60.0, 10.0, -60.0, speed) for offset in (-2.5, 2.5) for speed in (10.0, 15.0)}
    assert set(states.itertuples(index=False, name=None)) == expected
    assert set(rows["world"]) == {"sumo"}


def test_a_host_that_never_arrives_is_stuck_and_counted(folder):
    rows = folder.results().to_pandas()
    stuck = rows["method"] == "always-brake"
    np.testing.assert_array_equal(rows["stuck"], stuck)
    assert not rows.loc[stuck, ["failed", "censored", "host_reached"]].to_numpy().any()
    summary = {row["method"]: row for row in json.loads((folder.path / "summary.json").read_text(encoding="utf-8"))}
    brake, go = summary["always-brake"], summary["always-go"]
    assert (brake["stuck"], brake["failed_or_stuck_pct"], brake["failed_or_stuck_pct_worst"]) == (4, 100.0, 100.0)
    assert (brake["failures"], brake["failure_pct"], brake["failure_pct_worst"]) == (0, 0.0, 0.0)
    assert (go["stuck"], go["failed_or_stuck_pct"]) == (0, go["failure_pct"])


def test_another_version_is_refused_in_one_line(folder, tmp_path):
    rows = folder.results()
    assert rows.schema.metadata[VERSION_KEY].decode() == SCHEMA_VERSION
    pq.write_table(rows.replace_schema_metadata({VERSION_KEY: "3"}), tmp_path / "results.parquet")
    with pytest.raises(UserError, match=r"result schema 3, expected 4; run the sweep again$"):
        ResultFolder(tmp_path).results()


def test_the_page_is_that_of_the_code(tmp_path):
    measures_page.main(["--docs", str(tmp_path)])
    page = (Path(__file__).parents[2] / "docs" / "measures.md").read_text(encoding="utf-8")
    assert (tmp_path / "measures.md").read_text(encoding="utf-8") == page, "run python tools/measures_page.py"
    assert all(f"| `{name}` |" in page for name in SCHEMA.names if not name[-1].isdigit() or name.endswith("_0"))
