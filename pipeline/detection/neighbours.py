"""Neighbouring lines in one fit: each is fitted beside the others until none of them moves."""

import numpy as np
from numba import njit

from pipeline.numerics.polyline import normals

MOST_ROUNDS = 8  # lines that lie upon each other take so many
STAYS_PX = 0.05  # a line that moves less leaves its neighbours where they are


def fit_together(lines, sharing, fit) -> None:
    """Fit lines that share pixels until none of them moves, in place.

    Each is fitted beside the others as they are by then, and again where one that shares its
    pixels has moved since.

    Parameters
    ----------
    lines : of one frame
    sharing : (lines, lines) bool, symmetric: which share pixels
    fit : function of a line's number: fit it beside the others, in place
    """
    moved = np.ones(len(lines), bool)
    for _ in range(MOST_ROUNDS):
        beside = np.flatnonzero((sharing & moved).any(axis=1))
        moved[:] = False
        for k in beside:
            line = lines[k]
            before = line.x[: line.n].copy(), line.y[: line.n].copy()
            fit(k)
            moved[k] = _moved(*before, line.x, line.y, line.n) > STAYS_PX
        if not moved.any():
            break


@njit(cache=True)
def _moved(x, y, new_x, new_y, n):
    """By how much a line (x, y) has moved across itself, root mean square [px]."""
    n = min(n, len(x))
    if n < 3:
        return 0.0
    nx, ny, total = np.empty(n), np.empty(n), 0.0
    normals(x, y, n, nx, ny)
    for i in range(n):
        total += (nx[i] * (new_x[i] - x[i]) + ny[i] * (new_y[i] - y[i])) ** 2
    return np.sqrt(total / n)
