"""The figures and tables that `report --figures` writes, and the marks of the best values."""

import math
import shutil
import subprocess

import pandas as pd
import pytest
from matplotlib.transforms import Bbox

from merge_cosim.report import canvas
from merge_cosim.report.columns import Column, Table
from merge_cosim.report.export import write_tables
from merge_cosim.report.figures import FORMATS
from merge_cosim.report.latex import latex
from merge_cosim.report.methods import broken, looks
from merge_cosim.report.outcome_figures import lines_figure, tradeoff_figure
from merge_cosim.report.page import read_report
from merge_cosim.results.store import ResultFolder


@pytest.fixture(scope="module")
def figures(swept, command, tmp_path_factory):
    out = tmp_path_factory.mktemp("figures")
    words = ("--figures", out, "--width", 8.4, "--font-size", 7, "--columns", "n,failure_pct,delay_s")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("merge_cosim.report.figures.DPI", 100)
        assert command("report", swept, *words) == 0
    return out


def test_every_figure_has_its_formats_and_its_data(figures):
    stems = {file.stem for file in figures.glob("*.csv")}
    own = "designed-2-designed-designed"
    assert {f"{own}-tradeoff", f"{own}-failure-map", "designed-2-vary-test.horizon"} <= stems
    for kind in FORMATS:
        assert {file.stem for file in figures.glob(f"*.{kind}")} == stems


def test_the_data_are_what_was_run(figures, swept):
    rows = ResultFolder(swept).results().to_pandas()
    rows = rows[rows["variation"] == ""]
    cells = pd.read_csv(figures / "designed-2-designed-designed-failure-map.csv")
    assert cells.groupby("method")["failed"].sum().to_dict() == rows.groupby("method")["failed"].sum().to_dict()
    assert cells.groupby("method")["n"].sum().unique().tolist() == [27]


def test_figures_have_the_width_that_was_asked_for(figures):
    svg = (figures / "designed-2-designed-designed-failure-map.svg").read_text()
    assert f'width="{72 * 8.4 / 2.54:.6f}'[:12] in svg


def test_tables_have_a_label_the_chosen_columns_and_the_best_in_bold(figures, swept):
    text = (figures / "tables" / "designed-2-designed-designed-outcome.tex").read_text()
    assert r"\label{tab:designed-2-designed-designed-outcome}" in text
    assert r"method & n & \% & delay s \\" in text
    summary = pd.read_csv(swept / "summary.csv").query("variation.isna() and method != 'always-go'")
    assert f"\\textbf{{{summary['failure_pct'].min():.2f}}}" in text
    always_go = next(line for line in text.splitlines() if line.startswith("always-go"))
    assert "textbf" not in always_go  # a reference does not compete, though it is the fastest


def test_an_unknown_column_is_one_line_and_status_2(command, swept, tmp_path, capsys):
    assert command("report", swept, "--figures", tmp_path, "--columns", "failures_pct") == 2
    assert "no column 'failures_pct'" in capsys.readouterr().err


def test_text_means_nothing_to_latex():
    data = pd.DataFrame({"method": ["a_b & 5 %"], "x": [1.0]})
    text = latex(Table.of(data, [Column("method", "method"), Column("x", "x < 2", 1)], "T_1"), "tab:x")
    assert r"a\_b \& 5 \% & 1.0" in text
    assert "x $<$ 2" in text


def test_ties_are_all_best_and_columns_without_a_direction_have_none():
    data = pd.DataFrame(
        {"method": ["a", "b", "always-go"], "less": [1.04, 1.0, 0.0], "more": [1, 2, 3], "x": [1, 2, 3]}
    )
    columns = [Column("method", "m"), Column("less", "l", 1, better=-1), Column("more", "m", 0, better=1)]
    table = Table.of(data, [*columns, Column("x", "x", 0)], "t")
    assert table.best() == [[False, False, False, False], [False, False, True, False], [False] * 4]


def _row(method, delay, bad, reference=False):
    intervals = dict.fromkeys(("bad_low", "bad_high", "delay_low", "delay_high"))
    return {"method": method, "delay": delay, "bad_pct": bad, "reference": reference, "best": bad == 0.0, **intervals}


def test_dots_stand_at_their_values_and_far_references_at_the_edge():
    rows = [_row("acc", 1.0, 3.0), _row("pgm", 2.0, 0.0), _row("always-brake", 43.0, 100.0, reference=True)]
    axes = tradeoff_figure(rows, looks(row["method"] for row in rows)).axes[0]
    dots = {(line.get_xdata()[0], line.get_ydata()[0]) for line in axes.lines if line.get_marker() in "oD>"}
    assert {(1.0, 3.0), (2.0, 0.0), (axes.get_xlim()[1], axes.get_ylim()[1])} == dots
    assert {text.get_text() for text in axes.texts} == {"acc", "pgm", "always-brake (43.0 s, 100 %)"}


def test_names_of_near_dots_do_not_cover_each_other():
    rows = [_row(f"method-{i}", 1.0 + 0.01 * i, 2.0 + 0.01 * i) for i in range(8)]
    figure = tradeoff_figure(rows, looks(row["method"] for row in rows))
    boxes = [text.get_window_extent() for text in figure.axes[0].texts]
    common = [Bbox.intersection(a, b) for i, a in enumerate(boxes) for b in boxes[:i]]
    assert len(common) == 28
    assert [box for box in common if box is not None and min(box.width, box.height) > 1] == []


def test_lines_have_signs_and_a_legend_makes_the_figure_higher():
    series = [{"name": f"m{i}", "x": [0, 50, 100], "y": [i, 50, 90]} for i in range(12)]
    drawn = looks(one["name"] for one in series)
    few, many = (lines_figure(part, drawn, ("a", "b"), diagonal=True) for part in (series[:2], series))
    assert many.get_figheight() > few.get_figheight()
    assert len({line.get_marker() for line in few.axes[0].lines[:2]}) == 2


def test_long_names_are_parted_and_small_panels_follow_the_width():
    assert broken("acc") == "acc"
    parts = ["my-own-", "estimator-with-", "a-long-name"]
    assert broken("".join(parts)) == "\n".join(parts)
    with canvas.made_for(canvas.Paper(width=3.3)):
        figure, axes = canvas.grid_of(7, 4, (1.8, 1.9))
    assert figure.get_figwidth() == pytest.approx(3.3)
    assert len(axes) == 7
    assert not math.isclose(canvas.grid_of(7, 4, (1.8, 1.9))[0].get_figwidth(), 3.3)


def test_no_point_of_a_variation_is_clipped(swept):
    from merge_cosim.report.page import read_report
    from merge_cosim.report.set_figures import variation_figure

    report = read_report(swept)
    figure = variation_figure(report.summary, "test.horizon", looks(report.results["method"]))
    highest = max(max(line.get_ydata()) for line in figure.axes[0].lines)
    assert highest < 0.95 * figure.axes[0].get_ylim()[1]


@pytest.mark.skipif(shutil.which("pdflatex") is None, reason="LaTeX is not installed")
def test_latex_sets_every_table_within_the_line(swept, tmp_path):
    files = sorted(file for file in write_tables(tmp_path, read_report(swept).tables) if file.suffix == ".tex")
    page = [r"\documentclass{article}\usepackage{booktabs}\begin{document}"]
    (tmp_path / "page.tex").write_text("\n".join([*page, *(rf"\input{{{file}}}" for file in files), r"\end{document}"]))
    done = subprocess.run(
        ["pdflatex", "-interaction=nonstopmode", "page.tex"], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert len(files) > 3
    assert "Overfull" not in done.stdout
