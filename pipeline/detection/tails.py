"""Where whiskers cross, a line must not leave its whisker for the other one's far part."""

import numpy as np
from numba import njit

LEAST = 10  # nodes on another line, up to the end, before a line is suspected
NEAR_PX = 1.6
STRAY_PX = 2.5  # so far from where the tail should be, it is another whisker's
FIT = 40  # nodes that give the direction in which a tail goes on


@njit(cache=True)
def shared_tail(x, y, n, other_x, other_y, m):
    """First node from which all up to the end lie on another line; n where none do."""
    start = n
    for i in range(n - 1, -1, -1):
        least = np.inf
        j = 0
        while j < m:
            d = np.sqrt((x[i] - other_x[j]) ** 2 + (y[i] - other_y[j]) ** 2)
            least = min(least, d)
            j += max(int(d - NEAR_PX), 1)  # nodes are 1 px apart: none before can be near
        if least > NEAR_PX:
            break
        start = i
    return start


@njit(cache=True)
def regrow(x, y, n, start, known_x, known_y, m):
    """Put the known line's tail, turned and shifted, in the place of nodes start … n − 1.

    The known line is the same whisker a frame before. Nothing is changed where the present
    tail is where that one would be. Returns the new number of nodes, or −1 for no change.
    """
    start = min(start, m - 1)
    fit = min(FIT, start)
    if fit < 10:
        return -1
    ux, uy = x[start] - x[start - fit], y[start] - y[start - fit]
    vx, vy = known_x[start] - known_x[start - fit], known_y[start] - known_y[start - fit]
    norm = max(np.sqrt((ux * ux + uy * uy) * (vx * vx + vy * vy)), 1e-9)
    cos, sin = (ux * vx + uy * vy) / norm, (vx * uy - vy * ux) / norm
    strayed = n - m >= LEAST
    tail_x, tail_y = np.empty(m - start), np.empty(m - start)
    for i in range(start, m):
        dx, dy = known_x[i] - known_x[start], known_y[i] - known_y[start]
        tail_x[i - start] = x[start] + cos * dx - sin * dy
        tail_y[i - start] = y[start] + sin * dx + cos * dy
        if i < n:
            off = np.hypot(x[i] - tail_x[i - start], y[i] - tail_y[i - start])
            strayed = strayed or off > STRAY_PX
    if not strayed:
        return -1
    x[start:m] = tail_x
    y[start:m] = tail_y
    return m
