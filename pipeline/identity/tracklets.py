"""First names from tracklets: stretches of a track in which its line never jumps.

Names in order along the face (`ordered_assignment`) depend on how the row looks, frame by frame;
these depend on how lines move. Two tracklets are joined where one begins at the place to which the
row's motion has carried the end of the other. Joined ones are then grouped into whiskers:
tracklets of one whisker are never seen at once, and have similar direction in the row, length and
thickness.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy.sparse import coo_array
from scipy.sparse.csgraph import min_weight_full_bipartite_matching
from scipy.sparse.linalg import LinearOperator, cg

from pipeline.identity.appearance import medians
from pipeline.identity.features import ANGLE, LENGTH, THICKNESS
from pipeline.numerics.robust import sd_about_0

JUMP = np.radians(5.0)  # beside the row's motion, from frame to frame
MEETING = np.radians(1.0)  # lines so near in direction may be taken for each other
LEAST_SCALE = np.radians(0.1)  # of turns about the row's
LONGEST_GAP = 40  # frames, over which a line may go on
END = 5  # frames at a tracklet's end that give its length and thickness there
LINK_SD, LINK_SD_PER_ROOT_FRAME = np.radians([1.0, 0.4])  # of a direction over a gap
WHISKER_SD = np.radians(4.0)  # of a whisker's direction in the row, from stretch to stretch
LONG = 15  # frames, in which a direction in the row is known
LENGTH_SD, THICKNESS_SD = 0.3, 0.25  # of their logarithms
GATE = 12.0  # sum of three squared deviations: a larger one is another whisker's
OVERLAP = 2  # frames in which two tracklets of one whisker may both be seen
LEAST_MISFIT = 1e-9  # a link of none would count as no link
PRECISION, MOST_STEPS = 1e-4, 300  # of directions in the row
HELD_TO_MEAN = 1e-3  # fixes the level of directions, of which only differences are known


def named_by_tracklets(lines):
    """Whisker of every line (rows,), numbered from 0; −1 for a second line of one in a frame.

    lines : `TrackedLines`
    """
    motion = RowMotion.of(lines)
    paths = _joined(_cut(lines, motion), lines, motion)
    named = np.full(len(lines.frame), -1)
    for number, rows in enumerate(_gathered(paths, lines)):
        named[rows] = number
    named[_second_of_a_frame(lines.frame, named)] = -1
    return named


def often_seen(named, frame, least_share):
    """The same names (rows,), −1 for whiskers seen in less than `least_share` of the frames."""
    count = np.bincount(named[named >= 0])
    kept = np.flatnonzero(count >= least_share * len(np.unique(frame)))
    number = np.full(len(count) + 1, -1)
    number[kept] = np.arange(len(kept))
    return number[named]


@dataclass(frozen=True)
class RowMotion:
    """Turn of the row from each frame to the next: shift + gain · direction, both (frames,)."""

    shift: np.ndarray
    gain: np.ndarray

    @classmethod
    def of(cls, lines) -> "RowMotion":
        """A robust line per frame through the turns of all tracks."""
        order, _, last = lines.pieces
        on = np.ones(len(order), bool)
        on[last - 1] = False
        now = order[:-1][on[:-1]]
        angle, next_ = lines.features[now, ANGLE], order[1:][on[:-1]]
        turn, frame = lines.features[next_, ANGLE] - angle, lines.frame[now]
        out = np.zeros((2, lines.frame[-1] + 1))
        by_frame = np.argsort(frame, kind="stable")
        bounds = np.searchsorted(frame[by_frame], np.arange(out.shape[1] + 1))
        for k in range(out.shape[1]):
            part = by_frame[bounds[k] : bounds[k + 1]]
            out[:, k] = _robust_line(angle[part], turn[part])
        return cls(*out)

    def carried(self, angle, frame):
        """Directions [rad] in LONGEST_GAP frames from `frame` on, of a line moving as the row."""
        return _carried(self.shift, self.gain, angle, frame)


@njit(cache=True)
def _carried(shift, gain, angle, frame):
    """Directions as in `RowMotion.carried`."""
    out = np.full(LONGEST_GAP, angle)
    for k in range(1, LONGEST_GAP):
        at = frame + k - 1
        moves = at < len(shift) - 1
        out[k] = out[k - 1] + (shift[at] + gain[at] * out[k - 1] if moves else 0.0)
    return out


@njit(cache=True)
def _robust_line(x, y):
    """Intercept and slope of y against x, by reweighting; the slope is held near zero."""
    if len(x) < 3:
        return (np.median(y) if len(y) else 0.0), 0.0
    shift, gain = np.median(y), 0.0
    for _ in range(5):
        off = y - shift - gain * x
        scale = max(sd_about_0(off), LEAST_SCALE)
        weight = 1 / (1 + (off / (2 * scale)) ** 2) ** 2
        total = weight.sum()
        mean = (weight * x).sum() / total
        spread = (weight * (x - mean) ** 2).sum() + 0.02
        gain = (weight * (x - mean) * y).sum() / spread
        shift = (weight * (y - gain * x)).sum() / total
    return shift, gain


def _cut(lines, motion) -> list:
    """Rows of every tracklet: tracks cut where they pause, jump, or leave a line they had met."""
    order, first, _ = lines.pieces
    before, after = order[:-1], order[1:]
    angle, frame = lines.features[:, ANGLE], lines.frame
    shift, gain = motion.shift[frame[before]], motion.gain[frame[before]]
    off = angle[after] - angle[before] - shift - gain * angle[before]
    meets = _meets_another(angle, frame)
    cut = (np.abs(off) > JUMP) | (meets[before] & ~meets[after])
    cut[first[1:] - 1] = True
    return np.split(order, np.flatnonzero(cut) + 1)


def _meets_another(angle, frame):
    """Rows whose line lies in nearly the same direction as another one of its frame, bool."""
    order = np.lexsort((angle, frame))
    near = (np.diff(frame[order]) == 0) & (np.diff(angle[order]) < MEETING)
    out = np.zeros(len(frame), bool)
    out[order[:-1]] |= near
    out[order[1:]] |= near
    return out


def _joined(tracklets, lines, motion) -> list:
    """Rows of every path: tracklets joined end to end.

    The links have the least total misfit; a path that ends costs as much as the GATE.
    """
    count = len(tracklets)
    one, other, misfit = _links(tracklets, lines, motion)
    every = np.arange(count)
    rows, columns = np.append(one, every), np.append(other, count + every)
    cost = coo_array((np.append(misfit, np.full(count, GATE)), (rows, columns)))
    before, after = min_weight_full_bipartite_matching(cost.tocsr())
    linked = after < count
    following = dict(zip(before[linked].tolist(), after[linked].tolist(), strict=True))
    paths = []
    for k in sorted(set(range(count)) - set(following.values())):
        path = [k]
        while path[-1] in following:
            path.append(following[path[-1]])
        paths.append(np.concatenate([tracklets[k] for k in path]))
    return paths


def _links(tracklets, lines, motion):
    """Tracklets a and b where b may continue a, and the misfits in squared SDs.

    The direction in the row counts, too, of tracklets long enough to show it.
    """
    features, frame = lines.features, lines.frame
    appearance = _appearance(tracklets, lines)[:, 0]
    appearance[[len(rows) < LONG for rows in tracklets]] = np.nan
    first, last = (np.array([frame[rows[end]] for rows in tracklets]) for end in (0, -1))
    begins, ends = (
        _medians(features, [rows[part] for rows in tracklets])
        for part in (slice(None, END), slice(-END, None))
    )
    direction = np.array([features[rows[0], ANGLE] for rows in tracklets])
    by_first = np.argsort(first, kind="stable")
    parts = [(np.empty(0, int), np.empty(0, int), np.empty(0))]
    for a, rows in enumerate(tracklets):
        range_ = [last[a] - OVERLAP + 1, last[a] + LONGEST_GAP]
        b = by_first[slice(*np.searchsorted(first[by_first], range_))]
        b = b[(b != a) & (last[b] > last[a])]
        gap = np.maximum(first[b] - last[a], 0)
        predicted = motion.carried(features[rows[-1], ANGLE], last[a])[gap]
        sd = np.hypot(LINK_SD, LINK_SD_PER_ROOT_FRAME * np.sqrt(np.maximum(gap, 1)))
        beside = np.nan_to_num((appearance[a] - appearance[b]) / WHISKER_SD)
        misfit = ((direction[b] - predicted) / sd) ** 2 + beside**2 + _unlike(ends[a], begins[b])
        near = misfit < GATE
        parts.append((np.full(near.sum(), a), b[near], misfit[near] + LEAST_MISFIT))
    return (np.concatenate(each) for each in zip(*parts, strict=True))


def _medians(features, parts):
    """Median log length and log thickness (parts, 2) of every part of the rows."""
    rows = np.concatenate(parts)
    starts = np.cumsum([0, *map(len, parts)])
    return np.column_stack([medians(features[rows, j], starts) for j in (LENGTH, THICKNESS)])


def _unlike(one, others):
    """Squared differences (k,) in length and thickness of one and k others; 0 where not known."""
    return np.nansum(((others - one) / [LENGTH_SD, THICKNESS_SD]) ** 2, axis=-1)


def _gathered(paths, lines) -> list:
    """Rows of every whisker: longest path first, each joins a similar whisker not seen beside it.

    A path that is like none becomes a whisker of its own.
    """
    appearance = _appearance(paths, lines)
    known, rows, seen = np.empty((0, 3)), [], []  # of every whisker
    for p in np.argsort([-len(path) for path in paths], kind="stable"):
        frames = set(lines.frame[paths[p]].tolist())
        misfit = ((appearance[p, 0] - known[:, 0]) / WHISKER_SD) ** 2
        misfit += _unlike(appearance[p, 1:], known[:, 1:])
        misfit[[len(frames & each) > OVERLAP for each in seen]] = np.inf
        best = int(np.argmin([*misfit, GATE]))
        if best == len(rows):
            known = np.append(known, appearance[p : p + 1], axis=0)
            rows.append([])
            seen.append(set())
        rows[best].append(paths[p])
        seen[best] |= frames
    return [np.concatenate(each) for each in rows]


def _appearance(paths, lines):
    """Mean direction in the row, log length and log thickness of every path, (paths, 3).

    A line's direction is its path's in the row plus the row's own in that frame: both by least
    squares over all lines, with the row's directions eliminated.
    """
    count = len(paths)
    owner = np.repeat(np.arange(count), [len(rows) for rows in paths])
    rows = np.concatenate(paths)
    angle, frame = lines.features[rows, ANGLE], lines.frame[rows]
    lines_of, held = np.bincount(owner), np.maximum(np.bincount(frame), 1)

    def beside_the_row(values):
        """Sums over every path of its lines' values, less the mean of their frames."""
        return np.bincount(owner, values - (np.bincount(frame, values) / held)[frame])

    def normal(mean):
        return beside_the_row(mean.ravel()[owner]) + HELD_TO_MEAN * mean.ravel()

    mean, _ = cg(
        LinearOperator((count, count), normal, dtype=float),
        beside_the_row(angle),
        rtol=PRECISION,
        maxiter=MOST_STEPS,
        M=LinearOperator((count, count), lambda v: v.ravel() / lines_of, dtype=float),
    )
    return np.column_stack([mean, _medians(lines.features, paths)])


def _second_of_a_frame(frame, named):
    """Rows (rows,) that have a whisker's name where another one of the frame has it, too."""
    order = np.lexsort((named, frame))
    again = (np.diff(frame[order]) == 0) & (np.diff(named[order]) == 0)
    out = np.zeros(len(frame), bool)
    out[order[1:][again]] = True
    return out
