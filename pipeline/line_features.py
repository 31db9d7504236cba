"""What tells one whisker's lines from another's, a few numbers per traced line."""

import numpy as np
from numba import njit

PLACE, ANGLE, THICKNESS, LENGTH, BEND, FAR_BEND = range(6)
N_FEATURES = 6
PIECE = 6  # nodes, the least that give a direction


def line_features(lines, ruler) -> np.ndarray:
    """Features of every row of `records.Centrelines`, float64 (rows, 6), NaN where not seen.

    Place along the face where the line points to behind the fur [px]; angle of the first
    `ruler.base_px` [rad, 0 outward, positive along the face]; logarithms of thickness and length
    [px]; turn from the first to the second half of that part, and from all of it to the next as
    long [rad].
    """
    return _features(lines.offsets, lines.x_px, lines.y_px, lines.thickness_px, ruler)


def sample_features(slot, ruler) -> dict[int, np.ndarray]:
    """Features (6,) of a roster's whisker (`roster.Slot`) in the frames where it was seen."""
    out = {}
    for frame, line in zip(slot.seen, slot.samples, strict=True):
        n = line.n
        ends = np.array([0, n])
        out[frame] = _features(ends, line.x[:n], line.y[:n], line.thickness[:n], ruler)[0]
    return out


def _features(offsets, x, y, thickness, ruler):
    out = np.full((len(offsets) - 1, N_FEATURES), np.nan)
    _fill(
        offsets, x, y, thickness,
        np.asarray(ruler.along, float), np.asarray(ruler.outward, float),
        float(ruler.pivot_px), int(ruler.base_px), out,
    )  # fmt: skip
    return out


@njit(cache=True)
def _fill(offsets, xs, ys, thickness, along, outward, pivot, base, out):
    for row in range(len(out)):
        first, last = offsets[row], offsets[row + 1]
        n = last - first
        if n < 2 * PIECE:
            continue
        x, y = xs[first:last], ys[first:last]
        b = min(n - 1, base)
        angle = _direction(x, y, 0, b, along, outward)
        px = x[0] - pivot * (np.sin(angle) * along[0] + np.cos(angle) * outward[0])
        py = y[0] - pivot * (np.sin(angle) * along[1] + np.cos(angle) * outward[1])
        out[row, PLACE] = px * along[0] + py * along[1]
        out[row, ANGLE] = angle
        t = thickness[first + min(10, n // 2) : first + max(n // 2, b)]
        t = t[~np.isnan(t)]
        if len(t):
            out[row, THICKNESS] = np.log(max(np.median(t), 0.02))
        out[row, LENGTH] = np.log(n)
        out[row, BEND] = _turn(x, y, 0, b // 2, b, along, outward)
        if n > 2 * base:
            out[row, FAR_BEND] = _turn(x, y, 0, base, 2 * base, along, outward)


@njit(cache=True)
def _direction(x, y, i, j, along, outward):
    """Direction from node i to node j [rad]."""
    dx, dy = x[j] - x[i], y[j] - y[i]
    return np.arctan2(dx * along[0] + dy * along[1], dx * outward[0] + dy * outward[1])


@njit(cache=True)
def _turn(x, y, i, j, k, along, outward):
    """Change of direction from the piece i … j to the piece j … k [rad]."""
    turn = _direction(x, y, j, k, along, outward) - _direction(x, y, i, j, along, outward)
    return np.arctan2(np.sin(turn), np.cos(turn))
