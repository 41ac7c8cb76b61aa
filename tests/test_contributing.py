"""CONTRIBUTING and the API reference name what there is: every file, every package."""

import re
from pathlib import Path

ROOT = Path(__file__).parent.parent
PACKAGE = ROOT / "merge_cosim"
PACKAGES = {folder.name for folder in PACKAGE.iterdir() if (folder / "__init__.py").exists()}


def test_the_files_that_are_named_are_there():
    for page in ("CONTRIBUTING.md", "docs/architecture.md"):
        text = (ROOT / page).read_text(encoding="utf-8")
        named = {name for name in re.findall(r"`([\w/]+\.py)`", text) if "/" in name}
        assert len(named) > 10
        assert [name for name in named if not ((PACKAGE / name).exists() or (ROOT / name).exists())] == []


def test_every_package_is_described():
    for page in ("CONTRIBUTING.md", "docs/architecture.md"):
        rows = re.findall(r"^\| (`\w+/`.*?) \|", (ROOT / page).read_text(encoding="utf-8"), flags=re.MULTILINE)
        described = {name for row in rows for name in re.findall(r"`(\w+)/`", row)}
        assert described == PACKAGES, page


def test_every_package_has_a_page_of_the_reference():
    pages = {page.stem for page in (ROOT / "docs" / "reference").glob("*.md")} - {"README"}
    assert pages == PACKAGES | {"merge_cosim"}
