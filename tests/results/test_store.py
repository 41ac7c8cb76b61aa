"""The parts of a sweep, joined a stretch at a time: what a stretch is must not show."""

from itertools import pairwise

import pandas as pd
import pyarrow as pa
import pytest
from test_summaries import frame

from merge_cosim.results import merged_rows, parts
from merge_cosim.results.schema import KEY, SCHEMA
from merge_cosim.results.store import RESULTS, ResultFolder

PIECES = {"acc": (4, 9, 13), "pgm": (7, 8)}
"""Where the cases of a method are cut; the first and the last one are ends."""


def pieces():
    """Parts by name: 15 cases under two methods, of two scenarios, cut at different places."""
    for scenario in ("s", "t"):
        for method, cuts in PIECES.items():
            ends = (0, *cuts, 15)
            for number, (first, last) in enumerate(pairwise(ends)):
                rows = [{"scenario": scenario, "case": f"c{i:02d}", "method": method} for i in range(first, last)]
                table = pa.Table.from_pandas(frame(*rows), schema=SCHEMA, preserve_index=False)
                yield f"{scenario}{method}-{number}", table


@pytest.mark.parametrize(("rows_at_a_time", "part", "files"), [(1, 20, 5), (5, 42, 2), (12, 90, 0), (100_000, 1, 2)])
def test_rows_are_in_order_and_cases_whole_whatever_a_stretch_is(tmp_path, monkeypatch, rows_at_a_time, part, files):
    for module, name in ((parts, "STRETCH_ROWS"), (merged_rows, "STRETCH_ROWS"), (merged_rows, "BATCH_ROWS")):
        monkeypatch.setattr(module, name, rows_at_a_time)
    monkeypatch.setattr(merged_rows, "PART_ROWS", part)
    (tmp_path / RESULTS).mkdir()  # of a larger sweep before
    folder = ResultFolder(tmp_path)
    folder.begin({}, resume=False)
    for name, rows in pieces():
        folder.parts.add(name, rows)
    stretches = []

    def more(rows):
        """What the statistics make of a stretch: a row of a third method for every case that has both."""
        stretches.append(rows)
        found = rows.to_pandas()
        both = found.groupby(["scenario", "case"])["method"].transform("nunique") == 2
        made = found[both].drop_duplicates(["scenario", "case"]).assign(method="both")
        return pa.Table.from_pandas(made, schema=SCHEMA, preserve_index=False)

    folder.merge(more)
    groups, of_t = folder.rows.groups(), list(folder.rows.batches("t", "", ["method"]))
    folder.parts.finish()
    rows = folder.results()
    assert rows.num_rows == 2 * 3 * 15
    assert rows.equals(rows.sort_by(KEY))
    assert (len(stretches) > 2) == (rows_at_a_time < 15)
    assert groups == [("s", ""), ("t", "")]
    assert (len(of_t) > 2) == (rows_at_a_time < 15)
    assert [name for batch in of_t for name in batch["case"].to_pylist()] == [f"c{i // 3:02d}" for i in range(45)]
    assert folder.rows.count("t", "") == 45
    assert all(len(set(batch["method"].to_pylist()[-3:])) == 3 for batch in of_t), "a case was cut"
    written = tmp_path / RESULTS
    assert len(list(written.glob("part-*.parquet"))) == files
    assert pd.read_parquet(written)["case"].tolist() == rows["case"].to_pylist()
