"""Damaged inputs of every kind: a right result or one line, never a traceback, a hang or a crash.

The long run is `python tools/fuzz.py --inputs N --seed S`.
"""

import os
import random
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path

import pytest
from fuzz import GOOD, fuzz
from fuzz_oracles import Wrong
from fuzz_targets import TARGETS, Target
from hypothesis import given, settings
from hypothesis import strategies as st

from merge_cosim.core.errors import UserError
from merge_cosim.core.toml_file import Table, read_toml
from merge_cosim.core.xml_file import read_xml, root_element
from merge_cosim.scenarios.settings import parse_setting, parse_value, parse_variation

SEED = 14
SLOW = 3
"""Targets of a smaller share start SUMO or a whole command for each input."""


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MERGE_COSIM_CACHE", str(tmp_path / "cache"))


def test_damaged_inputs_are_right_or_refused(tmp_path: Path) -> None:
    quick = [one for one in TARGETS if one.share > SLOW]
    counts = fuzz(quick, 300, SEED, tmp_path)
    assert sum(counts.values()) == 300
    assert {kind for _, kind in counts} == set(GOOD), list(tmp_path.iterdir())


@pytest.mark.parametrize("target", [one for one in TARGETS if one.share <= SLOW], ids=lambda target: target.name)
def test_a_damaged_input_of_a_whole_command(target: Target, tmp_path: Path) -> None:
    assert set(fuzz([target], 1, SEED, tmp_path)) <= {(target.name, kind) for kind in GOOD}, list(tmp_path.iterdir())


def _raises(error: Exception) -> None:
    raise error


@pytest.mark.parametrize(
    ("kind", "read"),
    [
        ("right", lambda: None),
        ("refused", lambda: _raises(UserError("a.toml: no such key"))),
        ("line", lambda: _raises(UserError("no such key"))),
        ("wrong", lambda: partial(_raises, Wrong("2 was taken as 3"))),
        ("traceback", lambda: _raises(KeyError("x"))),
        ("process", lambda: subprocess.Popen([sys.executable, "-c", "pass"]) and None),
        ("crash", lambda: os.kill(os.getpid(), 9)),
        ("hang", lambda: time.sleep(60)),
    ],
)
def test_what_a_fault_is_called(kind: str, read: Callable[[], object], tmp_path: Path) -> None:
    target = Target("mine", lambda folder, rng: read, r"a\.toml")
    assert fuzz([target], 2, SEED, tmp_path, limit=0.5) == {("mine", kind): 2}


def test_an_input_can_be_made_again(tmp_path: Path) -> None:
    target = next(one for one in TARGETS if one.name == "scenario")
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        target.make(tmp_path / folder, random.Random(f"{SEED} scenario 7"))
    assert (tmp_path / "a/s.toml").read_bytes() == (tmp_path / "b/s.toml").read_bytes()


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
