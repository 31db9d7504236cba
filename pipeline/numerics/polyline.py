"""Polylines of nodes about one pixel apart: arc length, normals, resampling, distances."""

import itertools

import numpy as np
from numba import njit

COARSE, FINE = 8, 2  # every how many-th node is looked at for whether lines come near each other
NOTHING = np.empty(0)
ROUNDING = 1e-6  # px, of distances
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


@njit(cache=True, error_model="numpy")
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


def arc_along(points) -> np.ndarray:
    """Length of a polyline (n, 2) from its first point to each of its points, (n,)."""
    return np.append(0.0, np.cumsum(np.hypot(*np.diff(points, axis=0).T)))


def places_along(points, at) -> np.ndarray:
    """Places (k, 2) at the arc lengths `at` (k,) along a polyline (n, 2)."""
    s = arc_along(points)
    return np.column_stack([np.interp(at, s, part) for part in np.transpose(points)])


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


@njit(cache=True, error_model="numpy")
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


@njit(cache=True)
def nearest_node(x, y, px, py):
    """Number of the node nearest to the point (px, py), and its distance."""
    best = 0
    least = np.inf
    for i in range(len(x)):
        d = (x[i] - px) ** 2 + (y[i] - py) ** 2
        if d < least:
            least = d
            best = i
    return best, np.sqrt(least)


@njit(cache=True)
def share_near(x, y, n, other_x, other_y, m, near, steps):
    """Share of a line's nodes within `near` px of another line.

    steps : every how many-th node of the one is looked at, and of the other
    """
    step, other_step = steps
    count, total = 0, 0
    if _apart(x, n, other_x, m, COARSE) >= near + COARSE:
        return 0.0  # nodes are 1 px apart
    if _apart(y, n, other_y, m, COARSE) >= near + COARSE:
        return 0.0
    spare, at = 0.0, 0  # px that no node can be near over; where on the other line the last was
    for i in range(0, n, step):
        total += 1
        if i > 0:
            spare -= np.hypot(x[i] - x[i - step], y[i] - y[i - step])
        if spare > 0:
            continue
        at, square = _first_near(other_x, other_y, m, other_step, at, x[i], y[i], near)
        count += square < near * near
        spare = np.sqrt(square) - near - ROUNDING
    return count / max(total, 1)


@njit(cache=True)
def _first_near(x, y, m, step, start, px, py, near):
    """The first node near a point, looked for from `start` on and round, and its squared distance.

    Where none is near, any node and the least squared distance.
    """
    least = np.inf
    for first, last in ((start, m), (0, start)):
        for j in range(first, last, step):
            dx, dy = px - x[j], py - y[j]
            square = dx * dx + dy * dy
            if square < near * near:
                return j, square
            least = min(least, square)
    return start, least


@njit(cache=True)
def nearest_nodes(x, y, n, other_x, other_y, m, near, skip):
    """Nodes at which two lines come nearest to each other; (−1, −1) where not within `near` px.

    The first `skip` nodes and the last one of the first line are left out.
    """
    best, at, to = near, -1, -1
    i = skip
    while i < n - 1:
        least = np.sqrt(_least_square(other_x, other_y, m, x[i], y[i]))
        if least < best:
            best, at = least, i
        i += max(int(least - best), 1)  # nodes are 1 px apart: none before comes nearer
    if at >= 0:
        to, _ = nearest_node(other_x[:m], other_y[:m], x[at], y[at])
    return at, to


@njit(cache=True, fastmath={"nnan", "nsz"}, error_model="numpy")  # the least in any order
def _least_square(x, y, n, px, py):
    """Square of the least distance from the first `n` nodes to the point (px, py)."""
    least = np.inf
    for i in range(n):
        dx, dy = x[i] - px, y[i] - py
        square = dx * dx + dy * dy
        least = square if square < least else least
    return least


@njit(cache=True)
def come_near(x1, y1, n1, x2, y2, n2, near):
    """Whether two lines may come within `near` px of each other; never wrong where they do."""
    step = COARSE
    reach = near + 1.1 * step  # of nodes 1 px apart, the nearest looked at is so far away
    if _apart(x1, n1, x2, n2, step) >= reach or _apart(y1, n1, y2, n2, step) >= reach:
        return False
    return _any_near(x1[:n1:step], y1[:n1:step], x2[:n2:step], y2[:n2:step], reach, step)


def near_pairs(lines, near, step=COARSE) -> np.ndarray:
    """Of lines with nodes `x`, `y` and their number `n`, which two may come near: bool, (n, n).

    All pairs that do are True, and some that are up to `step` nodes farther apart; no line is near
    to itself.
    """
    if len(lines) < 2:
        return np.zeros((len(lines), len(lines)), bool)
    return _near_pairs(*end_to_end(lines, step), near + 1.1 * step, step)


def end_to_end(lines, step):
    """Every `step`-th node x, y of lines, one after the other, and where each line begins.

    The last of these (lines + 1,) is the number of nodes.
    """
    x = [NOTHING, *(line.x[: line.n : step] for line in lines)]
    y = [NOTHING, *(line.y[: line.n : step] for line in lines)]
    starts = np.fromiter(itertools.accumulate(map(len, x)), np.int64, len(x))
    return np.concatenate(x), np.concatenate(y), starts


@njit(cache=True)
def _near_pairs(x, y, starts, reach, step):
    """`near_pairs` of every `step`-th node of lines, of each from its start to the next one's."""
    count = len(starts) - 1
    out = np.zeros((count, count), np.bool_)
    low, high = np.full((count, 2), np.inf), np.full((count, 2), -np.inf)
    for a in range(count):
        for i in range(starts[a], starts[a + 1]):
            low[a, 0], high[a, 0] = min(low[a, 0], x[i]), max(high[a, 0], x[i])
            low[a, 1], high[a, 1] = min(low[a, 1], y[i]), max(high[a, 1], y[i])
    for a in range(count):
        for b in range(a):
            apart = max(low[a, 0] - high[b, 0], low[b, 0] - high[a, 0])
            apart = max(apart, low[a, 1] - high[b, 1], low[b, 1] - high[a, 1])
            if apart < reach:
                ours, theirs = slice(starts[a], starts[a + 1]), slice(starts[b], starts[b + 1])
                near = _any_near(x[ours], y[ours], x[theirs], y[theirs], reach, step)
                out[a, b] = out[b, a] = near
    return out


@njit(cache=True)
def _any_near(x1, y1, x2, y2, reach, step):
    """Whether any of the first nodes, `step` px apart, is within `reach` of any second one."""
    i = 0
    while i < len(x1):
        apart = np.sqrt(_least_square(x2, y2, len(x2), x1[i], y1[i]))
        if apart < reach:
            return True
        i += max(int((apart - reach) / step), 1)  # none before comes nearer
    return False


@njit(cache=True)
def _apart(a, n, b, m, step):
    """Gap between the ranges of every `step`-th value; negative where they overlap."""
    low = a[:n:step].min() if n > 0 else np.inf
    high = a[:n:step].max() if n > 0 else -np.inf
    return max(b[:m:step].min() - high, low - b[:m:step].max()) if m > 0 else np.inf
