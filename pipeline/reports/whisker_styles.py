"""A colour and dashes for every whisker, which distinguish it from all others.

Neighbours differ in colour; whiskers of one colour differ in their dashes.
"""

from typing import NamedTuple

import numpy as np

from pipeline.numerics.polyline import arc_along, places_along

# for the three kinds of colour vision (CIEDE2000 of any two: 24 or more; from the report's ground
# as well), found by search from the colours of Okabe & Ito 2008
DARKEST = "#222222"
COLOURS = ("#0a5fc7", "#c44e1a", "#009182", DARKEST, "#60adff")
DASHES = (  # lengths of stroke, gap, …, in points or pixels; (): a full line
    (), (7, 3), (2, 2.5), (9, 2.5, 2, 2.5), (15, 4), (9, 2.5, 2, 2.5, 2, 2.5), (2, 7),
    (15, 3, 6, 3),
)  # fmt: skip


class Style(NamedTuple):
    """How a whisker is drawn: `colour` "#rrggbb"; `dash` as in `DASHES`."""

    colour: str
    dash: tuple[float, ...]

    @property
    def line(self):
        """Line style for matplotlib."""
        return (0, self.dash) if self.dash else "-"


def style_of(number: int) -> Style:
    """The style of a whisker by its place among all, from 0; 40 differ."""
    dash = number // len(COLOURS) % len(DASHES)
    return Style(COLOURS[number % len(COLOURS)], DASHES[dash])


def whisker_styles(names) -> dict[str, Style]:
    """Name → style, for names in any order in which each may stand more than once."""
    return {name: style_of(number) for number, name in enumerate(dict.fromkeys(names))}


def pieces(points, dash) -> list[np.ndarray]:
    """The strokes of a dashed line, each (k, 2), for libraries that draw solid lines only.

    Parameters
    ----------
    points : (n, 2) of the line, in the unit of the dashes
    dash : as in `DASHES`
    """
    points = np.asarray(points, float)
    if not dash:
        return [points]
    along = arc_along(points)
    period = np.append(0, np.cumsum(dash))
    starts = np.arange(0, along[-1], period[-1])
    out = []
    for first, last in zip(period[:-1:2], period[1::2], strict=True):
        for start in starts[starts + first < along[-1]]:
            ends = start + first, min(start + last, along[-1])
            inside = along[(along > ends[0]) & (along < ends[1])]
            out.append(places_along(points, [ends[0], *inside, ends[1]]))
    return out
