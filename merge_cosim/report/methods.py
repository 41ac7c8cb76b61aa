"""Order and looks of the methods: the same in every table and figure, of the page and for papers."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from merge_cosim.core import colors
from merge_cosim.scenarios.methods import REFERENCES, is_reference

FAMILIES = ("acc", "slot", "ipcb", "pgm-g", "pgm", "fg", "fg-gmm", "dbn-pf", "interactive")
"""The methods in the order of the papers' tables; a variant (`pgm-time`) follows its family."""
MARKS = "os^DvPX*ph"
"""Shapes in matplotlib's words, of which `templates/draw.js` has the same."""
DASHES = ("", "7 3", "9 3 2 3", "13 3", "5 2 2 2 2 2")
"""Dashes of a page's lines, as SVG writes them; dots are kept for merging cars."""


@dataclass(frozen=True)
class Look:
    """How a method is drawn.

    Attributes:
        color: Its colour everywhere.
        mark: Its shape, in matplotlib's words; no two methods of a figure have both in common.
        line: Matplotlib's line style; dashes are kept for merging cars.
    """

    color: str
    mark: str = "o"
    line: str = "-"

    @property
    def dash(self) -> str:
        """The dashes of its line in a page, as SVG writes them."""
        return DASHES[MARKS.index(self.mark) % len(DASHES)]


FAMILY_COLORS = {
    "acc": colors.BLUE,
    "slot": colors.GREEN,
    "ipcb": colors.ORANGE,
    "pgm-g": colors.PURPLE,
    "pgm": colors.VERMILION,
    "fg": colors.SKY,
    "fg-gmm": colors.INDIGO,
    "dbn-pf": colors.WINE,
    "interactive": colors.BROWN,
}
"""A family has a colour, and each of its variants a shape."""
_SHAPES = {
    "acc": "o",
    "slot": "s",
    "slot-time": "X",
    "ipcb": "^",
    "pgm-g": "v",
    "pgm": "D",
    "pgm-symmetric": "p",
    "pgm-time": "^",
    "pgm-speed": "s",
    "fg": "P",
    "fg-time": "v",
    "fg-gmm": "*",
    "fg-gmm-joint": "o",
    "fg-gmm-time": "s",
    "dbn-pf": "X",
    "interactive": "h",
}
GREYS = (colors.BLACK, colors.GREY, colors.SILVER)
GREY_LINES = ("-", "-.")


def in_order(methods: Iterable[str]) -> list[str]:
    """Sort methods: the papers' first, then a user's own by name, then the references."""
    return sorted(set(methods), key=_rank)


def looks(methods: Iterable[str]) -> Mapping[str, Look]:
    """Give each method its look; a known method has the same one in every figure.

    Another one has the colour of its family, if it has one, and a shape that no other method has in that colour.
    """
    ordered = in_order(methods)
    chosen = {method: KNOWN[method] for method in ordered if method in KNOWN}
    for method in ordered:
        if is_reference(method):
            i = REFERENCES.index(method.partition("+")[0])
            chosen[method] = Look(GREYS[i % len(GREYS)], MARKS[i % len(MARKS)], GREY_LINES[i // len(GREYS)])
        elif method not in KNOWN:
            chosen[method] = _free(_family(method), chosen.values())
    return chosen


def broken(name: str, most: int = 16) -> str:
    """A long name in several lines, parted behind its dashes and pluses."""
    lines = [""]
    for piece in re.split(r"(?<=[-+_])", name):
        if lines[-1] and len(lines[-1]) + len(piece) > most:
            lines.append("")
        lines[-1] += piece
    return "\n".join(lines)


def _free(family: str | None, taken: Iterable[Look]) -> Look:
    used = {(look.color, look.mark) for look in taken} | {(look.color, look.mark) for look in KNOWN.values()}
    hues = [FAMILY_COLORS[family]] if family else [colors.OLIVE, *colors.DISTINCT]
    many = len(hues)  # neighbours differ in both
    places = range(many * len(MARKS))
    pairs = [(hues[i % many], MARKS[(i % many + i // many) % len(MARKS)]) for i in places]
    color, mark = next((pair for pair in pairs if pair not in used), pairs[len(used) % len(pairs)])
    return Look(color, mark)


def _family(method: str) -> str | None:
    estimator = method.partition("+")[0]
    own = [family for family in FAMILIES if estimator == family or estimator.startswith((f"{family}-", f"{family}_"))]
    return max(own, key=len, default=None)


KNOWN = {method: Look(FAMILY_COLORS[_family(method) or method], mark) for method, mark in _SHAPES.items()}
"""The looks of the methods that come with the package."""


def _rank(method: str) -> tuple[int, int, str]:
    if is_reference(method):
        return 2, REFERENCES.index(method.partition("+")[0]), method
    family = _family(method)
    return (0, FAMILIES.index(family), method) if family else (1, 0, method)
