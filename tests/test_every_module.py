"""Every module with code in it is imported by a test that names it, or holds a public name that one uses."""

import ast
from collections import Counter
from pathlib import Path

import merge_cosim

ROOT = Path(__file__).parent.parent


def modules() -> set[str]:
    """Names of all modules that hold more than a docstring (`__main__` is run, by test_installed)."""
    found = set()
    for file in (ROOT / "merge_cosim").rglob("*.py"):
        if file.name != "__main__.py" and len(ast.parse(file.read_text(encoding="utf-8")).body) > 1:
            found.add(".".join(file.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"))
    return found


def named(file: Path) -> set[str]:
    """Names of all modules that a file imports, those that it imports from, and those that hold a `mc.NAME`."""
    found = set()
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        match node:
            case ast.Import():
                found |= {alias.name for alias in node.names}
            case ast.ImportFrom(module=str(module)):
                found |= {module} | {f"{module}.{alias.name}" for alias in node.names}
            case ast.Attribute(value=ast.Name("mc" | "merge_cosim"), attr=name) if name in merge_cosim._HOME:
                found.add(f"merge_cosim.{merge_cosim._HOME[name]}")
    return found


def test_every_module_is_named_by_a_test():
    tests = set().union(*(named(file) for file in (ROOT / "tests").rglob("*.py")))
    assert sorted(modules() - tests) == [], "import these in a test of theirs"


def test_no_two_test_files_have_one_name():
    """Test folders are no packages, so that pytest cannot collect two files of one name."""
    count = Counter(file.name for file in (ROOT / "tests").rglob("*.py") if file.name != "conftest.py")
    assert [name for name, times in count.items() if times > 1] == []
