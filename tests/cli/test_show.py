"""What commands print: JSON, tables, one line for a mistake; what an interrupted or full sweep says."""

import errno
import json

import pytest
import typer

from merge_cosim.api.progress import sweep_progress
from merge_cosim.cli.interrupts import resumable
from merge_cosim.cli.show import die, print_json, show_table
from merge_cosim.core.errors import UserError


def test_infinite_numbers_are_texts_in_json(capsys):
    print_json({"rows": [{"min_ttc_s": float("inf")}, (float("-inf"), 1.5, None)]})
    assert json.loads(capsys.readouterr().out) == {"rows": [{"min_ttc_s": "inf"}, ["-inf", 1.5, None]]}


def test_a_mistake_is_one_line_and_status_2(capsys):
    with pytest.raises(SystemExit) as end:
        die("small.toml:\n  no such   file")
    assert end.value.code == 2
    assert capsys.readouterr() == ("", "merge-cosim: small.toml: no such file\n")


def test_a_table_leaves_out_columns_without_values(capsys):
    show_table([{"method": "acc", "p": None, "failures": 1.234}, {"method": "pgm", "p": "", "failures": None}], "Two")
    title, _, heading, _, first, second, _ = capsys.readouterr().out.splitlines()
    assert (title.strip(), heading.split()) == ("Two", ["method", "failures"])
    assert (first.split()[1], second.split()[1]) == ("1.23", "-")


def test_an_interrupt_ends_with_status_130_and_says_how_to_go_on(capsys):
    with pytest.raises(typer.Exit) as end, resumable("go on with --resume"):
        raise KeyboardInterrupt
    assert end.value.exit_code == 130
    assert capsys.readouterr().err == "interrupted: go on with --resume\n"


def test_a_full_disk_is_a_mistake_and_other_errors_stay_what_they_are():
    with pytest.raises(UserError, match="no space left on the disk; go on"), resumable("go on"):
        raise OSError(errno.ENOSPC, "full")
    with pytest.raises(PermissionError), resumable("go on"):
        raise PermissionError(errno.EACCES, "closed")


def test_progress_is_silent_at_first_where_there_is_no_terminal(capsys):
    for shown in (True, False):
        with sweep_progress(shown) as show:
            show(1, 2, "acc")
    assert capsys.readouterr() == ("", "")
