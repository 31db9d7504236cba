"""Spread of values of which some are far off."""

import numpy as np
from scipy.stats import median_abs_deviation, norm

MAD_TO_SD = 1 / norm.ppf(0.75)  # of a normal distribution


def robust_sd(values, about=None, axis=None):
    """SD of normally distributed values, from the median of their deviations.

    Parameters
    ----------
    values : array
    about : what they deviate from; None: their median
    axis : along which the median is taken; None: over all values

    Examples
    --------
    >>> round(float(robust_sd([-1.0, 0.0, 1.0, 50.0], about=0.0)), 4)
    1.4826
    """
    if about is None:
        return median_abs_deviation(values, axis=axis, scale="normal")
    return MAD_TO_SD * np.median(np.abs(np.asarray(values) - about), axis=axis)
