"""What the tools that make pages of the docs share: their options, tables, and the blocks that they fill.

A block is `<!-- KIND: ARGUMENT -->` ... `<!-- end -->` in a page that is otherwise written by hand.
"""

import re
import tempfile
from argparse import ArgumentParser, RawDescriptionHelpFormatter
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from pathlib import Path

from merge_cosim.cli.main import app

DOCS = Path(__file__).parent.parent / "docs"

BLOCK = re.compile(r"<!-- (?P<kind>\w+): (?P<argument>[^>]+) -->\n.*?<!-- end -->", re.DOTALL)


def page_parser(about: str | None) -> ArgumentParser:
    """The options of every page tool."""
    parser = ArgumentParser(description=about, formatter_class=RawDescriptionHelpFormatter)
    parser.add_argument("--docs", type=Path, default=DOCS, help="folder that the page is written into")
    parser.add_argument("--short", action="store_true", help="few cases: a check of the tool; its figures mean nothing")
    return parser


def swept(words: Sequence[str], folder: Path | None = None) -> Path:
    """Result folder of the sweep that `merge-cosim` runs by these words, unless the folder is given."""
    if folder is None:
        folder = Path(tempfile.mkdtemp(prefix="page-")) / "out"
        app([*words, "--out", str(folder)], standalone_mode=False)
    return folder


def fill_page(name: str, docs: Path, kinds: Mapping[str, Callable[[str], str | None]]) -> None:
    """Write the page `name` of the docs, its blocks filled anew, into the folder `docs`."""
    target, page = docs / name, DOCS / name
    target.parent.mkdir(parents=True, exist_ok=True)
    made = {kind: cache(make) for kind, make in kinds.items()}
    filled(page.read_text(encoding="utf-8"), made)  # takes minutes, in which the page may be edited
    target.write_text(filled(page.read_text(encoding="utf-8"), made), encoding="utf-8")


def filled(text: str, kinds: Mapping[str, Callable[[str], str | None]]) -> str:
    """A page with its blocks of these kinds filled anew; the others, and those for which there is None, stay."""

    def fill(block: re.Match[str]) -> str:
        kind, argument = block["kind"], block["argument"]
        made = kinds[kind](argument) if kind in kinds else None
        return block[0] if made is None else f"<!-- {kind}: {argument} -->\n{made}<!-- end -->"

    return BLOCK.sub(fill, text)


def table(head: Sequence[str], rows: Sequence[Sequence[str]], left: int = 1) -> str:
    """A Markdown table, its first columns to the left, the others to the right."""
    lines = [head, [*["---"] * left, *["---:"] * (len(head) - left)], *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines) + "\n"
