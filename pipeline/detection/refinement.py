"""A known line fitted to its whisker anew, in a frame of the scene."""

import numpy as np

from pipeline.detection import line_fit
from pipeline.detection.image_model import ImageModel
from pipeline.detection.line import Line
from pipeline.detection.tracing_options import TracingOptions


def refine(
    image, model: ImageModel, gain, line: Line, options: TracingOptions, workspace,
    farthest=np.inf, widths=False,
):  # fmt: skip
    """Gauss–Newton from the line's present nodes; base and tip found anew. In place.

    A line that is `farthest` [px] or more from them is not found. `widths`: for
    `settling.fit_width`.
    """
    fit = options.fit(model, line.longest, farthest, widths)
    line.n, line.quality = line_fit.refine(
        model.picture(image, gain), line.nodes, line.n, fit, workspace.scratch
    )


def refine_held(held, image, model: ImageModel, gain, line: Line, options, workspace) -> None:
    """`refine` one of the lines that are held in the background, before the others."""
    held.take_out(line)
    refine(image, model, gain, line, options, workspace)
    held.put_in(line)
