"""The peak of a noisy time course: the largest of many noisy values overestimates it.

A course is smoothed by local parabolas (Savitzky and Golay 1964), weighted by the values' errors,
over as many frames as its own noise allows (Lepski's rule): wider, as long as nothing near the
top is moved by more than noise explains. So a brief peak stays as it is, and the peak of a long
plateau is no longer its noisiest frame. Where noise lifts the peak by less than 1 %, it is the
largest value, as in the table of frames.
"""

import numpy as np
from numba import njit

from pipeline.numerics.robust import MAD_TO_SD

HALF_WIDTHS = (2, 3, 4, 6, 8, 11, 15, 20)  # frames to both sides of a parabola's middle
PART = 6  # of a course, at least, for each half-width
NEAR_TOP = 0.8  # of the peak: what is lower does not decide
HIGH, FEWEST_HIGH = 0.5, 8  # of the peak, frames: where the noise is estimated
LEAST_LIFT = 0.01  # of the peak, by noise: less is left as it is
LARGEST_CHANGE = 4.0  # standard errors of a change that noise explains
FIRM_SD = 2.0  # standard errors: what is surely reached
SINGULAR = 1e-9  # of a parabola's normal equations


@njit(cache=True)
def half_width(values, errors):
    """Frames to both sides over which a course is to be smoothed; 0 for not at all.

    Parameters
    ----------
    values : (frames,), NaN where missing
    errors : (frames,) their standard errors, of which only the relative sizes matter: the size of
        the noise is estimated from the values
    """
    known = np.isfinite(values)
    if known.sum() < PART * HALF_WIDTHS[0]:
        return 0
    noise, values = _noise(values, _usable(values, errors)), np.where(known, values, 0.0)
    half = _widest(values, noise)
    course = _local(values, noise, half)[0]
    lifted = values[known].max() > (1 + LEAST_LIFT) * course[known].max()
    return half if lifted else 0


@njit(cache=True)
def smoothed(values, half, errors=None):
    """Local parabolas' values (frames,) over 2 `half` + 1 frames, as near to each as they lie.

    NaN where the value itself is missing; `errors` (frames,) weigh the values.
    """
    return _smoothed(values, half, _usable(values, errors))[0]


@njit(cache=True, error_model="numpy")
def firm_peak(values, half, errors):
    """Frame, value and standard error of a smoothed course's peak.

    The peak is where the value minus FIRM_SD errors is largest: poorly measured frames among
    well measured ones make no peak. `errors` (frames,) are taken to be common to neighbouring
    frames, so that smoothing does not lessen them; NaN where not known.
    """
    usable = _usable(values, errors)
    course, variance = _smoothed(values, half, usable)
    alike = _smoothed(values, half, np.where(np.isfinite(usable), 1.0, np.inf))[1]
    error = np.sqrt(variance / alike)
    least = course - FIRM_SD * error
    firm = least > 0
    judged = np.where(firm, least, np.nan) if firm.any() else course
    at = int(np.argmax(np.where(np.isfinite(judged), judged, -np.inf)))
    return at, course[at], error[at] if np.isfinite(errors[at]) else np.nan


@njit(cache=True)
def _smoothed(values, half, errors):
    """Smoothed course and its variance (frames,); NaN where the value is missing."""
    missing = ~np.isfinite(values)
    course, left = _local(np.where(missing, 0.0, values), errors, half)
    return np.where(missing, np.nan, course), np.where(missing, np.nan, left)


@njit(cache=True)
def _usable(values, errors):
    """Errors (frames,): infinite for missing values; all alike where one is not known."""
    known = np.isfinite(values)
    if errors is None or not np.all(errors[known] > 0):  # or unknown
        return np.where(known, 1.0, np.inf)
    return np.where(known, errors, np.inf)


@njit(cache=True)
def _widest(values, errors):
    """Largest half-width at which nothing near the top changes by more than noise explains."""
    best, tried = 0, [(values, errors**2)]
    known = np.isfinite(errors)
    for half in HALF_WIDTHS:
        if PART * half > known.sum():
            break
        wider, left = _local(values, errors, half)
        top = known & (wider > NEAR_TOP * wider[known].max())
        for narrower, more in tried:
            change, noise = np.abs(wider - narrower)[top], more[top] - left[top]
            if np.any(change > LARGEST_CHANGE * np.sqrt(np.maximum(noise, 0.0))):
                return best
        tried.append((wider, left))
        best = half
    return best


@njit(cache=True)
def _noise(values, errors):
    """Standard deviation of each value's noise near the top, as `errors` go; infinite alike."""
    known = np.isfinite(values)
    seen, error = values[known], errors[known]
    square = error**2
    variance = square[3:] + 9 * square[2:-1] + 9 * square[1:-2] + square[:-3]
    scatter = np.abs(np.diff(np.diff(np.diff(seen)))) / np.sqrt(variance)
    course = _local(seen, error, HALF_WIDTHS[0])[0][1:-2]
    high = course > HIGH * course.max()
    scatter = scatter[high] if high.sum() >= FEWEST_HIGH else scatter
    return np.maximum(MAD_TO_SD * np.median(scatter), 1e-12) * errors


@njit(cache=True)
def _local(values, errors, half):
    """Weighted local parabolas (frames,) and their variances; values as they are for `half` 0."""
    course, left = values.copy(), errors**2
    if half > 0:
        _fit_parabolas(values, 1 / errors**2, half, course, left)
    return course, left


@njit(cache=True)
def _fit_parabolas(values, weight, half, course, left):
    """Fill `course` and its variance where 2 half + 1 values about a frame make a parabola.

    At the ends these are the first and last ones.
    """
    n, width = len(values), 2 * half + 1
    largest = weight.max()
    for i in range(n if n >= width else 0):
        first = min(max(i - half, 0), n - width)
        s0, s1, s2, s3, s4, t0, t1, t2 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for j in range(first, first + width):
            x, w = (j - i) / half, weight[j] / largest
            s0, s1, s2, s3, s4 = s0 + w, s1 + w * x, s2 + w * x**2, s3 + w * x**3, s4 + w * x**4
            v = w * values[j]
            t0, t1, t2 = t0 + v, t1 + v * x, t2 + v * x**2
        a, b, c = s2 * s4 - s3 * s3, s2 * s3 - s1 * s4, s1 * s3 - s2 * s2
        determinant = s0 * a + s1 * b + s2 * c
        if determinant > SINGULAR * s0**3:
            course[i] = (a * t0 + b * t1 + c * t2) / determinant
            left[i] = a / determinant / largest
