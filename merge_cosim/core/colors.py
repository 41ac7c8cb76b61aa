"""Every colour that the project draws with: those of Okabe and Ito (2008), some of Tol's (2021), and greys.

Both palettes were chosen so that their colours stay apart under the common kinds of colour blindness. What must be
distinguished without colour is also hatched, dashed, marked by a shape or named.
"""

BLUE, SKY, GREEN, ORANGE = "#0072B2", "#56B4E9", "#009E73", "#E69F00"
YELLOW, VERMILION, PURPLE, BLACK = "#F0E442", "#D55E00", "#CC79A7", "#000000"
"""Okabe and Ito."""
INDIGO, WINE, BROWN, OLIVE = "#332288", "#882255", "#661100", "#999933"
"""Tol's 'muted'; the brown is of its older version with twelve colours."""
INK, GREY, SILVER, PALE, FAINT = "#111111", "#6b6b6b", "#a3a3a3", "#d0d0d0", "#e4e4e4"
"""Texts, then ever lighter lines and areas."""

HOST, MERGING, OTHER, RELEASED = BLUE, VERMILION, SILVER, YELLOW
"""The cars, in SUMO's window and in every picture from above; released ones are logged cars that SUMO drives."""
FOLLOWS = SKY
"""A host that follows its merging car, in SUMO's window."""
ROAD = PALE
MAIN_ROAD, ON_RAMP = "#9ecae1", "#fdae6b"
"""The roads of a ramp's picture, in lighter tones of the cars that come by them."""
YIELDS, DOES_NOT_YIELD, IGNORES = BLUE, VERMILION, SILVER
"""Intentions and maneuvers of a merging driver."""
DISTINCT = (BLUE, ORANGE, SKY, VERMILION, GREEN, PURPLE, INDIGO, WINE, BROWN)
"""Colours of what has none of its own, in turn."""
FAILED = "#c1121f"
"""Failures that no method's colour marks."""

Rgba = tuple[int, int, int, int]
"""Red, green, blue and opacity, 0 to 255."""


def rgba(color: str) -> Rgba:
    """An opaque colour, given as `#rrggbb`, as four numbers from 0 to 255."""
    red, green, blue = bytes.fromhex(color.removeprefix("#"))
    return red, green, blue, 255
