"""The peak of a noisy time course: the largest of many noisy values is too large by their noise.

A course is smoothed by local parabolas (Savitzky and Golay 1964), over as many frames as its own
noise allows (Lepski's rule): wider, as long as nothing near the top is moved by more than noise
explains. So a brief peak stays as it is, and a long plateau is no longer its noisiest frame.
Where noise lifts the peak by less than 1 %, it is the largest value, as in the table of frames.
"""

import numpy as np

HALF_WIDTHS = (2, 3, 4, 6, 8, 11, 15, 20)  # frames to both sides of a parabola's middle
PART = 6  # of a course, at least, for each half-width
NEAR_TOP = 0.8  # of the peak: what is lower does not decide
HIGH, FEWEST_HIGH = 0.5, 8  # of the peak, frames: where the noise is told from
LEAST_LIFT = 0.01  # of the peak, by noise: less is left as it is
LARGEST_CHANGE = 4.0  # standard errors of a change that noise explains
THIRD_DIFFERENCE = 1.4826 / np.sqrt(20)  # their median magnitude → SD of white noise


def half_width(values, errors) -> int:
    """Frames to both sides over which a course is to be smoothed; 0 for not at all.

    Parameters
    ----------
    values : (frames,), where NaN counts as what lies between its neighbours
    errors : (frames,) their standard errors, of which only the course matters: how large the
        noise is, the values tell
    """
    values, errors = _without_gaps(values), _without_gaps(errors)
    if len(values) < PART * HALF_WIDTHS[0]:
        return 0
    if not np.all(errors > 0):  # or unknown
        errors = np.ones(len(values))
    half = _widest(values, _noise(values, errors))
    lifted = values.max() > (1 + LEAST_LIFT) * _smoothed(values, half).max()
    return half if lifted else 0


def _widest(values, noise):
    """Largest half-width at which nothing near the top changes by more than noise explains."""
    best, tried = 0, [(values, 1.0)]
    for half in HALF_WIDTHS:
        if PART * half > len(values):
            break
        weights = _parabola(half)
        left = float(weights @ weights)  # of the noise's variance
        wider = _smoothed(values, half)
        inside = slice(half, len(values) - half)
        top = wider[inside] > NEAR_TOP * wider.max()
        for narrower, more in tried:
            change = (np.abs(wider - narrower) / noise)[inside][top]
            if len(change) and change.max() > LARGEST_CHANGE * np.sqrt(more - left):
                return best
        tried.append((wider, left))
        best = half
    return best


def _noise(values, errors):
    """Standard deviation of each value's noise near the top, as `errors` go."""
    scatter = np.abs(np.diff(values, 3)) / (0.5 * (errors[1:-2] + errors[2:-1]))
    course = _smoothed(values, HALF_WIDTHS[0])
    high = course[1:-2] > HIGH * course.max()
    scatter = scatter[high] if high.sum() >= FEWEST_HIGH else scatter
    return np.maximum(THIRD_DIFFERENCE * np.median(scatter), 1e-12) * errors


def smoothed(values, half: int) -> np.ndarray:
    """Local parabolas' values (frames,) over ±`half` frames, narrower ones near the ends.

    NaN where the value itself is missing.
    """
    values = np.asarray(values, float)
    return np.where(np.isfinite(values), _smoothed(_without_gaps(values), half), np.nan)


def _smoothed(values, half):
    out = values.copy()
    for each in (h for h in HALF_WIDTHS if h <= half):
        out[each : len(values) - each] = np.convolve(values, _parabola(each), "valid")
    return out


def _parabola(half):
    """Weights of the middle value of a least-squares parabola over 2 `half` + 1 values."""
    x = np.arange(-half, half + 1.0)
    n, second, fourth = len(x), (x**2).sum(), (x**4).sum()
    return (fourth - second * x**2) / (n * fourth - second**2)


def _without_gaps(values):
    values = np.asarray(values, float)
    known = np.isfinite(values)
    if known.all() or not known.any():
        return values
    return np.interp(np.arange(len(values)), np.flatnonzero(known), values[known])
