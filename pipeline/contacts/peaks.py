"""The force of a contact, smoothed in time: the largest of noisy values overestimates the peak.

The force is a Gaussian process (Rasmussen & Williams 2006, eqs 2.23, 2.24, 2.30): a half-Gaussian
and a constant, each of any size, plus a smooth part, whose time scale is the likeliest of a few.
Neighbouring frames share errors, since the rest shape drifts and a codec repeats parts of a
picture. Free frames about the contact show how large these are, since their true force is zero.
One error they do not show: that of a whisker lying still on the same pixels. The peak of a
rendered contact is wrong by one frame's standard error, however many frames are averaged.
"""

import numpy as np
from scipy.linalg.lapack import dpotrf, dpotrs

from whiskermodel.force_profiles import half_gaussian_shape

AROUND, MOST = 30, 160  # free frames on both sides; frames of a contact about its largest force
SHARED, SHARED_FRAMES = 0.3, 40.0  # of the errors' variance, over so long: free frames of H.264
INTERPOLATED = 2.0  # times the error: frames that a codec made out of others
ANY_SIZE = 2.0  # of the largest force: SD of the half-Gaussian and the constant
BESIDE, TIMES = 0.45, (2.0, 4.0, 8.0, 16.0, 32.0)  # SD of what is smooth, and frames


def contact_course(force, error, free, interpolated, start, stop):
    """Force of a contact, frame by frame, also where it was not measured, and its standard error.

    Parameters
    ----------
    force, error : (frames,) of a whisker, and its standard error; NaN where not known
    free, interpolated : (frames,) bool, without contact; made by the codec out of others
    start, stop : the contact's frames, half-open

    Returns
    -------
    rows : the frames, all of the contact or MOST about its largest force
    course, its standard error : (rows,) NaN where nothing is known of the contact
    """
    known = np.where(np.isfinite(error[start:stop]), force[start:stop], np.nan)
    first, last = _about_largest(known, start)
    frame = np.arange(max(first - AROUND, 0), min(last + AROUND, len(force)))
    touching = (frame >= first) & (frame < last)
    seen = np.isfinite(force[frame] + error[frame]) & (touching | free[frame])
    if not seen[touching].any():
        return frame[touching], *np.full((2, last - first), np.nan)
    shown, rows = frame[seen], frame[touching]
    noise = _noise(shown, error[shown], interpolated[shown])
    known, noise = _given_free(force[shown], noise, ~touching[seen])
    seen = seen[touching]
    size = max(force[rows[seen]].max(), error[rows[seen]].min())
    fits = [_fitted(prior, known, noise, seen) for prior in _priors(rows, start, stop, size)]
    _, factor, prior = max(fits, key=lambda fit: fit[0])
    course, left = _posterior(factor, prior, known, seen)
    return rows, course, np.maximum(left, np.interp(rows, shown, error[shown]))


def _about_largest(force, start):
    """First frame and end of at most MOST frames of a contact that begins at `start`."""
    count = min(len(force), MOST)
    largest = np.nanargmax(force) if np.isfinite(force).any() else 0
    first = start + int(np.clip(largest - MOST // 2, 0, len(force) - count))
    return first, first + count


def _noise(frame, error, interpolated):
    """Covariance of the frames' errors."""
    apart = np.abs(frame[:, None] - frame)
    own = (1 - SHARED) * np.where(interpolated, INTERPOLATED, 1.0) ** 2
    return np.outer(error, error) * (SHARED * np.exp(-apart / SHARED_FRAMES) + np.diag(own))


def _given_free(force, noise, free):
    """Forces of a contact's frames, and their errors' covariance, given the `free` frames beside.

    There the force is zero, so that they show errors only.
    """
    shown, own = noise[free], noise[~free]
    alike = own[:, free]
    expected = _solved(_factor(shown[:, free]), np.column_stack([force[free], alike.T]))
    return force[~free] - alike @ expected[:, 0], own[:, ~free] - alike @ expected[:, 1:]


def _factor(covariance):
    """Cholesky factor, by LAPACK itself: checks of the arguments take longer than the factor."""
    factor, info = dpotrf(covariance, lower=1, clean=0, overwrite_a=1)
    if info:
        raise np.linalg.LinAlgError(f"no covariance: minor {info} is not positive")
    return factor


def _solved(factor, values):
    """The inverse of the covariance with this factor, times the values."""
    return dpotrs(factor, values, lower=1)[0] if len(values) else values


def _priors(frame, start, stop, size):
    """Covariances of the force in frames of a contact, in their order, one for each of TIMES."""
    shape = half_gaussian_shape(2 * (frame + 0.5 - start) / (stop - start) - 1)
    sizes = ANY_SIZE**2 * (1 + np.outer(shape, shape))
    apart = np.abs(frame[:, None] - frame)
    for time in TIMES:
        smooth = BESIDE**2 * np.exp(-0.5 * (np.arange(len(frame)) / time) ** 2)
        yield size**2 * (sizes + smooth[apart])


def _fitted(prior, force, noise, seen):
    """Log-likelihood of the forces that are seen, the factor of their covariance, the prior."""
    factor = _factor(prior[seen][:, seen] + noise)
    misfit = force @ _solved(factor, force)
    return -0.5 * misfit - np.log(np.diag(factor)).sum(), factor, prior


def _posterior(factor, prior, force, seen):
    """Course and its standard error given the forces that are seen."""
    shown = prior[:, seen]
    solved = _solved(factor, np.column_stack([force, shown.T]))
    left = np.diag(prior) - (shown * solved[:, 1:].T).sum(axis=1)
    return shown @ solved[:, 0], np.sqrt(np.maximum(left, 0.0))
