"""Damaged inputs of every kind: a right result or one line, never a traceback, a hang or a crash.

The long run is `python tools/fuzz.py --inputs N --seed S`.
"""

import random
from contextlib import suppress
from pathlib import Path

import pytest
from fuzz import fuzz, run
from fuzz_inputs import TARGETS, Target
from hypothesis import given, settings
from hypothesis import strategies as st

import merge_cosim.api.sweep  # so that every copy of this process has it
from merge_cosim.core.errors import UserError
from merge_cosim.core.toml_file import Table, read_toml
from merge_cosim.core.xml_file import read_xml, root_element
from merge_cosim.scenarios.settings import parse_setting, parse_value, parse_variation

SEED = 14
assert merge_cosim.api.sweep


@pytest.mark.parametrize("target", TARGETS, ids=lambda target: target.name)
def test_a_good_input_is_right_and_damaged_ones_are_refused_in_one_line(
    target: Target, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MERGE_COSIM_CACHE", str(tmp_path / "cache"))
    for number in range(2):
        folder = tmp_path / f"{number}"
        folder.mkdir()
        found = run(target.make(folder, random.Random(f"{SEED} {target.name} {number}")), folder)
        assert found.kind in ("right", "refused"), found


def test_what_a_fault_is_called(tmp_path: Path) -> None:
    """The tool itself: it tells a traceback, and what is right."""
    plugin = tmp_path / "p.py"
    plugin.write_text("import os; os.kill(os.getpid(), 9)")
    run_case = ("run", "designed-2", "--case", "d+0_h15_m15", "--method", "acc", "--world", "closed-form")
    assert run((*run_case, "--plugin", "p.py"), tmp_path).kind == "crash"
    plugin.write_text("while True: pass")
    assert run((*run_case, "--plugin", "p.py"), tmp_path, limit=3.0).kind == "hang"
    plugin.write_text("1 / 0")
    assert run((*run_case, "--plugin", "p.py"), tmp_path).kind == "refused"
    assert run(run_case, tmp_path).kind == "right"
    assert sum(fuzz([one for one in TARGETS if one.name == "set"], 1, SEED).values()) == 1


@settings(max_examples=50)
@given(st.text())
def test_any_text_of_a_setting(text: str) -> None:
    for parse in (parse_value, parse_setting, parse_variation):
        with suppress(UserError):
            parse(text)


def test_a_setting_of_many_brackets() -> None:
    with pytest.raises(UserError, match="nested too deeply"):
        parse_setting("acc.headway=" + "[" * 2_000 + "]" * 2_000)


@settings(max_examples=50)
@given(st.binary(max_size=300))
def test_any_bytes_as_a_file(tmp_path_factory: pytest.TempPathFactory, content: bytes) -> None:
    file = tmp_path_factory.getbasetemp() / "any"
    file.write_bytes(content)
    for read in (read_xml, root_element, lambda path: read_toml(path, Table, "thing")):
        with suppress(UserError):
            read(file)
