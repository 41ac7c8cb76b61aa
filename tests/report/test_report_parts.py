"""Parts of a report on a real sweep: comparison, further tables, files, panels."""

import numpy as np
import pandas as pd
import pytest

from merge_cosim.core.errors import UserError
from merge_cosim.report import canvas
from merge_cosim.report.columns import Column, Table
from merge_cosim.report.comparison import compare
from merge_cosim.report.export import write_tables
from merge_cosim.report.measure_tables import belief_table, safety_table
from merge_cosim.report.tables import sections
from merge_cosim.report.traffic_table import traffic_table
from merge_cosim.results.statistics.summary import by_start
from merge_cosim.results.store import ResultFolder


def test_a_sweep_compared_with_itself_differs_nowhere(swept):
    table, differences = compare(swept, swept)
    assert differences == []
    data = table.data
    assert (data["failure_pct_a"] == data["failure_pct_b"]).all()
    assert (data[["only_a", "only_b"]] == 0).all(axis=None)
    assert data["n"].max() == 27
    with pytest.raises(UserError, match="no results here"):
        compare(swept, swept / "tables")


def test_safety_of_every_method_and_no_beliefs_without_a_label(swept):
    results = ResultFolder(swept).results().to_pandas()
    summary = pd.read_csv(swept / "summary.csv", keep_default_na=False, na_values=[""])
    summary["variation"] = summary["variation"].fillna("")
    section = next(iter(sections(summary)))
    table = safety_table(summary, section)
    own = section.of(results)
    jerk = own.groupby("method")["mean_jerk"].mean()
    assert table.data.set_index("method")["mean_jerk"].to_dict() == pytest.approx(jerk.to_dict(), abs=1e-6)
    assert belief_table(results, section) is None


def test_strata_part_the_cases_by_their_ambiguity(swept):
    results = ResultFolder(swept).results().to_pandas()
    parts = dict(by_start(results))
    assert list(parts) == ["[0, 1) s", "[1, 3) s", ">= 3 s"]
    assert sum(map(len, parts.values())) == len(results)
    assert parts["[1, 3) s"]["ambiguity_s"].between(1.0, 3.0, inclusive="left").all()


def test_tables_become_files_of_two_kinds(tmp_path):
    data = pd.DataFrame({"method": ["acc"], "p": [0.25]})
    table = Table.of(data, [Column("method", "method"), Column("p", "p", 2)], "One & only")
    files = write_tables(tmp_path, {"a/b c": table})
    assert [file.name for file in files] == ["a-b-c.csv", "a-b-c.tex"]
    pd.testing.assert_frame_equal(pd.read_csv(files[0]), data)
    assert "acc & 0.25" in files[1].read_text()


def test_the_table_of_scenes_has_methods_in_order_and_numbers():
    rows = [{"scenario": "s", "variation": "", "method": name, "scenes": "2", "hosts": "5"} for name in ("pgm", "acc")]
    table = traffic_table(rows)
    assert table is not None
    assert table.data["method"].tolist() == ["acc", "pgm"]
    assert table.data["hosts"].tolist() == [5, 5]
    assert traffic_table([]) is None


def test_small_multiples_are_as_many_as_wanted():
    figure, axes = canvas.grid_of(5, 3, (2.0, 1.5))
    assert len(axes) == len(figure.axes) == 5
    assert figure.get_size_inches() == pytest.approx([6.0, 3.0])
    with canvas.style():
        _, alone = canvas.panel()
        assert not alone.spines["top"].get_visible()
    assert np.isclose(alone.figure.get_size_inches()[0], canvas.WIDTH)
