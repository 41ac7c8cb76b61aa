"""Two result folders compared value by value: what counts as a difference, and what does not."""

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import same_results

ROWS = {
    "scenario": ["s"] * 4,
    "variation": [""] * 4,
    "case": ["a", "a", "b", "b"],
    "method": ["acc", "pgm", "acc", "pgm"],
    "failed": [True, False, False, False],
    "label": ["YIELD", "", "", ""],
    "order_swapped": [None, True, False, None],
    "delay_s": [1.0, None, 2.0, 3.0],
    "log_odds_40": [float("-inf"), None, 0.5, 1.0],
}
SUMMARY = {"scenario": ["s", "s"], "variation": ["", ""], "site": ["x", "x"], "source": ["ngsim", "ngsim"]}
SUMMARY |= {"method": ["acc", "pgm"], "failures": [1, 0], "cycle_us": [0.5, 0.7]}


def folder(path, rows=ROWS, summary=SUMMARY, version="3"):
    path.mkdir()
    table = pa.table(rows).replace_schema_metadata({"merge_cosim_schema": version})
    pq.write_table(table, path / "results.parquet")
    pd.DataFrame(summary).to_csv(path / "summary.csv", index=False)
    return str(path)


def changed(column, row, value):
    return ROWS | {column: [value if i == row else old for i, old in enumerate(ROWS[column])]}


@pytest.fixture
def a(tmp_path):
    return folder(tmp_path / "a")


def test_order_times_version_and_new_columns_are_no_difference(a, tmp_path, capsys):
    rows = {name: values[::-1] for name, values in ROWS.items()} | {"stuck": [False] * 4}
    b = folder(tmp_path / "b", rows, SUMMARY | {"cycle_us": [9.0, 9.0]}, version="4")
    assert same_results.main([a, b]) == 0
    output = capsys.readouterr().out
    assert "results.parquet: 4 and 4 rows, 4 in both; the same" in output
    assert "summary.csv: 2 and 2 rows, 2 in both; the same" in output
    assert "columns in B alone: stuck" in output


@pytest.mark.parametrize(
    ("column", "row", "value", "line"),
    [
        ("delay_s", 2, 2.5, "delay_s: 1 of 4 differ, by up to 0.5: 2.0 != 2.5 (s b acc)"),
        ("delay_s", 1, 0.0, "delay_s: 1 of 4 differ"),  # undefined is not zero
        ("log_odds_40", 0, float("inf"), "log_odds_40: 1 of 4 differ, by up to inf: -inf != inf"),
        ("failed", 1, True, "failed: 1 of 4 differ: False != True (s a pgm)"),
        ("order_swapped", 3, True, "order_swapped: 1 of 4 differ"),
        ("label", 1, "YIELD", "label: 1 of 4 differ"),
    ],
)
def test_one_changed_value_is_found_and_named(a, tmp_path, capsys, column, row, value, line):
    assert same_results.main([a, folder(tmp_path / "b", changed(column, row, value))]) == 1
    assert line in capsys.readouterr().out


def test_a_changed_summary_is_found(a, tmp_path, capsys):
    assert same_results.main([a, folder(tmp_path / "b", summary=SUMMARY | {"failures": [1, 1]})]) == 1
    assert "failures: 1 of 2 differ, by up to 1" in capsys.readouterr().out


def test_missing_rows_differ_unless_a_part_is_compared(a, tmp_path, capsys):
    part = folder(tmp_path / "b", {name: values[:1] for name, values in ROWS.items()})
    assert same_results.main([a, part]) == 1
    assert "3 rows in A alone, such as s a pgm" in capsys.readouterr().out
    assert same_results.main([a, part, "--part"]) == 0
    wrong = changed("delay_s", 0, 7.0)
    wrong = folder(tmp_path / "c", {name: values[:1] for name, values in wrong.items()})
    assert same_results.main([a, wrong, "--part"]) == 1


def test_what_cannot_be_compared_has_its_own_status(a, tmp_path, capsys):
    assert same_results.main([a, str(tmp_path / "nowhere")]) == 2
    assert "nowhere/results.parquet: missing" in capsys.readouterr().err
    damaged = folder(tmp_path / "damaged")
    (tmp_path / "damaged" / "results.parquet").write_bytes(b"PAR1")
    assert same_results.main([a, damaged]) == 2
    twice = folder(tmp_path / "twice", {name: [*values, values[0]] for name, values in ROWS.items()})
    assert same_results.main([a, twice]) == 2
    assert "1 rows have the key of another, such as s a acc" in capsys.readouterr().err
    other = folder(tmp_path / "other", ROWS | {"scenario": ["t"] * 4})
    assert same_results.main([a, other, "--part"]) == 2
    keyless = folder(tmp_path / "keyless", {name: values for name, values in ROWS.items() if name != "case"})
    assert same_results.main([a, keyless]) == 2
