"""`Results`: rows, summary, conditions, comparisons, figures and the report of a sweep."""

import json

import pandas as pd
import pytest
from lxml import html
from matplotlib.figure import Figure

import merge_cosim as mc
from merge_cosim.report.notebook import tables_html
from merge_cosim.report.short_table import short_tables
from merge_cosim.report.text_table import as_text
from merge_cosim.results import merged_rows


def test_rows_and_what_was_run(results):
    assert len(results) == len(results.rows) == 2 * 3 * 4 * 4
    assert results.methods == ["acc", "pgm"]
    assert results.manifest["methods"] == ["acc", "pgm"]
    assert set(results.traces["method"]) == {"acc", "pgm"}


def test_it_shows_itself_as_a_table(results):
    failures = results.summary().set_index("method")["failures"]
    lines = repr(results).splitlines()
    assert lines[0] == "Results: 96 rows"
    assert max(map(len, lines)) <= 80
    rows = {line.split()[0]: line.split() for line in lines if line.startswith(("  acc ", "  pgm "))}
    assert {method: int(cells[1]) for method, cells in rows.items()} == failures.to_dict()


def test_a_notebook_gets_the_table_and_the_interactive_charts(results):
    bundle = results._repr_mimebundle_()
    assert bundle["text/plain"] == repr(results)
    tables = short_tables(results.path)
    assert repr(results).endswith(as_text(tables))
    assert bundle["text/html"].startswith(tables_html(tables))
    shown = html.fromstring(bundle["text/html"])
    assert [row.xpath("td")[0].text_content() for row in shown.xpath("//tbody/tr")] == ["acc", "pgm"]
    page = html.fromstring(shown.xpath("//iframe/@srcdoc")[0])
    data = json.loads(page.xpath("//script[@id='data']")[0].text)
    assert data["tests"]["t1"]["map"]["n"].keys() == {"acc", "pgm"}
    assert all(number < len(data["cases"]) for number in data["tests"]["t1"]["cases"])
    assert not page.xpath("//section[@id='provenance']")


def test_the_cases_for_which_a_condition_holds(results):
    rows = results.rows
    failed = results.cases("failed and method == 'pgm'")
    assert failed["case"].tolist() == rows["case"][rows["failed"] & (rows["method"] == "pgm")].tolist()
    assert len(failed)
    assert len(results.cases()) == len(rows)


def test_cases_that_fail_under_one_method_alone_batch_by_batch(results, monkeypatch):
    monkeypatch.setattr(merged_rows, "BATCH_ROWS", 10)
    monkeypatch.setattr(merged_rows, "STRETCH_ROWS", 10)
    failed = results.rows.pivot(index="case", columns="method", values="failed")
    alone = failed.index[failed["pgm"] & ~failed["acc"]].tolist()
    found = results.cases("delay_s > delay_s.min()", fails=["pgm"], passes=["acc"])
    assert found["case"].tolist() == alone
    pd.testing.assert_frame_equal(results.cases(), results.rows)


@pytest.mark.parametrize(
    ("where", "message"),
    [
        ("fialed", "no column 'fialed'; did you mean 'failed'"),
        ("failed and", "write one such as"),
        ("method", "this is no condition"),
        ("@failed", "no column 'failed'"),
    ],
)
def test_a_condition_that_cannot_be_read_is_refused(results, where, message):
    with pytest.raises(mc.UserError, match=message):
        results.cases(where)


def test_two_methods_on_the_same_cases(results, monkeypatch):
    rows = results.rows.pivot(index="case", columns="method")
    compared = results.compare("pgm", "acc").iloc[0]
    assert compared["n"] == len(rows)
    assert compared["only_a"] == (rows["failed", "pgm"] & ~rows["failed", "acc"]).sum()
    assert compared["only_b"] == (rows["failed", "acc"] & ~rows["failed", "pgm"]).sum()
    delays = (rows["delay_s", "pgm"] - rows["delay_s", "acc"]).mean()
    assert compared["delay_s_difference"] == pytest.approx(delays)
    assert results.compare("acc", "acc", other=results).iloc[0]["delay_s_difference"] == 0
    monkeypatch.setattr(merged_rows, "BATCH_ROWS", 5)  # the same from batches that end at other cases on each side
    monkeypatch.setattr(merged_rows, "STRETCH_ROWS", 7)
    own = {name: float(value) for name, value in results.manifest["settings"].items()}
    own["encounters.host_offset.step"] *= 2
    fewer = mc.sweep(["designed-2"], methods=["acc"], settings=own, world="closed-form", jobs=1)
    assert fewer.compare("acc", "pgm", other=results).iloc[0]["n"] == len(fewer) < len(rows)
    pd.testing.assert_series_equal(results.compare("pgm", "acc").iloc[0], compared)
    with pytest.raises(mc.UserError, match="no method 'pmg' in these results; did you mean 'pgm'"):
        results.compare("pmg", "acc")


def test_a_sample_gets_a_p_value():
    states = pd.DataFrame({"host_station": [-90.0, -85.0], "host_speed": 20.0, "merging_station": -90.0})
    sample = mc.Encounters.from_frame(states.assign(merging_speed=[20.0, 18.0]), sample=True)
    compared = mc.sweep([sample], ["always-go", "always-yield"], jobs=1).compare("always-go", "always-yield")
    assert 0 < compared["p"].iloc[0] <= 1


def test_figures(results):
    axes = results.plot.failure_map(methods=["pgm"]).axes
    assert [ax.get_title() for ax in axes if ax.get_title()] == ["pgm"]
    assert isinstance(results.plot.delay("designed-2"), Figure)
    assert len(results.plot.case("speed").axes) == 1
    for wrong in ({"scenario": "designed-3"}, {"methods": ["pmg"]}):
        with pytest.raises(mc.UserError, match="in these results"):
            results.plot.failure_map(**wrong)
    with pytest.raises(mc.UserError, match=r"'acc\.headway' was not varied"):
        results.plot.variation("acc.headway")


def test_a_report_goes_where_it_is_asked_for(results, tmp_path):
    page = results.report(tmp_path / "new" / "out.html", against="acc")
    assert page == tmp_path / "new" / "out.html"
    assert "designed-2" in page.read_text(encoding="utf-8")


def test_a_folder_is_read_again(results, tmp_path):
    again = mc.load_results(results.path)
    assert again.rows.equals(results.rows)
    assert str(results.path) in repr(again)
    with pytest.raises(mc.UserError, match="no results here"):
        mc.load_results(tmp_path)
