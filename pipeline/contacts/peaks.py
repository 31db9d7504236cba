"""The course of a touch's force: the largest of many noisy frames overestimates its peak.

A Gaussian process (Rasmussen & Williams 2006, eqs 2.23, 2.24, 2.30): a touch is a half-Gaussian
and a constant, each of any size, and what is smooth beside them, over the likeliest of some
times. Frames err together, as the rest shape drifts and as a codec leaves pictures as they were:
the force of the free frames about a touch, where it is zero, shows by how much.
"""

import numpy as np

from whiskermodel.force_profiles import half_gaussian_shape

MOST = 160  # frames of a touch, about its largest force
SHARED, SHARED_FRAMES = 0.3, 40  # of the errors' variance, over so long: free frames of H.264
INTERPOLATED = 2.0  # times the error: frames that a codec made out of others
ANY_SIZE = 4.0  # of the usual force: SD of the half-Gaussian and the constant
BESIDE, TIMES = 0.45, (2.0, 4.0, 8.0, 16.0, 32.0)  # SD of what is smooth, and frames


def touch_course(force, error, free, interpolated, start, stop):
    """Force of a touch, frame by frame, also where it was not measured, and its standard error.

    Parameters
    ----------
    force, error : (frames,) of a whisker, and its standard error; NaN where not known
    free, interpolated : (frames,) bool, without touch; made by the codec out of others
    start, stop : the touch's frames, half-open

    Returns
    -------
    rows : the frames, all of the touch or MOST about its largest force
    course, its standard error : (rows,) NaN where nothing is known of the touch
    """
    force = np.where(error > 0, force, np.nan)
    first, last = _about_largest(force, start, stop)
    rows = np.arange(first, last)
    seen = np.isfinite(force[rows])
    if not seen.any():
        return rows, *np.full((2, len(rows)), np.nan)
    around = np.r_[max(first - SHARED_FRAMES, 0) : first, last : last + SHARED_FRAMES]
    around = around[around < len(force)]
    around = around[free[around] & np.isfinite(force[around])]
    off, noise = _error_beside(rows[seen], around, force, error, interpolated)
    own = force[rows[seen]] - off
    size = np.sqrt(np.average(own**2, weights=error[rows[seen]] ** -2.0))
    priors = _priors(rows, start, stop, size)
    prior = max(priors, key=lambda each: _likelihood(each[np.ix_(seen, seen)] + noise, own))
    gain = np.linalg.solve(prior[np.ix_(seen, seen)] + noise, prior[seen])
    left = np.diag(prior) - (prior[seen] * gain).sum(axis=0)
    return rows, own @ gain, np.sqrt(np.maximum(left, 0.0))


def _about_largest(force, start, stop):
    """First frame and end of at most MOST frames of a touch."""
    if stop - start <= MOST or not np.isfinite(force[start:stop]).any():
        return start, min(stop, start + MOST)
    middle = start + int(np.nanargmax(force[start:stop]))
    first = min(max(middle - MOST // 2, start), stop - MOST)
    return first, first + MOST


def _error_beside(rows, around, force, error, interpolated):
    """Expected error of a touch's `rows` and its covariance, given the free frames `around`."""
    both, n = np.concatenate([rows, around]), len(rows)
    noise = _noise(both, error[both], interpolated[both])
    share = np.linalg.solve(noise[n:, n:], noise[n:, :n])
    return force[around] @ share, noise[:n, :n] - noise[:n, n:] @ share


def _noise(frame, error, interpolated):
    """Covariance of the frames' errors."""
    apart = np.abs(frame[:, None] - frame)
    own = (1 - SHARED) * np.where(interpolated, INTERPOLATED, 1.0) ** 2
    return np.outer(error, error) * (SHARED * np.exp(-apart / SHARED_FRAMES) + np.diag(own))


def _priors(rows, start, stop, size):
    """Covariances of a touch's force in its `rows`, one for each of TIMES."""
    shape = half_gaussian_shape(2 * (rows + 0.5 - start) / (stop - start) - 1)
    apart = rows[:, None] - rows
    for time in TIMES:
        smooth = BESIDE**2 * np.exp(-0.5 * (apart / time) ** 2)
        yield size**2 * (ANY_SIZE**2 * (1 + np.outer(shape, shape)) + smooth)


def _likelihood(cov, force):
    """Logarithm of the density of `force` of mean zero, but for a constant."""
    return -0.5 * (force @ np.linalg.solve(cov, force) + np.linalg.slogdet(cov)[1])
