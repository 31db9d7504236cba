"""Appearance of a crowd's whiskers, learned from lines that keep their order along the face.

In every frame, lines and whiskers are both ordered along the face, and are aligned with each other
at a phase of the whisk; some lines get no name, and some whiskers no line (Needleman & Wunsch,
J. Mol. Biol. 48:443, 1970). A row that has moved on by one whisker looks much the same as another
phase. So the phases are those that suit the whole video best, given how much the lines are seen to
turn from frame to frame (Viterbi). Names and appearance are found in turn; to begin with, the k-th
line along the face belongs to the k-th whisker.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy.ndimage import uniform_filter1d

from pipeline.identity import motion_model, seeds
from pipeline.identity.appearance import LEAST_SLOPE, FanModel
from pipeline.identity.features import ANGLE
from pipeline.identity.tracked_lines import TrackedLines

SELDOM = 0.02  # of the frames: numbers of lines that fewer have are not tried
UNSEEN = 4.0  # cost of a whisker that has no line in a frame
NAMELESS = 16.0  # cost of a line without a name
SHIFTS = (  # tried beside the last phase: in the first round, in the next two, later
    np.radians(np.arange(-60.0, 61.0, 6.0)),
    *2 * (np.radians(np.arange(-24.0, 25.0, 4.0)),),
    np.radians(np.arange(-9.0, 10.0, 3.0)),
)
SHIFT_SD = np.radians(16.0)
MOST_ROUNDS = 10
SURE_TURN = np.radians(1.0)  # from frame to frame, to which the row's turn is known
OFF_TURN = 6.0 / np.radians(1.0)  # cost of a phase that changes by more or less
UNSURE = 0.3 / np.radians(1.0)  # the same, where the turn is not known
JUMP = 500.0  # cost of any change, at most
SETTLED = 0.01  # of the lines change their names in a round: the last one


@dataclass(frozen=True)
class Naming:
    """Names (rows,), −1 for none, the appearance that they follow from, and their total cost."""

    names: np.ndarray
    model: FanModel
    cost: float


def named_in_order(lines: TrackedLines, least_sd) -> list[Naming]:
    """Names of all lines for several numbers of whiskers, ordered by cost.

    The commonest number of lines in a frame is tried first, then more and fewer, as long as the
    cost falls.

    least_sd : (6,) of the features
    """
    turn = motion_model.common_turns(lines.features, lines.frame, lines.before)
    weight, phase = motion_model.newness(turn, lines.limits), np.cumsum(turn)
    phase -= uniform_filter1d(phase, lines.limits.same_mean)
    frames = np.bincount(np.diff(lines.starts))
    frames[0] = 0
    often = np.flatnonzero(frames >= max(SELDOM * frames.sum(), 1))
    middle = int(np.argmax(frames[often]))
    found = {}

    def cost(k):
        if k not in found:
            appearance = _first_appearance(lines, often[k], phase, weight, least_sd)
            found[k] = _settled(lines, appearance, phase)
        return found[k].cost

    for step in (-1, 1):
        k = middle
        while 0 <= k + step < len(often) and cost(k + step) < cost(k):
            k += step
    cost(middle)
    return sorted(found.values(), key=lambda each: each.cost)


def _first_appearance(lines, count, phase, weight, least_sd) -> FanModel:
    """Appearance of the first, second, … line along the face in all frames with `count` lines."""
    own = np.repeat(np.diff(lines.starts), np.diff(lines.starts)) == count
    features, frame = lines.features[own], lines.frame[own]
    along = np.lexsort((features[:, ANGLE], frame))
    place = np.empty(len(frame), np.int64)
    place[along] = np.arange(len(frame)) % count
    return seeds.first_appearance(features, place, phase[frame], weight[frame], count, least_sd)


def appearance_and_phases(
    lines: TrackedLines, model: FanModel, names
) -> tuple[FanModel, np.ndarray]:
    """Appearance of all whiskers and phases (frames,) that follow from the names (rows,)."""
    known = names >= 0
    phase = motion_model.phases(model, lines.features, lines.frame, names)
    weight = motion_model.newness(np.diff(phase, prepend=np.nan), lines.limits)
    frame = lines.frame[known]
    fitted = model.fitted(lines.features[known], names[known], phase[frame], weight[frame])
    return fitted, phase


def _settled(lines, model, phase) -> Naming:
    """Names and appearance, found in turn until names hardly change."""
    before = np.full(len(lines.frame), -1)
    slope = 1.0
    for number in range(MOST_ROUNDS):
        turn = motion_model.sure_turns(
            lines.features, lines.frame, lines.before, slope, lines.limits.own_turn
        )
        shifts = SHIFTS[min(number, len(SHIFTS) - 1)]
        names, cost = _in_order(lines, model, phase, turn, shifts)
        settled = number >= len(SHIFTS) and (names != before).mean() < SETTLED
        if settled or number == MOST_ROUNDS - 1 or not (names >= 0).any():
            break
        before = names
        model, phase = appearance_and_phases(lines, model, names)
        known = np.maximum(model.slope[names, ANGLE], LEAST_SLOPE)
        slope = np.where(names >= 0, known, np.nan)
    return Naming(names, model, cost)


def _in_order(lines, model, phase, turn, shifts):
    """Names (rows,) and the cost of all, at the phases near `phase` that suit the video best.

    phase, turn : (frames,) phases, and what they should change by from the frame before [rad],
        NaN where that is not known
    shifts : (k,) of the phases, that are tried [rad]
    """
    order = lines.starts, lines.along, lines.pieces
    cost = np.zeros((len(phase), len(shifts)))
    for k, shift in enumerate(shifts):
        cost[:, k] = _at_phases(lines, model, phase + shift, *order)[1]
        cost[:, k] += 0.5 * (shift / SHIFT_SD) ** 2
    weight = motion_model.newness(turn, lines.limits)
    tried = phase[:, None] + shifts
    path = _likeliest_path(weight[:, None] * cost, tried, turn)
    names, cost = _at_phases(lines, model, tried[np.arange(len(path)), path], *order)
    return names, float(cost.sum())


def _at_phases(lines, model, phase, starts, along, pieces):
    """Names (rows,) of lines in order at given phases (frames,), and the cost (frames,)."""
    cost = model.costs(lines.features, phase[lines.frame])
    cost = along_tracks(cost, *pieces, lines.limits.along_track)
    names, total = np.full(len(lines.frame), -1), np.zeros(len(phase))
    _align_frames(
        cost, along, starts, phase, model.middle[:, ANGLE], model.slope[:, ANGLE], names, total,
    )  # fmt: skip
    return names, total


@njit(cache=True)
def _likeliest_path(cost, phase, turn):
    """Which of the phases (frames, k) to take in every frame, (frames,).

    cost : (frames, k) of each; turn : (frames,) what the phase should change by
    """
    n, m = cost.shape
    came = np.zeros((n, m), np.int64)
    least = cost[0].copy()
    for t in range(1, n):
        now = np.empty(m)
        sure = not np.isnan(turn[t])
        for k in range(m):
            best, where = np.inf, 0
            for j in range(m):
                off = abs(phase[t, k] - phase[t - 1, j] - (turn[t] if sure else 0.0))
                each = least[j] + (
                    min(OFF_TURN * max(off - SURE_TURN, 0.0), JUMP) if sure else UNSURE * off
                )
                if each < best:
                    best, where = each, j
            now[k] = best + cost[t, k]
            came[t, k] = where
        least = now
    out = np.empty(n, np.int64)
    out[-1] = np.argmin(least)
    for t in range(n - 1, 0, -1):
        out[t - 1] = came[t, out[t]]
    return out


@njit(cache=True)
def _align_frames(cost, along, starts, phase, middle, slope, names, total):
    """Fill in the names (rows,) and the cost (frames,) of every frame at a given phase.

    along : (rows,) every frame's rows in their order along the face, counted from its first
    """
    n, m = np.diff(starts).max(), len(middle)
    room = np.empty((n + 1, m + 1)), np.empty((n + 1, m + 1), np.int8)
    whiskers, angle = np.arange(m), np.empty(m)
    for t in range(len(starts) - 1):
        a, b = starts[t], starts[t + 1]
        if a < b:
            for k in range(m):
                angle[k] = middle[k] + slope[k] * phase[t]
            if not _in_ascending_order(angle, whiskers):
                whiskers = np.argsort(angle)
            total[t] = _aligned(cost[a:b], along[a:b], whiskers, room, names[a:b])


@njit(cache=True)
def _in_ascending_order(values, order):
    """Whether `order` already sorts the values, which is faster to test than to sort again."""
    ascending = True
    for k in range(1, len(order)):
        ascending &= values[order[k - 1]] <= values[order[k]]
    return ascending


@njit(cache=True)
def along_tracks(cost, order, first, last, reach):
    """Costs or shares (rows, whiskers), averaged over ±`reach` rows of every row's track.

    order, first, last : as in `TrackedLines.pieces`
    """
    out = np.empty_like(cost)
    total = np.empty(cost.shape[1])
    for piece in range(len(first)):
        a, b = first[piece], last[piece]
        low, high = a, a
        total[:] = 0.0
        for i in range(a, b):
            while high < min(b, i + reach + 1):
                come = cost[order[high]]
                for k in range(len(total)):
                    total[k] += come[k]
                high += 1
            while low < i - reach:
                gone = cost[order[low]]
                for k in range(len(total)):
                    total[k] -= gone[k]
                low += 1
            mean, count = out[order[i]], float(high - low)
            for k in range(len(total)):
                mean[k] = total[k] / count
    return out


@njit(cache=True, error_model="numpy")
def _aligned(cost, rows, whiskers, room, names):
    """Fill in the whisker of every line (rows,), −1 for none, so that both are in order.

    Returns the cost.

    cost : (rows, whiskers) of every line as every whisker
    rows, whiskers : both in order along the face
    room : least costs and where they came from, at least (rows + 1, whiskers + 1)
    """
    least, came = room
    n, m = len(rows), len(whiskers)
    least[0, 0], came[0, 0] = 0.0, 0
    for k in range(1, m + 1):
        least[0, k], came[0, k] = least[0, k - 1] + UNSEEN, 2
    for i in range(1, n + 1):
        row, above, now, step = cost[rows[i - 1]], least[i - 1], least[i], came[i]
        now[0], step[0] = above[0] + NAMELESS, 1
        last = now[0]
        for k in range(1, m + 1):
            best, way = above[k] + NAMELESS, np.int8(1)
            unseen, both = last + UNSEEN, above[k - 1] + row[whiskers[k - 1]]
            if unseen < best:
                best, way = unseen, np.int8(2)
            if both < best:
                best, way = both, np.int8(3)
            now[k], step[k], last = best, way, best
    i, k = n, m
    names[:] = -1
    while i > 0 or k > 0:
        step = came[i, k]
        if step != 2:
            i -= 1
        if step != 1:
            k -= 1
        if step == 3:
            names[rows[i]] = whiskers[k]
    return least[n, m]
