"""The pages about the methods say what the code has."""

import re
import runpy
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
TOOL = runpy.run_path(str(ROOT / "tools" / "belief_pages.py"))


@pytest.mark.parametrize("page", TOOL["PAGES"])
def test_parameter_tables_are_current(page):
    text = (ROOT / "docs" / "methods" / f"{page}.md").read_text(encoding="utf-8")
    tables = TOOL["MARKED"].findall(text)
    assert tables
    for _, name, _ in tables:
        assert TOOL["parameter_table"](name) in text, "run python tools/belief_pages.py"


@pytest.mark.parametrize("page", TOOL["PAGES"])
def test_pictures_and_links_exist(page):
    folder = ROOT / "docs" / "methods"
    text = (folder / f"{page}.md").read_text(encoding="utf-8")
    for link in re.findall(r"\]\(([^)#:]+)\)", text):
        assert (folder / link).is_file(), link
