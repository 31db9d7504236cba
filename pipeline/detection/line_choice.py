"""Which lines are whiskers, and which are ghosts or doubles of others, or turned round."""

import numpy as np
from numba import njit

from pipeline.detection import line_fit, new_lines
from pipeline.detection.line import Line
from pipeline.numerics import polyline

GHOST_SHARE = 0.75  # of a ghost that lies beside the darker line; what leaves it is a whisker


def is_ghost(line: Line, others, params) -> bool:
    """Whether a line is what is left of a darker one: its blur, or the codec's ringing beside it.

    The fainter it is, the farther from the darker one. A faint whisker that comes out of the fur
    beside a dark one, and leaves it, is no ghost.
    """
    ghosts = (params.blur_share, params.blur_px), (params.ringing_share, params.ringing_px)
    return any(_is_ghost_of(line, other, ghosts) for other in others)


def ghost_reach(params) -> float:
    """Distance beyond which no line is a ghost of another one [px]."""
    return max(params.blur_px, params.ringing_px, 2.0 * new_lines.BROADEST_SIGMA)


def _is_ghost_of(line, other, ghosts):
    darker = _median_of(line.amplitude, line.n) / _median_of(other.amplitude, line.n)
    near = [near_px for share, near_px in ghosts if darker < share]
    if not near or not polyline.come_near(
        line.x, line.y, line.n, other.x, other.y, other.n, max(near[-1], reach(other))
    ):
        return False
    return shared_fraction(line, other, max(near[-1], reach(other))) > GHOST_SHARE


@njit(cache=True)
def _median_of(values, n):
    """Median of the first `n` values, by half of them: enough for a comparison."""
    return np.median(values[0:n:2])


def is_whisker(line: Line, model, options) -> bool:
    """Whether a line is long and clear and leaves the face."""
    clear = line.quality > options.params.detection.least_quality
    long_and_clear = line.n >= options.shortest_px and clear
    return long_and_clear and line_fit.is_clear(line.x, line.y, line.n, model.off_edges)


def is_turned(line: Line, outward, factor) -> bool:
    """Whether a line between face and body is turned round: its near half is the thinner one.

    A line in front of a body hardly tapers. The more a line runs straight off the face's side, in
    direction `outward`, the more its halves must differ, by `factor` at most; and the less, where
    it runs towards that side.
    """
    thickness = line.thickness[: line.n]
    near, far = thickness[: line.n // 2], thickness[line.n // 2 :]
    x, y = line.x[line.n - 1] - line.x[0], line.y[line.n - 1] - line.y[0]
    along = (x * outward[0] + y * outward[1]) / max(np.hypot(x, y), 1e-9)
    return line.n > 0 and _median_of_known(far) > factor**along * _median_of_known(near)


@njit(cache=True)
def _median_of_known(values):
    known = values[np.isfinite(values)]
    return np.median(known) if len(known) else 0.0


def ends_at_face(line: Line, model, options) -> bool:
    """Whether a line's far end, too, is as near to the face or the body as a base may be."""
    column, row = round(line.x[line.n - 1]), round(line.y[line.n - 1])
    height, width = model.outside.shape
    inside = 0 <= column < width and 0 <= row < height
    return inside and model.outside[row, column] < options.base_gap_px


def contrast_length(line: Line) -> float:
    """Absorbance summed along the line: long dark whiskers come first [px]."""
    return float(line.amplitude[: line.n].sum())


def usual_strength(lines) -> float:
    """Length × absorbance of a whisker's lines [px]; 0 where it was never seen."""
    return float(np.median([contrast_length(line) for line in lines] or [0.0]))


def reach(line) -> float:
    """How far a line's darkness reaches to either side [px]."""
    return max(3.0, 2.0 * float(line.sigma[line.n // 2]))


def without_doubles(lines: list[Line], near_px: float = 3.0) -> list[Line]:
    """Drop every line that runs along a better one (within `near_px`) for half of its length."""
    kept: list[Line] = []
    for line in lines:
        if not any(shared_fraction(line, other, near_px) > 0.5 for other in kept):
            kept.append(line)
    return kept


def shared_fraction(line: Line, other: Line, near_px: float = 3.0) -> float:
    """Fraction of `line`'s nodes within `near_px` of `other`."""
    lines = line.x, line.y, line.n, other.x, other.y, other.n
    return polyline.share_near(*lines, near_px, (3, 2))
