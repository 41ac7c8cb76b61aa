"""Every tool that makes a page of the docs runs in its short mode and writes a whole page, with its pictures."""

import json
import re
from pathlib import Path

import blocks
import driver_fit
import geometry_page
import headroom_page
import kept_aside_page
import method_pages
import method_proof
import model_flips
import models_page
import pandas as pd
import pytest
import ranking_page
import robustness_page
import robustness_runs_page
import scenes_page
import sensitivity_page
import surrogate_page
import traffic_page
from PIL import Image

from merge_cosim.report import figures

DOCS = Path(__file__).parents[2] / "docs"
ELSEWHERE = ("img/full-scene.png", "img/headroom-", "img/geometry-us101.png", "img/surrogate-i80.png")
"""A screenshot, pictures of another tool, and pictures of sites that the short mode leaves out."""


def headings(page: Path) -> list[str]:
    return re.findall(r"^#+ .*$", page.read_text(encoding="utf-8"), flags=re.MULTILINE)


def made_like(docs: Path, name: str) -> str:
    """The page that a tool has made, which has no heading that the committed one has not, and no empty table."""
    assert set(headings(docs / name)) <= set(headings(DOCS / name))
    text = (docs / name).read_text(encoding="utf-8")
    assert "| nan" not in text
    for link in re.findall(r"!\[[^]]*\]\(([^)]+)\)", text):
        target = docs / Path(name).parent / link
        assert target.is_file() or link.startswith(ELSEWHERE)
    return text


def test_an_edit_made_while_blocks_are_filled_stays(tmp_path, monkeypatch):
    monkeypatch.setattr(blocks, "DOCS", tmp_path)
    page = tmp_path / "page.md"
    page.write_text(
        "before\n<!-- sum: a -->\nold\n<!-- end -->\n<!-- other: b -->\nkept\n<!-- end -->\n", encoding="utf-8"
    )

    def made(argument: str) -> str:
        page.write_text(page.read_text(encoding="utf-8").replace("before", "after"), encoding="utf-8")
        return f"{argument} new\n"

    blocks.fill_page("page.md", tmp_path, {"sum": made})
    expected = "after\n<!-- sum: a -->\na new\n<!-- end -->\n<!-- other: b -->\nkept\n<!-- end -->\n"
    assert page.read_text(encoding="utf-8") == expected


def test_sensitivity(tmp_path):
    sensitivity_page.main(["--short", "--docs", str(tmp_path)])
    text = made_like(tmp_path, "sensitivity.md")
    assert "**designed-2** (n = 48)" in text
    assert "| **clear** |" in text


@pytest.mark.slow
def test_ranking(tmp_path):
    ranking_page.main(["--short", "--docs", str(tmp_path)])
    text = made_like(tmp_path, "ranking.md")
    assert "8 settings were tried" in text
    assert "| slot-time |" in text


@pytest.mark.slow
def test_robustness(tmp_path, monkeypatch):
    for name in ("SENSING", "SHIFTED"):
        words = ["acc,pgm" if word.startswith("acc,") else word for word in getattr(robustness_page, name)]
        monkeypatch.setattr(robustness_page, name, words)
    robustness_page.main(["--short", "--docs", str(tmp_path)])
    assert made_like(tmp_path, "sensors.md").count("| `sensing.") == 13
    assert made_like(tmp_path, "tests.md").count("%, ") >= 2 * 10


def test_what_another_model_changes():
    rates = {"acc": {"": (3.0, 4.0)}, "pgm": {"m0": (2.0, 5.0), "m1": (3.5, 3.0)}}
    section = {"scenario": "designed-3", "site": "", "source": ""}
    rows = [
        section | {"method": method, "model": model, "variation": error, "failed_or_stuck_pct": rate}
        for method, models in rates.items()
        for model, both in models.items()
        for error, rate in zip(("", "sensing.delay=1"), both, strict=True)
    ]
    text = " ".join(model_flips.paragraph(model_flips.what_flips(pd.DataFrame(rows), "variation", "")).split())
    assert "not the same: acc before pgm under 1 of them in 2 of 2 rows. No other order" in text
    assert "Whether pgm does worse than with no error depends on it for `sensing.delay=1` (1) (models" in text


def test_robustness_runs(tmp_path):
    ends = {"same": 2, "wrong": 1}
    part = {"mutants": 90, "run": 4, "killed": 3, "survived": ["merge_cosim/a.py:3: not b"]}
    targets = {"net": {"right": 4, "refused": 3}}
    files = {
        "fuzz": {"inputs": 7, "seed": 5, "targets": targets},
        "next": {"inputs": 7, "first": 7, "seed": 5, "targets": targets},
        "corpus": {"ramps": 5, "right": 3, "refused": 1, "wrong": {"loop": "wrong: no lane"}},
        "faults": {"faults": 3, "seed": 5, **ends, "kinds": {"kill": ends}},
        "mutation": {"seed": 5, "run": 4, "killed": 3, "interval_pct": [30.1, 95.4], "parts": {"loop": part}},
        "more": {"seed": 5, "run": 4, "killed": 4, "parts": {"scoring": part | {"killed": 4, "survived": []}}},
    }
    words = ["--docs", str(tmp_path)]
    for name, found in files.items():
        (tmp_path / name).write_text(json.dumps(found))
        words += [str(tmp_path / name)] if name in ("next", "more") else [f"--{name}", str(tmp_path / name)]
    robustness_runs_page.main(words)
    text = made_like(tmp_path, "robustness.md")
    assert "python tools/fuzz.py --seed 5 --first 0 --inputs 14\n" in text  # parts in a row are one
    assert "| net | 8 | 6 | 0 |" in text
    assert "5 ramps: 3 right, 1 refused with the right reason, 1 wrong:\n\n- loop: wrong: no lane\n" in text
    assert "| `kill` | 2 | 1 |" in text
    assert "python tools/mutation.py --sample 4 --seed 5 --only loop,scoring\n" in text
    assert "| 5 | 4 of 4 |  |  | 3 of 4 | 7 of 8 | 87.5 | 52.9 to 97.8 |" in text
    assert "- `a.py:3: not b`" in text


def test_headroom(tmp_path):
    headroom_page.main(["--short", "--docs", str(tmp_path)])
    assert "40 cases. The clairvoyant host fails in 0 and" in made_like(tmp_path, "tests.md")


def test_method_proof(tmp_path):
    method_proof.main(["--short", "--docs", str(tmp_path), "--only", "designed", "choice", "--again", "interactive"])
    text = made_like(tmp_path, "methods/interactive.md")
    assert re.search(r"^\| designed-2 \| interactive \| 18 \|", text, flags=re.MULTILINE)
    assert re.search(r"^\| designed-2 \| ipcb \| 6875 \|", text, flags=re.MULTILINE)  # a row that stays
    assert text.count("driven: **") >= 3


def test_driver_fit(tmp_path):
    driver_fit.main(["--short", "--docs", str(tmp_path)])
    text = made_like(tmp_path, "methods/interactive.md")
    assert "training, US-101 (surrogate): " in text
    losses = re.search(
        r"^\| log lik.*?^\| shipped \| (\S+).*?^\| fitted \| (\S+)", text, flags=re.MULTILINE | re.DOTALL
    )
    assert losses is not None
    assert float(losses[2]) > float(losses[1])
    assert re.search(r"^\| designed-3 \(random\) \| fitted \| 20 \|", text, flags=re.MULTILINE)


@pytest.mark.slow
def test_traffic(tmp_path):
    traffic_page.main(["--short", "--docs", str(tmp_path)])
    text = made_like(tmp_path, "traffic.md")
    assert "6 scenes." in text
    assert len(re.findall(r"^\| slot \|", text, flags=re.MULTILINE)) >= 4


def test_methods(tmp_path):
    method_pages.main(["--short", "--docs", str(tmp_path)])
    for page in (DOCS / "methods").glob("*.md"):
        assert made_like(tmp_path, f"methods/{page.name}") == page.read_text(encoding="utf-8")


@pytest.mark.slow
def test_gallery(tmp_path, monkeypatch):
    pytest.importorskip("playwright.sync_api")
    import gallery_page

    if gallery_page.CHROMIUM is None:
        pytest.skip("Chromium is not installed")
    monkeypatch.setattr(figures, "FORMATS", ("png",))  # the gallery's pictures
    monkeypatch.setattr(figures, "DPI", 100)
    gallery_page.main(["--short", "--docs", str(tmp_path)])
    text = (DOCS / "gallery.md").read_text(encoding="utf-8")
    made = {str(file.relative_to(tmp_path)) for file in tmp_path.rglob("*.png")}
    assert made == {picture["target"] for picture in gallery_page.PICTURE.finditer(text)}
    assert {Image.open(tmp_path / name).size[0] > 300 for name in made} == {True}


def test_kept_aside(tmp_path, data_dir):
    kept_aside_page.main(["--short", "--docs", str(tmp_path), "--data", str(data_dir)])
    text = made_like(tmp_path, "results.md")
    assert "so 3 predictions per method" in text
    for cars, high in ((8, 100.0), (40, 0.0)):  # one more car fails with probability 0.5 / (cars + 1)
        none = pd.DataFrame({"car": range(cars), "failed": False})
        assert kept_aside_page.rate_interval(none, 1) == (0.0, high)


def test_models(tmp_path, data_dir):
    models_page.main(["--short", "--docs", str(tmp_path), "--data", str(data_dir)])
    text = made_like(tmp_path, "models.md")
    table = re.search(r"## us101-ngsim\n.*?\n((?:\|[^\n]*\n)+)", text, flags=re.DOTALL)
    assert table is not None
    assert table[1] in (DOCS / "models.md").read_text(encoding="utf-8")


def test_geometry(tmp_path, data_dir):
    geometry_page.main(["--short", "--docs", str(tmp_path), "--data", str(data_dir)])
    text = made_like(tmp_path, "geometry.md")
    tables = re.findall(r"^\|.*$", text, flags=re.MULTILINE)
    assert set(tables) <= set((DOCS / "geometry.md").read_text(encoding="utf-8").splitlines())


def test_surrogate(tmp_path, data_dir):
    surrogate_page.main(["--short", "--docs", str(tmp_path), "--data", str(data_dir)])
    text = made_like(tmp_path, "surrogate.md")
    assert "4 minutes of traffic per site, in 1 recordings" in text
    assert len(re.findall(r"^\| real \|", text, flags=re.MULTILINE)) == 2  # the pairs, and how well the order is found


@pytest.mark.slow
def test_scenes(tmp_path, data_dir):
    out = tmp_path / "out"
    scenes_page.main(["--short", "--docs", str(tmp_path), "--data", str(data_dir), "--out", str(out), "--jobs", "1"])
    text = made_like(tmp_path, "scenes.md")
    assert re.search(r"^\| acc \| \d+ of \d+ \|", text, flags=re.MULTILINE)
