"""The cache: what is damaged in it is made again, whatever was damaged and how."""

import random
import shutil
from pathlib import Path

import pytest
from command import merge_cosim, small_scenario
from ngsim_files import car, write_csv

from merge_cosim.core.errors import UserError
from merge_cosim.core.files import from_cache, is_whole
from merge_cosim.ngsim.data import cached

SEED = 14


def damages(content: bytes, rng: random.Random) -> list[bytes]:
    """Cut short, empty, one bit turned, a stretch of zeros, of another kind."""
    at = rng.randrange(len(content))
    turned = bytes([content[at] ^ (1 << rng.randrange(8))])
    return [
        content[: at or 1][:-1],
        b"",
        content[:at] + turned + content[at + 1 :],
        content[:at] + bytes(len(content) - at) + b"\0",
        b'{"sites": ["us101"]}',
    ]


def test_damage_of_every_cached_file_is_mended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MERGE_COSIM_CACHE", str(tmp_path / "cache"))
    path, rng = write_csv(tmp_path / "a.csv", car(1, range(5))), random.Random(SEED)
    fresh = cached(path)
    files = [file for file in (tmp_path / "cache").rglob("*") if file.is_file() and file.suffix != ".lock"]
    assert {file.name.rpartition(".")[2] for file in files} == {"json", "parquet", "sha256"}
    for file in files:
        for damaged in damages(file.read_bytes(), rng):
            file.write_bytes(damaged)
            assert cached(path) == fresh, (file, damaged)
        file.unlink()
        assert cached(path) == fresh
    shutil.rmtree(next(file for file in files if file.name == "reading.json").parent)
    assert cached(path) == fresh


def test_a_sweep_with_a_damaged_tile_net(tmp_path: Path) -> None:
    scenario, cache = small_scenario(tmp_path), tmp_path / "cache"
    command = ("sweep", scenario, "--method", "acc", "--jobs", 1)
    assert merge_cosim(*command, "--out", "a", cwd=tmp_path, MERGE_COSIM_CACHE=str(cache)).returncode == 0
    nets = {net: net.read_bytes() for net in (cache / "tiles").glob("*.net.xml")}
    for net, whole in nets.items():
        net.write_bytes(whole[: len(whole) // 2])
    assert merge_cosim(*command, "--out", "b", cwd=tmp_path, MERGE_COSIM_CACHE=str(cache)).returncode == 0
    assert nets == {net: net.read_bytes() for net in nets}
    assert (tmp_path / "a" / "results.parquet").read_bytes() == (tmp_path / "b" / "results.parquet").read_bytes()


def test_what_fails_while_it_is_made_leaves_nothing(tmp_path: Path) -> None:
    def fail(file: Path) -> None:
        file.write_text("half")
        raise UserError("no")

    with pytest.raises(UserError):
        from_cache(tmp_path / "made", fail)
    assert not is_whole(tmp_path / "made")
    assert [file.name for file in tmp_path.iterdir()] in ([], ["made.lock"])
    assert from_cache(tmp_path / "made", lambda file: file.write_text("whole")).read_text() == "whole"
