"""Every command that a page mentions is one: its options are parsed, and nothing is run."""

import re
import shlex
from collections.abc import Iterator
from pathlib import Path

import pytest
from command import merge_cosim

ROOT = Path(__file__).parent.parent
PAGES = [ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
COMMAND = re.compile(r"^ *merge-cosim (?P<line>.+)$|`merge-cosim (?P<inline>[^`]+)`", re.MULTILINE)


def mentioned(text: str) -> Iterator[list[str]]:
    for found in COMMAND.finditer(text.replace("\\\n", " ")):
        line = found["line"] or " ".join(found["inline"].split())
        words = shlex.split(line.partition("  #")[0].partition("; ")[0].replace("[...]", ""), comments=True)
        yield [word for word in words if word not in ("...", "…")]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_the_commands_of_a_page_are_there(page: Path, tmp_path: Path) -> None:
    wrong = {}
    for words in mentioned(page.read_text(encoding="utf-8")):
        done = merge_cosim(*words, "--help", cwd=tmp_path)
        if done.returncode:
            wrong[" ".join(words)] = done.stderr
    assert wrong == {}
