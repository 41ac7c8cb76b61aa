"""Order, colours and line styles of the methods: the same in every table and figure."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from merge_cosim.scenarios.methods import REFERENCES, is_reference

FAMILIES = ("acc", "slot", "ipcb", "pgm-g", "pgm", "fg", "fg-gmm", "dbn-pf")
"""The papers' methods, in the order of their tables; a variant (`pgm-time`) follows its family."""

COLORS = {
    "acc": "#0072B2",
    "slot": "#44AA99",
    "slot-time": "#117733",
    "ipcb": "#C6A700",
    "pgm-g": "#882255",
    "pgm": "#D55E00",
    "pgm-time": "#E69F00",
    "pgm-speed": "#CC79A7",
    "fg": "#56B4E9",
    "fg-gmm": "#332288",
    "dbn-pf": "#999933",
}
"""Colours that stay apart under the common kinds of colour blindness (after Okabe and Ito, and Tol)."""
OTHER_COLORS = ("#AA4499", "#661100", "#6699CC", "#88CCEE", "#AA4466", "#4477AA", "#228833", "#EE6677")
GREYS = ("#000000", "#6b6b6b", "#a3a3a3")
GREY_LINES = ("-", "-.")


@dataclass(frozen=True)
class Look:
    """How a method is drawn.

    Attributes:
        color: Its colour everywhere.
        line: Matplotlib's line style; dashes are kept for merging cars.
    """

    color: str
    line: str = "-"


def in_order(methods: Iterable[str]) -> list[str]:
    """Sort methods: the papers' first, then a user's own by name, then the references."""
    return sorted(set(methods), key=_rank)


def looks(methods: Iterable[str]) -> Mapping[str, Look]:
    """Give each method its look; a known method has the same one in every figure."""
    ordered = in_order(methods)
    others = [method for method in ordered if method not in COLORS and not is_reference(method)]
    chosen = {method: Look(COLORS[method]) for method in ordered if method in COLORS}
    chosen |= {method: Look(OTHER_COLORS[i % len(OTHER_COLORS)]) for i, method in enumerate(others)}
    for method in filter(is_reference, ordered):
        i = REFERENCES.index(method.partition("+")[0])
        chosen[method] = Look(GREYS[i % len(GREYS)], GREY_LINES[i // len(GREYS)])
    return chosen


def _rank(method: str) -> tuple[int, int, str]:
    if is_reference(method):
        return 2, REFERENCES.index(method.partition("+")[0]), method
    estimator = method.partition("+")[0]
    own = [family for family in FAMILIES if estimator == family or estimator.startswith((f"{family}-", f"{family}_"))]
    return (0, FAMILIES.index(max(own, key=len)), method) if own else (1, 0, method)
