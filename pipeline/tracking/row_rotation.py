"""The turn that all whiskers of a face make together from one frame to the next.

In fast whisking, whiskers move farther from frame to frame than they stand apart: one that is
looked for by itself is taken for its neighbour. All together, they fit at one turn only.
"""

import math

import numpy as np
from numba import njit

from pipeline.numerics.angles import wrap_angle
from pipeline.numerics.robust import median, robust_sd

TURNS = np.radians(np.arange(-16.0, 16.5, 1.0))
SLOPES = np.radians(np.arange(-6.0, 6.5, 1.5))  # half of how much more the last one turns
OWN_SD = np.radians(1.5)  # of a line about the row
OWN_WEIGHT = 4.0  # of its score
FEWEST_TOGETHER = 3  # whiskers needed to estimate a common turn
EVEN = 0.3  # squares of places: weight of no difference along the face
LEAST_OFF = np.radians(0.5)  # from the turns of the others
AHEAD = 24  # nodes from the base that give its direction
FIRST, STEP = 12, 3  # of the nodes that are looked at, and how many on to the next
LIKELY_SD = np.radians(6.0)  # of the common turn about that of the motion before
SLOPE_SD = np.radians(3.0)
FLOAT = np.float32


def common_turns(picture, lines, pivot=0.0) -> np.ndarray:
    """Turns [rad, from +x to +y] about their pivots at which all predicted lines fit best.

    The turn is a linear function of the lines' directions; each line may deviate a little from it.

    Parameters
    ----------
    picture : the frame, as in `ImageModel.picture`
    lines : `detection.Line`s as they are predicted
    pivot : how far behind their bases they turn [px]
    """
    turns = np.cos(TURNS), np.sin(TURNS)
    pivots = np.array([_behind(line.x, line.y, line.n, pivot) for line in lines])
    inner = [line.values[:3, FIRST : line.n : STEP] for line in lines]  # x, y, amplitude
    starts = np.cumsum([0, *(nodes.shape[1] for nodes in inner)])
    # all lines have the same weight, however dark they are
    fit, shown = _scores(picture, np.concatenate(inner, axis=1), starts, pivots, turns)
    return _own_turns(shown, _most_likely(fit / len(lines), places(lines)))


def places(lines) -> np.ndarray:
    """Where the lines stand between the outermost ones, by direction, −1 to 1."""
    angle = np.array([direction(line) for line in lines])
    ahead = np.arctan2(np.sin(angle).sum(), np.cos(angle).sum())
    angle = wrap_angle(angle - ahead)
    return 2 * (angle - angle.min()) / max(np.ptp(angle), 1e-9) - 1


def direction(line, most=np.inf) -> float:
    """Direction from a line's base to its middle [rad, from +x to +y], as if `most` nodes long."""
    k = int(min(line.n, most)) // 2
    return math.atan2(line.y[k] - line.y[0], line.x[k] - line.x[0])


def turned(line, before) -> float:
    """Angle of a line less that of another one [rad, from +x to +y]."""
    now, then = direction(line, before.n), direction(before, line.n)
    return math.remainder(now - then, math.tau)


def bent(line, before) -> float:
    """Bend of a line, from its near to its far half, less that of another one [rad]."""
    n = min(line.n, before.n)
    return math.remainder(_bend(line, n) - _bend(before, n), math.tau)


def _bend(line, n) -> float:
    """Angle from the near half of a line's first `n` nodes to the far one [rad]."""
    x, y, k = line.x, line.y, n // 2
    near = math.atan2(y[k] - y[0], x[k] - x[0])
    return math.atan2(y[n - 1] - y[k], x[n - 1] - x[k]) - near


def even_turns(place, turn) -> np.ndarray:
    """Turns of all lines at their places, as of a straight line through those that are known.

    place, turn : (lines,) places as in `places`, turns [rad], NaN where not known; those far off
        the others are left out
    """
    known = np.isfinite(turn)
    # an outlier at the end of the row would tilt a straight line through all, but moves no median
    even = np.full(len(turn), median(turn[known]) if known.any() else 0.0)
    if known.sum() < FEWEST_TOGETHER:
        return even
    keep = np.zeros(len(turn), bool)
    for _ in range(5):
        off = np.abs(turn - even)
        again = known & (off < max(2.5 * robust_sd(off[known], about=0.0), LEAST_OFF))
        if again.sum() < FEWEST_TOGETHER or (again == keep).all():
            break
        keep = again
        middle, mean = place[keep].mean(), turn[keep].mean()
        u, v = place[keep] - middle, turn[keep] - mean
        slope = u @ v / (u @ u + EVEN)
        even = mean + slope * (place - middle)
    return even


def _most_likely(scores, place) -> np.ndarray:
    """Turn of every line for the mean turn and slope of the highest sum of scores."""
    total = _sums(scores, place) - 0.02 * (TURNS / LIKELY_SD) ** 2
    value = total.max(axis=1) - 0.02 * (SLOPES / SLOPE_SD) ** 2
    best = int(np.argmax(value))
    return _peak(total[best], np.argmax(total[best])) + SLOPES[best] * place


@njit(cache=True)
def _sums(scores, place):
    """Sums over the lines (lines, turns) at every slope and mean turn, (slopes, turns)."""
    count, last = len(TURNS), len(TURNS) - 1
    out = np.zeros((len(SLOPES), count))
    for s in range(len(SLOPES)):
        for j in range(len(place)):
            shift = SLOPES[s] * place[j] / (TURNS[1] - TURNS[0])
            for k in range(count):
                at = min(max(k + shift, 0.0), float(last))
                low = min(int(at), last - 1)
                out[s, k] += scores[j, low] + (at - low) * (scores[j, low + 1] - scores[j, low])
    return out


@njit(cache=True)
def _own_turns(scores, row):
    """Turn of every line by its own score, not far from that of the row."""
    turns = np.empty(len(row))
    for j in range(len(row)):
        off = (TURNS - row[j]) / OWN_SD
        score = OWN_WEIGHT * scores[j] - 0.5 * off**2
        turns[j] = _peak(score, np.argmax(score))
    return turns


@njit(cache=True)
def _peak(score, k):
    """Turn of the highest score, between the turns tried."""
    if not 0 < k < len(score) - 1:
        return TURNS[k]
    a, b, c = score[k - 1], score[k], score[k + 1]
    shift = 0.5 * (a - c) / min(a - 2 * b + c, -1e-12)
    return TURNS[k] + shift * (TURNS[1] - TURNS[0])


@njit(cache=True, error_model="numpy")
def _scores(picture, nodes, starts, pivots, turns):
    """Fit of turned lines and how much of them is shown, as in `_add_scores`, (lines, turns) each.

    Both are 1 where a line looks as it did before.

    nodes : x, y [px] and amplitude of some nodes (3, nodes), of each line from its start to the
    next one's; pivots : x, y [px] (lines, 2); turns : cosines and sines

    Of the pixel nearest to a node: one turn moves it by more. All turns of a node are taken
    together, so that vector instructions run along them.
    """
    p, shape = picture, picture.image.shape
    flat = p.image.ravel(), p.background.ravel(), p.weight.ravel()
    cosines, sines = turns[0].astype(FLOAT), turns[1].astype(FLOAT)
    (fit, shown), most = np.zeros((2, len(pivots), len(cosines))), np.full(len(pivots), 1e-9)
    places, (grey, light) = np.empty(len(cosines), np.int32), np.empty((2, len(cosines)), FLOAT)
    for line in range(len(pivots)):
        x, y = pivots[line]
        for i in range(starts[line], starts[line + 1]):
            dx, dy, a = FLOAT(nodes[0, i] - x), FLOAT(nodes[1, i] - y), nodes[2, i]
            most[line] += a * a
            _find_places(FLOAT(x), FLOAT(y), dx, dy, cosines, sines, shape, places)
            _take_pixels(flat, places, grey, light)
            _add_scores(grey, light, FLOAT(p.gain), FLOAT(a), fit[line], shown[line])
    return fit / most[:, None], shown / most[:, None]


@njit(cache=True, error_model="numpy", inline="always")
def _find_places(x, y, dx, dy, cosines, sines, shape, places):
    """Place in the flat picture, −1 outside, of a node (dx, dy) from its pivot (x, y), turned."""
    height, width, half = np.int32(shape[0]), np.int32(shape[1]), FLOAT(0.5)
    for k in range(len(places)):
        column = np.int32(np.floor(x + cosines[k] * dx - sines[k] * dy + half))
        row = np.int32(np.floor(y + sines[k] * dx + cosines[k] * dy + half))
        inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
        places[k] = row * width + column if inside else np.int32(-1)


@njit(cache=True, error_model="numpy", inline="always")
def _take_pixels(flat, places, grey, light):
    """Grey and light at some places of the flat image, background and weight; 0: no light."""
    for k in range(len(places)):
        at = np.uint64(max(places[k], 0))  # unsigned: numba need not look for negative places
        seen = (places[k] >= 0) & (flat[2][at] > 0)
        grey[k], light[k] = flat[0][at], flat[1][at] if seen else FLOAT(0)


@njit(cache=True, error_model="numpy", inline="always")
def _add_scores(grey, light, gain, a, fit, shown):
    """Add how well every turn's pixel shows a line of amplitude `a`; nothing where there is none.

    `fit` is how much smaller the squared residual of the absorbance becomes: a² where it is `a`, 0
    where it is 0 or at least twice as much. A body's dark edge is no whisker. `shown` is what is
    there of the line: another whisker upon it takes nothing away.
    """
    one, none, two, most = FLOAT(1), FLOAT(0), FLOAT(2) * a, FLOAT(1.3) * a
    for k in range(len(fit)):
        expected = gain * light[k]
        seen = one - grey[k] / (expected if expected > one else one)
        seen = seen if seen > none else none
        seen = seen if seen < two else two
        there = light[k] > none
        fit[k] += seen * (two - seen) if there else none
        shown[k] += a * (seen if seen < most else most) if there else none


@njit(cache=True)
def _behind(x, y, n, pivot):
    """Point `pivot` [px] behind the base of a line with `n` nodes."""
    k = min(AHEAD, n - 1)
    dx, dy = x[k] - x[0], y[k] - y[0]
    part = pivot / max(np.hypot(dx, dy), 1e-9)
    return x[0] - part * dx, y[0] - part * dy


def turn_line(line, angle, pivot=0.0):
    """Turn a line about the point `pivot` [px] behind its base by `angle` [rad, from +x to +y]."""
    _turn(line.x, line.y, line.n, angle, pivot)


@njit(cache=True)
def _turn(x, y, n, angle, pivot):
    cos, sin = np.cos(angle), np.sin(angle)
    px, py = _behind(x, y, n, pivot)
    for i in range(n):
        dx, dy = x[i] - px, y[i] - py
        x[i] = px + cos * dx - sin * dy
        y[i] = py + sin * dx + cos * dy
