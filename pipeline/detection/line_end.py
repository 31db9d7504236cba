"""Thickness of a whisker about the end of its trace, and beyond it, where a frame shows nothing.

One frame's values drown in its noise; `kinematics/tip.py` averages those of many.
"""

import numpy as np
from numba import njit

from pipeline.detection import cross_sections, line_fit, line_profile

INSIDE, BEYOND = 60, 60  # nodes before and after the end of a trace, measured in pairs
DIRECTION_NODES = 40  # the last ones, which the line goes on from
WIDER = 3.0  # times the line's half-width: it may not go on exactly where it is thought to
REACH = 2.0  # of the sections, in that half-width
UNKNOWN = 100.0  # standard error of an absorbance of which nothing is seen
PLACES_PX = np.arange(1.5 - INSIDE, BEYOND + 1, 2.0)  # of the pairs, from the last node


@njit(cache=True)
def end_thickness(picture, values, n):
    """Absorbance summed across a line of `n` nodes at the PLACES_PX, NaN where not seen.

    In px, but for a factor: the profile that is fitted is broader than the line's. The factor is
    the same all along the line.

    picture : of `ImageModel`; values : of a `Line`
    """
    out = np.full((INSIDE + BEYOND) // 2, np.nan, np.float32)
    m = INSIDE + BEYOND
    x, y, cap, sigma = np.empty(m), np.empty(m), np.ones(m), np.empty(m)
    inside = min(n, INSIDE)
    x[:inside], y[:inside] = values[0, n - inside : n], values[1, n - inside : n]
    sigma[:] = WIDER * values[3, n - 1]
    end = line_fit.extend(x, y, inside, False, BEYOND, DIRECTION_NODES)
    sums = np.zeros((line_profile.N_SUMS, m))
    p = picture
    cross_sections.accumulate(
        p.image, p.background, p.weight, p.gain, x, y, end, cap, sigma, REACH, False, sums
    )
    absorbed, baseline, misfit, error = np.zeros(m), np.zeros(m), np.ones(m), np.full(m, 1e3)
    line_profile.window_amplitudes(sums, end, 0, absorbed, baseline, error, misfit)
    for k in range(len(out)):
        i = 2 * k - (INSIDE - inside)
        total, weight = 0.0, 0.0
        for j in (i, i + 1):
            if 0 <= j < end and error[j] < UNKNOWN:
                total += absorbed[j]
                weight += 1.0
        if weight > 0:
            out[k] = sigma[0] * line_profile.BELL_AREA * total / weight
    return out
