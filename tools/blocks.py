"""Blocks of hand-written pages that a tool fills: `<!-- KIND: ARGUMENT -->` ... `<!-- end -->`."""

import re
from collections.abc import Callable, Mapping, Sequence

BLOCK = re.compile(r"<!-- (?P<kind>\w+): (?P<argument>[^>]+) -->\n.*?<!-- end -->", re.DOTALL)


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
