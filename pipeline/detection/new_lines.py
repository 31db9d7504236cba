"""A rough curve becomes a line: its centre, width, base and visible end, one after the other."""

import numpy as np
from numba import njit

from pipeline.detection import line_fit, line_profile
from pipeline.detection.line import Line, nodes_of, scratch_of
from pipeline.detection.line_fit import SHORT_STEP, largest
from pipeline.numerics import polyline

FEWEST_FITS, MOST_FITS = 4, 12  # of a new line: until it gets no longer
SAME_LENGTH = 2  # px
FIRST_ABSORBANCE = 0.5  # until it is measured
THINNEST_SIGMA, BROADEST_SIGMA = 0.6, 6.0  # px, of a line's half-width; broad ones move
SURE_GROWTH_SE, LEAST_GROWTH = 4.0, 0.05  # of the log of the half-width towards the tip


def initialise_line(picture, curve, fit: line_fit.Fit, workspace) -> Line:
    """Fit a line to a rough curve (n, 2): centre, width, base and visible end.

    picture : `Picture`
    """
    line = Line.empty(workspace.limit)
    n = min(len(curve), workspace.limit)
    line.x[:n], line.y[:n] = curve[:n].T
    line.n, line.quality = _initialise(picture, line.values, n, fit, workspace.room)
    return line


@njit(cache=True)
def _initialise(picture, values, n, fit, room):
    """Fit nodes until the line gets no longer; returns how many they are, and the quality."""
    nodes, scratch = nodes_of(values), scratch_of(room)
    n, quality = polyline.resample(nodes.x, nodes.y, n, scratch.room), 0.0
    amplitude = nodes.amplitude
    amplitude[:] = FIRST_ABSORBANCE
    for step in range(MOST_FITS):
        before = n
        n, quality = line_fit.refine(picture, values, n, fit, room)
        if n < line_fit.SHORTEST:
            break
        stays = abs(n - before) <= SAME_LENGTH
        if step >= FEWEST_FITS and stays and largest(scratch.offset, n) < SHORT_STEP:
            break
        fit_width(nodes.sigma, n, room)
        # no history to average with: the absorbance is what was measured last
        for i in range(n):
            amplitude[i] = max(scratch.amplitude[i], fit.faintest)
        amplitude[n:] = amplitude[n - 1]
    return n, quality


@njit(cache=True)
def fit_width(sigma, n, room):
    """Update the half-width σ of `n` nodes, linear in arc length, from their last measurement.

    Each half of the line has a width of its own. It grows towards the tip only where that is sure:
    a whisker that turns while the shutter is open is blurred the more the farther out.
    """
    scratch, middle = scratch_of(room), n // 2
    near, far = middle / 2, (middle + n) / 2
    near_sigma, near_se = _corrected(sigma[int(near)], scratch, 0, middle)
    far_sigma, far_se = _corrected(sigma[int(far)], scratch, middle, n)
    slope = (far_sigma - near_sigma) / max(far - near, 1.0)
    if np.log(far_sigma / near_sigma) < SURE_GROWTH_SE * np.hypot(near_se, far_se) + LEAST_GROWTH:
        slope = min(slope, 0.0)
    for i in range(len(sigma)):
        sigma[i] = min(max(near_sigma + slope * (i - near), THINNEST_SIGMA), BROADEST_SIGMA)


@njit(cache=True)
def _corrected(sigma, scratch, first, last):
    """Half-width σ [px] as it is measured over some nodes, and the standard error of its log."""
    change, se = line_profile.width_correction(scratch.sums, scratch.amplitude, first, last)
    corrected = sigma * np.exp(min(max(change, -0.3), 0.3))
    return min(max(corrected, THINNEST_SIGMA), BROADEST_SIGMA), se
