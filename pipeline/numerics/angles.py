"""Angles modulo a turn, and how steady they are."""

import numpy as np
from numba import njit

from pipeline.numerics.robust import robust_sd
from pipeline.numerics.runs import differences


@njit(cache=True)
def wrap_angle(angle):
    """The same angle between −π and π [rad]."""
    return np.mod(angle + np.pi, 2 * np.pi) - np.pi


def continuous(angle) -> np.ndarray:
    """Add full turns so that each angle [rad] is within half a turn of the last known one.

    After a gap, too. NaN stays; the median is within half a turn of zero.
    """
    angle = np.array(angle, float)
    known = np.isfinite(angle)
    if known.any():
        path = np.unwrap(angle[known])
        angle[known] = path - 2 * np.pi * np.round(np.median(path) / (2 * np.pi))
    return angle


def jitter(angle, frame) -> float:
    """Robust SD of an angle's error in one frame, as second differences show it; NaN without any.

    The second difference of independent errors has six times their variance. Motion that is
    fast beside the frames is in it, too.
    """
    change = differences(angle, frame, 2)
    return float(robust_sd(change, about=0.0) / np.sqrt(6))
