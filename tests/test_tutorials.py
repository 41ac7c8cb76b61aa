"""The tutorials: every block of each page works, on fewer cases."""

import shutil
from pathlib import Path

import pandas as pd
import pytest
from pages import ROOT, follow

from merge_cosim.ngsim.sites import site
from merge_cosim.ngsim.surrogate.surrogate import surrogate_folder

FOLDER = ROOT / "docs" / "tutorials"
PAGES = sorted(page for page in FOLDER.glob("*.md") if page.stem != "README")
LESS = {
    "cluster": {"=2000": "=40", ": 2000": ": 40", "--dask local --jobs 2": "--jobs 1", "n_workers=2": "n_workers=1"},
    "ngsim": {"raw/us101-surrogate.parquet": "less.parquet"},
    "policy": {"ROUNDS, TRIES, CASES = 20, 16, 64": "ROUNDS, TRIES, CASES = 2, 4, 8"},
    "table": {" --verify 0.005": ""},  # the README's test verifies
    "start": {"make demo": "make --version"},  # the README's test runs it
}


@pytest.mark.slow
@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_every_block_works(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    shutil.copy(ROOT / "docs" / "files" / "rosenbach.osm", tmp_path)
    if page.stem == "ngsim":  # ten minutes of its 135
        (whole,) = surrogate_folder(site("us101")).iterdir()
        pd.read_parquet(whole, filters=[("Global_Time", "<", 600_000.0)]).to_parquet(tmp_path / "less.parquet")
    follow(page, tmp_path, LESS.get(page.stem))
    for folder in tmp_path.glob("out/*"):
        assert (folder / "results.parquet").is_file()


def test_every_tutorial_is_listed() -> None:
    listed = (FOLDER / "README.md").read_text(encoding="utf-8")
    assert [page.name for page in PAGES if f"({page.name})" not in listed] == []
