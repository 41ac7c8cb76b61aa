import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from merge_cosim.cli.ramp import app
from merge_cosim.core.errors import UserError
from merge_cosim.ramps.ramp import Ramp

RUN = CliRunner()


def test_list_shows_every_ramp() -> None:
    assert "us101" in RUN.invoke(app, ["list"]).stdout
    rows = json.loads(RUN.invoke(app, ["list", "--json"]).stdout)
    assert [row["name"] for row in rows] == ["designed", "i80", "us101"]
    assert rows[0]["auxiliary_end_m"] is None
    assert rows[2]["auxiliary_end_m"] == 213.0


def test_check_tells_by_its_status(tmp_path: Path) -> None:
    assert RUN.invoke(app, ["check", "designed"]).exit_code == 0
    result = RUN.invoke(app, ["check", str(tmp_path), "--json"])
    assert result.exit_code == 1
    assert "ramp.toml: cannot be read" in json.loads(result.stdout)["problems"][0]


def test_new_ramp_can_be_used_at_once(tmp_path: Path) -> None:
    words = ["new", "mine", "--out", str(tmp_path), "--upstream", "450", "--downstream", "1600", "--speed-limit", "25"]
    result = RUN.invoke(app, words)
    assert result.exit_code == 0, result.output
    ramp = Ramp.load(tmp_path / "mine")
    assert (ramp.name, ramp.upstream, ramp.downstream, ramp.speed_limit) == ("mine", 450.0, 1600.0, 25.0)
    assert RUN.invoke(app, ["check", str(tmp_path / "mine")]).exit_code == 0
    assert RUN.invoke(app, ["build", str(tmp_path / "mine")]).exit_code == 0
    assert isinstance(RUN.invoke(app, words).exception, UserError), "an existing folder is never written over"


def test_a_name_is_no_path_and_out_has_a_default(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("../evil", "..", str(tmp_path / "evil"), "a/b"):
        result = RUN.invoke(app, ["new", name])
        assert isinstance(result.exception, UserError)
        assert "is no name for a ramp" in str(result.exception)
    assert list(tmp_path.iterdir()) == []
    assert RUN.invoke(app, ["new", "mine"]).exit_code == 0
    assert (tmp_path / "ramps" / "mine" / "ramp.png").read_bytes().startswith(b"\x89PNG")


def test_edit_says_that_there_is_no_display(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    result = RUN.invoke(app, ["edit", "us101"])
    assert isinstance(result.exception, UserError)
    assert "no display" in str(result.exception)
    assert "netedit" in result.stdout
    assert "us101.netccfg" in result.stdout
