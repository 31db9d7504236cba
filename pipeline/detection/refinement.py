"""A known line fitted to its whisker anew, in a frame of the scene."""

import numpy as np
from numba import njit

from pipeline.detection import line_fit, line_profile
from pipeline.detection.image_model import ImageModel
from pipeline.detection.line import Line
from pipeline.detection.tracing_options import TracingOptions


def refine(
    image, model: ImageModel, gain, line: Line, options: TracingOptions, workspace,
    farthest=np.inf, widths=False,
):  # fmt: skip
    """Gauss–Newton from the line's present nodes; base and tip found anew. In place.

    A line that is `farthest` [px] or more from them is not found. `widths`: for
    `new_lines.fit_width`.
    """
    fit = options.fit(model, line.longest, farthest, widths)
    line.n, line.quality = line_fit.refine(
        model.picture(image, gain), line.values, line.n, fit, workspace.room
    )


def refine_held(held, image, model: ImageModel, gain, line: Line, options, workspace) -> None:
    """`refine` one of the lines that are held in the background, before the others."""
    picture, fit = model.picture(image, gain), options.fit(model, line.longest)
    line.n, line.quality, shade = _refine_held(
        picture, line.values, line.n, *held.forget(line), fit, workspace.room
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
