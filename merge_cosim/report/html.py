"""HTML pages without external parts: templates with embedded figures."""

from __future__ import annotations

import base64
import io
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any

import jinja2

from merge_cosim.core import colors

if TYPE_CHECKING:  # a report has no figure of matplotlib, whose import takes a fifth of its time
    from matplotlib.figure import Figure

DPI = 96
"""CSS pixels per inch."""


@dataclass(frozen=True)
class Picture:
    """A figure in a page.

    Attributes:
        uri: The picture itself.
        width: Its natural width [CSS pixels].
        caption: What it shows.
        wide: It takes the whole width, and scrolls on a phone.
    """

    uri: str
    width: int
    caption: str
    wide: bool = False

    @classmethod
    def of(cls, figure: Figure, caption: str, wide: bool = False) -> Picture:
        """Embed a figure."""
        return cls(data_uri(figure), round(DPI * figure.get_figwidth()), caption, wide)


def data_uri(figure: Figure) -> str:
    """The figure as SVG in a data URI, the same bytes for the same figure."""
    from merge_cosim.report.canvas import style

    buffer = io.BytesIO()
    with style():
        figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
    return "data:image/svg+xml;base64," + base64.b64encode(buffer.getvalue()).decode()


@cache
def _environment() -> jinja2.Environment:
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("merge_cosim.report"),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    environment.policies["json.dumps_kwargs"] = {"separators": (",", ":"), "allow_nan": False}
    return environment


def render(template: str, **values: Any) -> str:
    """Fill in one of the templates."""
    return _environment().get_template(template).render(values, colors=colors)
