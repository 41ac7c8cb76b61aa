"""Redraw the pictures and parameter tables of some pages in docs/methods: python tools/belief_pages.py."""

import re
from pathlib import Path

from merge_cosim.control.base import controllers
from merge_cosim.intention.base import estimators
from merge_cosim.intention.model import IntentionModel
from merge_cosim.registry import parameters
from merge_cosim.report import canvas
from merge_cosim.report.belief_figures import belief_figure, candidates_figure, clouds_figure

DOCS = Path(__file__).parent.parent / "docs"
PAGES = ("ipcb", "dbn-pf", "controllers")
FIGURES = {"dbn-pf-clouds": clouds_figure, "dbn-pf-belief": belief_figure, "ipcb-candidates": candidates_figure}
MARKED = re.compile(r"(<!-- parameters of (\S+) -->\n).*?(<!-- end -->)", re.DOTALL)


def main() -> None:
    """Write the pictures, then the tables between the marks of each page."""
    model = IntentionModel.load("us101-ngsim")
    target = DOCS / "img" / "methods"
    target.mkdir(parents=True, exist_ok=True)
    for name, make in FIGURES.items():
        with canvas.style():
            make(model).savefig(target / f"{name}.png", dpi=110, metadata={"Software": None})
    for page in PAGES:
        file = DOCS / "methods" / f"{page}.md"
        text = file.read_text(encoding="utf-8")
        filled = MARKED.sub(lambda mark: mark[1] + parameter_table(mark[2]) + mark[3], text)
        file.write_text(filled, encoding="utf-8")


def parameter_table(name: str) -> str:
    """The parameters of a component, what they mean (from the docstrings of its classes), and their defaults."""
    cls = estimators[name] if name in estimators else controllers[name]
    meanings: dict[str, str] = {}
    for base in reversed(cls.__mro__):
        meanings |= attributes(base.__doc__ or "")
    rows = [
        f"| `{name}.{field}` | {default} | {meanings[field]} |" for field, default in sorted(parameters(cls).items())
    ]
    return "\n".join(["| parameter | default | meaning |", "|---|---:|---|", *rows]) + "\n"


def attributes(docstring: str) -> dict[str, str]:
    """What a Google-style docstring says of each attribute."""
    listed = docstring.partition("Attributes:\n")[2]
    found: dict[str, str] = {}
    for entry in re.split(r"\n(?=        \w)", "\n" + listed.rstrip())[1:]:
        names, _, meaning = entry.partition(":")
        for field in names.split(","):
            found[field.strip()] = " ".join(meaning.split())
    return found


if __name__ == "__main__":
    main()
