"""A known line fitted to its whisker anew, in another frame or beside other lines."""

from numba import njit

from pipeline.detection import line_fit, line_profile
from pipeline.detection.frame import Frame
from pipeline.detection.line import Line


def refine(frame: Frame, line: Line) -> None:
    """Gauss–Newton from the line's present nodes; base and tip found anew. In place."""
    fit = frame.options.fit(frame.model)
    line.n, line.quality = line_fit.refine(
        frame.picture, line.values, line.n, fit, frame.workspace.room
    )


def refine_held(frame: Frame, line: Line) -> None:
    """`refine` one of the lines that are held in the background, before the others."""
    held, fit = frame.model.held, frame.options.fit(frame.model)
    line.n, line.quality, shade = _refine_held(
        frame.picture, line.values, line.n, *held.forget(line), fit, frame.workspace.room
    )
    held.keep(line, shade)


@njit(cache=True)
def _refine_held(picture, values, n, pixels, passing, fit, room):
    """Take a line out of the background, fit it and put it in; its number, quality and shade."""
    line_profile.lighten(picture.background, pixels, passing)
    n, quality = line_fit.refine(picture, values, n, fit, room)
    x, y, amplitude, sigma = values[0], values[1], values[2], values[3]
    shade = line_profile.shade(picture.background, x, y, n, amplitude, sigma)
    return n, quality, shade
