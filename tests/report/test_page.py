"""The page of a real sweep."""

import json
import re

import numpy as np
import pandas as pd
import pytest
from lxml import html

from merge_cosim.report.page import write_report
from merge_cosim.report.trace_data import QUANTITIES
from merge_cosim.results.statistics.verdict import verdicts
from merge_cosim.results.store import ResultFolder


def _summary(folder):
    return [row for row in json.loads((folder / "summary.json").read_text()) if not row["variation"]]


@pytest.fixture(scope="module")
def page(swept):
    return (swept / "report.html").read_text(encoding="utf-8")


def test_the_verdict_stands_first_and_is_that_of_the_statistics(swept, page):
    document = html.fromstring(page)
    section = document.xpath("//main/section[@class='test']")[0]
    assert [child.tag for child in section][:2] == ["h2", "p"]
    rows = ResultFolder(swept).results().to_pandas()
    summary = pd.DataFrame(json.loads((swept / "summary.json").read_text()))
    [said] = verdicts(summary, rows).values()
    assert document.xpath("//p[@class='verdict']/text()") == [said.sentence.replace(" %", "\u00a0%")]
    assert " of 27 cases" in said.sentence


def test_the_short_table_has_the_numbers_of_the_summary_the_best_first(swept, page):
    table = html.fromstring(page).xpath("//section[@id='t1']//table[contains(@class, 'short')]")[0]
    shown = {
        row.get("data-method"): [cell.text_content() for cell in row.xpath("td")] for row in table.xpath("tbody/tr")
    }
    summary = {row["method"]: row for row in _summary(swept)}
    rivals = sorted(
        set(summary) - {"always-go"}, key=lambda m: (summary[m]["failed_or_stuck_pct"], summary[m]["delay_s"])
    )
    assert list(shown) == [*rivals, "always-go"]
    for method, (n, failed, stuck, delay, distance) in shown.items():
        row = summary[method]
        assert (int(n), int(stuck)) == (row["n"], row["stuck"])
        assert failed == f"{row['failures']} ({row['failure_pct']:.1f} %)"
        assert delay.removeprefix("≥ ").replace("−", "-") == f"{row['delay_s']:.2f}"
        assert distance == f"{row['distance_m']:.1f}"
    best = table.xpath("tbody/tr[contains(@class, 'best')]/@data-method")
    least = min(summary[method]["failed_or_stuck_pct"] for method in rivals)
    assert best == [method for method in rivals if summary[method]["failed_or_stuck_pct"] == least]


def test_all_columns_unfold(swept, page):
    table = html.fromstring(page).xpath("//section[@id='t1']//details//table")[0]
    shown = {row.xpath("th")[0].text: [cell.text for cell in row.xpath("td")] for row in table.xpath("tbody/tr")}
    assert list(shown) == ["acc", "slot", "pgm-time", "always-go"]  # the papers' methods first, then references
    for row in _summary(swept):
        n, count, percent = shown[row["method"]][:3]
        assert (int(n), int(count), percent) == (27, row["failures"], f"{row['failure_pct']:.2f}")


def test_the_papers_figures_stand_beside_ours(page):
    row = html.fromstring(page).xpath("//section[@id='t1']//details//table[1]/tbody/tr[th='acc']")[0]
    assert "6.8" in [cell.text for cell in row.xpath("td")]
    assert "Published, but not run here: ipcb 1.2 %, pgm-g 1.8 %, pgm 0.2 %." in page


def test_what_the_scripts_draw_is_what_was_run(swept, page):
    data = json.loads(html.fromstring(page).xpath("//script[@id='data']")[0].text)
    test = data["tests"]["t1"]
    assert set(data["methods"]) == {"acc", "slot", "pgm-time", "always-go"}
    assert [name for name, one in data["methods"].items() if one["reference"]] == ["always-go"]
    summary = {row["method"]: row for row in _summary(swept)}
    for method, failed in test["map"]["failed"].items():
        assert (sum(failed), sum(test["map"]["n"][method])) == (summary[method]["failures"], 27)
    [case] = data["cases"]  # 27 cases: one is recorded
    assert test["cases"] == [0]
    traces = ResultFolder(swept).traces.read().to_pandas()
    for run in case["runs"]:
        trace = traces[traces["method"] == run["method"]]
        for name, (column, digits) in QUANTITIES.items():
            if column != "belief":
                drawn = np.cumsum(run["series"][name]) / 10**digits
                np.testing.assert_allclose(drawn, trace[column], atol=0.51 * 10**-digits)


def test_every_id_is_unique_and_every_link_has_its_target(page):
    document = html.fromstring(page)
    ids = document.xpath("//@id")
    assert len(ids) == len(set(ids))
    assert {link.removeprefix("#") for link in document.xpath("//a/@href")} <= set(ids)
    labelled = document.xpath("//button[not(normalize-space(.)) and not(@aria-label)]")
    assert labelled == []


def test_it_needs_no_network(page):
    assert not re.findall(r"(?:src|href)\s*=\s*[\"']?\s*(?:https?:)?//", page)
    assert "@import" not in page
    assert not re.findall(r"<script[^>]+src|fetch\(|XMLHttpRequest|import\(", page)
    assert all(link.startswith("#") for link in re.findall(r'(?:src|href)="([^"]*)', page))
    assert len(page) < 3_000_000


def test_it_names_source_seed_and_what_was_varied(page):
    text = " ".join(html.fromstring(page).text_content().split())
    assert "A coarse grid designed initial states, no data" in text
    assert "27 designed-2 (designed)" in text
    assert "merging.ahead = clear, any; test.horizon = 1, 3" in text


def test_no_interval_for_a_grid(page):
    document = html.fromstring(page)
    assert not document.xpath("//span[@class='range']")
    assert "interval" not in document.xpath("//section[@id='t1']//details//table")[0].text_content()


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
    [interval] = page.xpath("//tr[@data-method='acc']//span[@class='range']/text()")
    [shown] = page.xpath("//tr[@data-method='acc']/td[1]")
    acc = next(row for row in json.loads((out / "summary.json").read_text()) if row["method"] == "acc")
    assert int(shown.text) == acc["n"]
    assert interval == f"{acc['ci_low_pct']:.1f}–{acc['ci_high_pct']:.1f} %"
