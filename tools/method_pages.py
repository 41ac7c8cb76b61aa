"""Bring the pages of the methods up to date: python tools/method_pages.py [--data DIR] rewrites docs/methods/*.md.

The pages are written by hand but for their blocks `<!-- KIND: ARGUMENT -->` ... `<!-- end -->`, which this fills:
parameters of a component with their defaults (`parameters: estimator pgm`), and what held-out cars say of the densities
(`densities: surrogate`, or `densities: ngsim`, which is left as it is without --data). It also draws what the shipped
model learned, and what the estimators believe.
"""

import tempfile
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from blocks import DOCS, fill_page, page_parser, table

from merge_cosim.controllers.base import controllers
from merge_cosim.core.registry import Registry, meanings
from merge_cosim.core.registry import parameters as defaults
from merge_cosim.estimators.base import estimators

MODEL = "us101-ngsim"
REGISTRIES: dict[str, Registry] = {"estimator": estimators, "controller": controllers}


def parameters(argument: str) -> str:
    """The parameters of one component; `argument` is its role and name."""
    role, name = argument.split()
    cls = REGISTRIES[role][name]
    values = defaults(cls)
    rows = [
        [f"`{name}.{key}`", f"`{values[key]}`", meaning.replace("|", r"\|")] for key, meaning in meanings(cls).items()
    ]
    return table(["parameter", "default", "meaning"], rows, left=3) if rows else "No parameters.\n"


def densities(argument: str, data: Path | None = None, short: bool = False) -> str | None:
    """Losses of the densities on held-out cars; `argument` is the source.

    None, so that the block stays, without the real data, and in short mode for the surrogate, which takes a minute.
    """
    if data is None if argument == "ngsim" else short:
        return None
    from merge_cosim.studies.judging import DENSITIES
    from merge_cosim.studies.training import train

    with tempfile.TemporaryDirectory() as folder:
        report = train("us101", data, argument, "car", 0, Path(folder) / "model.json")
    rows = []
    for row in report["densities"]:
        losses = {name: row[name] for name in DENSITIES}
        best = min(loss for loss in losses.values()) if row["histogram"] is not None else None
        shown = ["-" if v is None else f"**{v:.2f}**" if v == best else f"{v:.2f}" for v in losses.values()]
        counts = [str(row["transitions"]), str(row["ruled_out"])]
        rows.append([row["speeds"], row["intention"], row["from_m_s"], *counts, *shown])
    about = (
        f"Trained on {report['train_pairs']} pairs of {report['train_cars']} cars, "
        f"tested on {report['test_pairs']} pairs of {report['test_cars']}.\n\n"
    )
    head = ["speeds", "intention", "V(t-1) [m/s]", "transitions", "ruled out by the histogram", *DENSITIES]
    return about + table(head, rows, left=2)


def draw(folder: Path) -> None:
    """Draw what the shipped model learned, and what the estimators believe, into a folder."""
    from merge_cosim.estimators.learned.model import IntentionModel
    from merge_cosim.report import belief_figures, canvas, model_figures

    model = IntentionModel.load(MODEL)
    folder.mkdir(parents=True, exist_ok=True)
    figures = {
        "transitions": model_figures.transition_figure,
        "arrivals": model_figures.arrival_figure,
        "gaussians": model_figures.gaussian_figure,
        "mixtures": model_figures.mixture_figure,
        "dbn-pf-clouds": belief_figures.clouds_figure,
        "dbn-pf-belief": belief_figures.belief_figure,
        "ipcb-candidates": belief_figures.candidates_figure,
    }
    for name, figure in figures.items():
        with canvas.style():
            figure(model).savefig(folder / f"{name}.png", dpi=110, metadata={"Software": None})


def main(argv: Sequence[str] | None = None) -> None:
    """Rewrite the pages and redraw the pictures."""
    parser = page_parser(__doc__)
    parser.add_argument("--data", type=Path, help="folder with real NGSIM files")
    given = parser.parse_args(argv)
    kinds = {"parameters": parameters, "densities": partial(densities, data=given.data, short=given.short)}
    for page in sorted((DOCS / "methods").glob("*.md")):
        fill_page(f"methods/{page.name}", given.docs, kinds)
    draw(given.docs / "img" / "methods")


if __name__ == "__main__":
    main()
