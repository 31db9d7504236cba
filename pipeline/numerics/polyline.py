"""Polylines of nodes about one pixel apart: arc length, normals, resampling."""

import numpy as np
from numba import njit

from pipeline.numerics.bsplines import FAST

NARROWEST = 1e-18  # px²: keeps two coinciding nodes from dividing by zero


@njit(cache=True, error_model="numpy")
def resample(x, y, n, spare):
    """Space the nodes of a polyline evenly, 1 px of arc length apart, in place; return count."""
    s = np.empty(n)
    arc_lengths(x, y, n, s)
    count = min(int(s[n - 1] + 1e-9) + 1, spare.shape[1])
    new_x, new_y = spare[0], spare[1]
    i, one, last = np.uint64(0), np.uint64(1), np.uint64(max(n - 2, 0))
    for k in range(1, count):
        while s[i + one] < k and i < last:
            i += one
        part = (k - s[i]) / (s[i + one] - s[i])
        new_x[k] = x[i] + part * (x[i + one] - x[i])
        new_y[k] = y[i] + part * (y[i + one] - y[i])
    for k in range(1, count):
        x[k], y[k] = new_x[k], new_y[k]
    return count


@njit(cache=True, fastmath=FAST, error_model="numpy")
def arc_lengths(x, y, n, s):
    """Length of a polyline from its first node to each of its first `n`, into `s` [px]."""
    steps, before_x, before_y, after_x, after_y = s[1:n], x[: n - 1], y[: n - 1], x[1:n], y[1:n]
    for i in range(n - 1):
        dx, dy = after_x[i] - before_x[i], after_y[i] - before_y[i]
        steps[i] = np.sqrt(dx * dx + dy * dy)
    s[0] = 0.0
    total = 0.0
    for i in range(n - 1):
        total += steps[i]
        steps[i] = total


@njit(cache=True)
def bilinear(image, x, y):
    """Value of a 2-D array at (x, y); the nearest edge value outside."""
    height, width = image.shape
    x = min(max(x, 0.0), width - 1.001)
    y = min(max(y, 0.0), height - 1.001)
    column = int(x)
    row = int(y)
    fx = x - column
    fy = y - row
    return (
        image[row, column] * (1 - fx) * (1 - fy)
        + image[row, column + 1] * fx * (1 - fy)
        + image[row + 1, column] * (1 - fx) * fy
        + image[row + 1, column + 1] * fx * fy
    )


@njit(cache=True, fastmath=FAST, error_model="numpy")
def normals(x, y, n, nx, ny):
    """Unit normals, the tangent turned counter-clockwise on the screen: (ty, −tx)."""
    last = n - 1
    nx[0], ny[0] = y[1] - y[0], x[0] - x[1]
    nx[last], ny[last] = y[last] - y[last - 1], x[last - 1] - x[last]
    before_x, before_y, after_x, after_y = x[: n - 2], y[: n - 2], x[2:n], y[2:n]
    inner_x, inner_y = nx[1:last], ny[1:last]
    for i in range(n - 2):
        inner_x[i], inner_y[i] = after_y[i] - before_y[i], before_x[i] - after_x[i]
    for i in range(n):
        shrink = 1.0 / np.sqrt(nx[i] * nx[i] + ny[i] * ny[i] + NARROWEST)
        nx[i] *= shrink
        ny[i] *= shrink
