"""Angles that go round."""

import numpy as np
from numba import njit


@njit(cache=True)
def wrapped(angle, turn=2 * np.pi):
    """The same angle between minus half a `turn` and half a turn [rad, or as the turn]."""
    return np.mod(angle + turn / 2, turn) - turn / 2
