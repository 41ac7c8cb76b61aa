"""The page of a real sweep."""

import json
import re

import pandas as pd
import pytest
from lxml import html

from merge_cosim.report.page import write_report


@pytest.fixture(scope="module")
def page(swept):
    return (swept / "report.html").read_text(encoding="utf-8")


def test_the_table_has_the_numbers_of_the_summary(swept, page):
    table = html.fromstring(page).xpath("//section[@id='s1']//table")[0]
    shown = {row.xpath("th")[0].text: [cell.text for cell in row.xpath("td")] for row in table.xpath("tbody/tr")}
    summary = [row for row in json.loads((swept / "summary.json").read_text()) if not row["variation"]]
    assert list(shown) == ["acc", "slot", "pgm-time", "always-go"]  # the papers' methods first, then references
    for row in summary:
        n, count, percent = shown[row["method"]][:3]
        assert (int(n), int(count), percent) == (27, row["failures"], f"{row['failure_pct']:.2f}")
        assert f"{row['distance_m']:.1f}" in shown[row["method"]]
    assert any(row["failures"] for row in summary)


def test_the_papers_figures_stand_beside_ours(page):
    row = html.fromstring(page).xpath("//section[@id='s1']//table[1]/tbody/tr[th='acc']")[0]
    assert "6.8" in [cell.text for cell in row.xpath("td")]
    assert "Published, but not run here: ipcb 1.2 %, pgm-g 1.8 %, pgm 0.2 %." in page


def test_it_needs_no_network(page):
    assert not re.findall(r"(?:src|href)\s*=\s*[\"']?\s*(?:https?:)?//", page)
    assert "@import" not in page
    assert "<script" not in page
    assert all(link.startswith(("data:", "#")) for link in re.findall(r'(?:src|href)="([^"]*)', page))
    assert len(page) < 3_000_000


def test_it_names_source_seed_and_what_was_varied(page):
    text = " ".join(html.fromstring(page).text_content().split())
    assert "A coarse grid designed initial states, no data" in text
    assert "27 designed-2 (designed)" in text
    assert "merging.ahead = clear, any; test.horizon = 1, 3" in text


def test_no_interval_for_a_grid(page):
    assert "interval" not in html.fromstring(page).xpath("//table")[0].text_content()


def test_tables_are_files_too(swept):
    files = {file.name for file in (swept / "tables").iterdir()}
    stem = "designed-2-designed-designed-outcome"
    assert {f"{stem}.csv", f"{stem}.tex", "collisions.csv", "vary-designed-2-merging.ahead.csv"} <= files
    assert pd.read_csv(swept / "tables" / f"{stem}.csv")["n"].tolist() == [27] * 4
    assert r"\toprule" in (swept / "tables" / f"{stem}.tex").read_text()


def test_the_same_results_give_the_same_page(swept, page):
    assert write_report(swept).read_text(encoding="utf-8") == page


def test_a_folder_without_results_is_one_line_and_status_2(command, tmp_path, capsys):
    assert command("report", tmp_path) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert len(printed.err.strip().splitlines()) == 1
    assert "results.parquet" in printed.err


def test_a_folder_without_traces_is_the_users_mistake(command, swept, tmp_path, capsys):
    for name in ("results.parquet", "summary.json", "manifest.json"):
        (tmp_path / name).write_bytes((swept / name).read_bytes())
    assert command("report", tmp_path) == 2
    assert "traces.parquet: missing" in capsys.readouterr().err


def test_real_data_are_called_real(command, data_dir, tmp_path):
    out = tmp_path / "out"
    words = ("--source", "ngsim", "--data", data_dir, "--method", "acc", "--method", "oracle-label", "--jobs", 1)
    assert command("sweep", "us101-replay", *words, "--out", out) == 0
    assert command("report", out) == 0
    page = html.fromstring((out / "report.html").read_text(encoding="utf-8"))
    assert "real NGSIM data" in page.xpath("//h2")[0].text_content()
    assert "95 % interval" in page.xpath("//table")[0].text_content()
    [shown] = page.xpath("//section[@id='s1']//table")[0].xpath(".//tr[th='acc']/td[1]")
    summary = json.loads((out / "summary.json").read_text())
    assert int(shown.text) == next(row["n"] for row in summary if row["method"] == "acc")
