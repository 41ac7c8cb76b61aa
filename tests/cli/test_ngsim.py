"""The commands `ngsim import` and `ngsim download`."""

import json
import subprocess
import sys

import pyarrow.parquet as pq
import pytest
from typer.testing import CliRunner

from merge_cosim.cli.ngsim import app
from merge_cosim.core.errors import UserError

runner = CliRunner()


def test_import_as_json(data_dir, tmp_path):
    result = runner.invoke(app, ["import", str(data_dir / "us101.parquet"), "--out", str(tmp_path), "--json"])
    assert result.exit_code == 0
    done = json.loads(result.stdout)
    assert (done["rows"], done["kept"], done["repeats"]["dropped"]) == (98_732, 98_732, 0)
    assert len(done["recordings"]) == 11
    assert pq.read_metadata(done["written"]["us101"]).num_rows == 98_732


def test_import_for_people(data_dir, tmp_path):
    result = runner.invoke(app, ["import", str(data_dir / "us101.parquet"), "--site", "us101", "--out", str(tmp_path)])
    assert result.exit_code == 0
    assert "98,732 rows read, 98,732 kept" in result.stdout
    assert "us101_A" in result.stdout


def test_a_mistake_is_a_user_error(tmp_path):
    result = runner.invoke(app, ["import", "nothing.csv", "--out", str(tmp_path)])
    assert isinstance(result.exception, UserError)
    result = runner.invoke(app, ["download", "--url", "http://127.0.0.1:9/rows.csv", "--out", str(tmp_path)])
    assert isinstance(result.exception, UserError)


@pytest.mark.parametrize("module", ["pyarrow", "pandas", "numpy"])
def test_help_needs_no_heavy_module(module):
    code = f"import sys, merge_cosim.cli.ngsim; sys.exit({module!r} in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
