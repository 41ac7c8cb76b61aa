"""What a sweep and a case look like in a terminal of 80 columns."""

import json
import shlex
from itertools import pairwise

import pytest
from command import merge_cosim, refused, run_process, small_scenario

import merge_cosim as mc
from merge_cosim.scenarios.methods import is_reference

WIDTH = 80


@pytest.fixture(scope="module")
def swept(tmp_path_factory):
    """A folder with a sweep of all methods, one of a single one, and what the first printed."""
    folder = tmp_path_factory.mktemp("swept")
    small_scenario(folder)
    closed = ("sweep", "small.toml", "--world", "closed-form")
    every = merge_cosim(*closed, "--out", "every", cwd=folder)
    assert every.returncode == 0, every.stderr
    assert merge_cosim(*closed, "--method", "acc", "--out", "one", cwd=folder).returncode == 0
    return folder, every.stdout


def rows_of(printed):
    """The table's rows as words: between the rule below the headings and the next, and from there to the last."""
    lines = printed.splitlines()
    rules = [number for number, line in enumerate(lines) if line.strip().startswith("───")]
    return [[line.split() for line in lines[first + 1 : last]] for first, last in pairwise(rules[1:])]


def test_a_terminal_that_lacks_a_character_shows_another(tmp_path):
    words = ("--world", "closed-form", "--method", "acc", "--set", "encounters.count=5")
    done = run_process("sweep", "designed-random", *words, cwd=tmp_path, PYTHONIOENCODING="ascii")
    assert done.returncode == 0, done.stderr
    assert "0.0?43.4" in done.stdout  # a dash between the ends of an interval
    assert done.stdout.isascii()


def test_all_methods_fit_80_columns(swept):
    folder, printed = swept
    assert max(map(len, printed.splitlines())) <= WIDTH
    title = printed.splitlines()[0]
    assert title == "small (designed, world closed-form, cases each: 75)"
    methods, references = rows_of(printed)
    assert [is_reference(row[0]) for row in methods + references] == [False] * len(methods) + [True] * len(references)
    summary = json.loads((folder / "every/summary.json").read_text())
    by = {row["method"]: (row["failed_or_stuck_pct"], row["delay_s"]) for row in summary}
    assert [row[0] for row in methods] == sorted((m for m in by if not is_reference(m)), key=lambda m: by[m])
    least = min(row["delay_s"] for row in summary if not is_reference(row["method"]))
    assert sum(f"{least:.2f}*" in row for row in methods) == 1
    assert "*" not in str(references)
    assert f"{methods[0][0]}" in printed.split("references\n")[1]
    assert "least: " in printed


def test_one_method_fits_and_has_nothing_to_be_best_of(swept):
    folder, _ = swept
    printed = merge_cosim("summary", "one", cwd=folder).stdout
    assert max(map(len, printed.splitlines())) <= WIDTH
    assert "*" not in printed
    assert "No other method to compare with." in " ".join(printed.split())


def test_the_verdicts_alone(swept):
    folder, output = swept
    line = merge_cosim("summary", "every", "--verdict", cwd=folder).stdout.strip()
    title, _, verdict = line.partition("): ")
    assert f"{title})" in output
    assert verdict in " ".join(output.split())


def test_more_columns_and_chosen_ones(swept):
    folder, _ = swept
    wide = merge_cosim("summary", "every", "--wide", cwd=folder).stdout
    assert "needless" in wide
    chosen = merge_cosim("summary", "every", "--columns", "failures,gap_m", cwd=folder).stdout
    assert chosen.splitlines()[2].split() == ["method", "failed", "gap_m"]
    assert json.loads(merge_cosim("summary", "every", "--json", cwd=folder).stdout)[0]["n"] == 75
    assert "did you mean 'gap_m'" in refused("summary", "every", "--columns", "gap", cwd=folder)


def test_a_varied_parameter_heads_the_column_of_its_values(tmp_path):
    small_scenario(tmp_path)
    arguments = ("--world", "closed-form", "--method", "acc", "--vary", "acc.headway=10,2", "--out", "out")
    printed = merge_cosim("sweep", "small.toml", *arguments, cwd=tmp_path).stdout
    assert printed.splitlines()[2].split()[:2] == ["acc.headway", "method"]
    (rows,) = rows_of(printed)
    assert [row[0] for row in rows] == ["–", "10", "2"]  # as the user gave them
    assert "Without variation: acc" in printed


@pytest.fixture(scope="module")
def sampled(tmp_path_factory):
    """Two sweeps of random cases, the second with more of them and another method; and what the first printed."""
    folder = tmp_path_factory.mktemp("sampled")
    closed = ("sweep", "designed-random", "--world", "closed-form")
    done = merge_cosim(
        *(*closed, "--method", "acc,pgm", "--set", "acc.headway=1.2", "--set", "encounters.count=200", "--out", "a"),
        cwd=folder,
    )
    assert done.returncode == 0, done.stderr
    more = merge_cosim(*closed, "--method", "fg", "--set", "encounters.count=250", "--out", "b", cwd=folder)
    assert more.returncode == 0, more.stderr
    return folder, done.stdout


def test_a_sample_has_intervals_and_a_verdict_with_its_certainty(sampled):
    _, printed = sampled
    assert "95 % CI" in printed
    assert "Holm" in printed
    assert max(map(len, printed.splitlines())) <= WIDTH


def test_any_two_methods_are_compared_on_their_common_cases(sampled):
    folder, _ = sampled
    printed = merge_cosim("compare", "a:pgm", "b:fg", cwd=folder).stdout
    assert printed.startswith("A: a, pgm; B: b, fg\ndesigned-random: 200 common cases\n")
    assert "p = " in printed or "p < " in printed
    assert " fails less: " in printed or "Both fail in as many cases" in printed
    assert "0.000" not in printed
    assert max(map(len, printed.splitlines())) <= WIDTH
    (row,) = json.loads(merge_cosim("compare", "a:pgm", "b:fg", "--json", cwd=folder).stdout)["rows"]
    a, b = (mc.load_results(folder / name).rows.set_index(["method", "case"])["delay_s"] for name in "ab")
    differences = (a["pgm"] - b["fg"]).dropna()
    assert (row["n"], row["delay_s_difference"]) == (200, pytest.approx(differences.mean()))
    assert row["delay_s_interval"]
    assert "name a method of both" in refused("compare", "a:pgm", "b", cwd=folder)
    assert "did you mean 'pgm'" in refused("compare", "a:pgn", "b:fg", cwd=folder)
    assert "DIR:METHOD DIR:METHOD compares two methods" in refused("compare", "a", "b", cwd=folder)


def test_a_listed_case_can_be_pasted_into_a_shell(sampled):
    folder, _ = sampled
    listed = merge_cosim("cases", "a", "--where", "failed and method == 'pgm'", "--limit", "2", cwd=folder)
    rows = mc.load_results(folder / "a").rows
    failed = rows[rows["failed"] & (rows["method"] == "pgm")]
    lines = listed.stdout.splitlines()
    assert len(lines) == min(2, len(failed)) > 0
    assert listed.stderr.startswith(f"{len(failed):,} of 400 rows")
    program, *words = shlex.split(lines[0])
    assert program == "merge-cosim"
    again = json.loads(merge_cosim(*words, "--json", cwd=folder).stdout)
    first = failed.iloc[0]
    assert (again["case"], again["method"], again["failed"]) == (first["case"], "pgm", True)
    assert again["delay_s"] == pytest.approx(first["delay_s"])


def test_cases_that_fail_under_one_method_and_not_under_another(sampled):
    folder, _ = sampled
    found = json.loads(merge_cosim("cases", "a", "--fails", "pgm", "--not", "acc", "--json", cwd=folder).stdout)
    rows = mc.load_results(folder / "a").rows
    by = {name: part.set_index("case") for name, part in rows.groupby("method")}
    bad = by["acc"][["failed", "stuck", "censored"]].any(axis=1)
    expected = by["pgm"].index[by["pgm"]["failed"] & ~bad[by["pgm"].index]]
    assert sorted(row["case"] for row in found) == sorted(expected)
    assert {row["method"] for row in found} == {"pgm"}
    assert len(found) > 0
    assert "no method 'pgn'" in refused("cases", "a", "--fails", "pgn", cwd=folder)
    assert "no column 'faild'" in refused("cases", "a", "--where", "faild", cwd=folder)


def test_a_finished_sweep_is_never_replaced_unasked(swept):
    folder, _ = swept
    before = (folder / "one/results.parquet").read_bytes()
    again = ("sweep", "small.toml", "--world", "closed-form", "--out", "one", "--method")
    assert "holds a finished sweep; --overwrite replaces it" in refused(*again, "acc", cwd=folder)
    assert "another one (methods, parameters changed)" in refused(*again, "slot", "--resume", cwd=folder)
    assert "choose one" in refused(*again, "slot", "--resume", "--overwrite", cwd=folder)
    assert (folder / "one/results.parquet").read_bytes() == before
    assert merge_cosim(*again, "acc", "--resume", cwd=folder).returncode == 0  # the same one: kept
    assert merge_cosim(*again, "acc", "--set", "acc.headway=0.5", "--overwrite", cwd=folder).returncode == 0
    assert (folder / "one/results.parquet").read_bytes() != before


def test_a_case_is_described_in_five_lines(swept):
    folder, _ = swept
    run = ("run", "small.toml", "--world", "closed-form", "--method", "acc", "--case")
    title, start, merge, result, cost = merge_cosim(*run, "d+0_h15_m15", cwd=folder).stdout.splitlines()
    assert title == "small d+0_h15_m15, designed: acc in closed-form"
    assert start.split()[:4] == ["start", "host", "-90.0", "m,"]
    assert merge.startswith("merge   ")
    assert result.startswith("result  no failure") or "FAILED" in result
    assert cost.startswith("cost    delay ")
    assert max(map(len, (title, start, merge, result, cost))) <= WIDTH
