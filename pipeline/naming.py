"""Which line is which whisker, decided over a whole video.

The tracer's lines are taken together while nothing could have been exchanged. Wherever a whisker
may have gone over to another's line, or is found anew, all likely ways to name the lines from
there on are kept, with how well they fit: each line beside its whisker's look (`fan_model`) and
beside that whisker's line of the frame before. In the end the likeliest way through the whole
video is taken (Viterbi); the share of all ways that agree is the confidence (forward-backward).
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from pipeline.line_features import ANGLE

WEIGHT = 0.1  # of one frame's look: errors of neighbouring frames are alike
AMBIGUOUS = 8.0  # log-odds of motion, below which two lines may have been exchanged
STRANGE = 12.0  # cost of a motion that may lead onto another whisker's line
LIKELY = 14.0  # log-odds to the best, up to which a way is kept
MOST_WAYS = 40
BORN = 4.0  # cost of a whisker that begins to be seen, or ends
WINDOWS = (3.0, 6.0, 10.0)  # cost above the best, up to which ways to go on are looked for
ENOUGH = 60  # ways to go on


@dataclass
class Block:
    """Frames through which every line keeps its name, whichever that is.

    `tracks`: the tracer's whiskers that are present; `look`: (tracks, whiskers) cost of the
    names; `motion`: (tracks of the block before, tracks) cost of going on as that line, and
    `loose`: bool (tracks,), of which the name may change where the block begins.
    """

    tracks: np.ndarray
    look: np.ndarray
    motion: np.ndarray
    loose: np.ndarray


def motions(before, after, sd) -> np.ndarray:
    """Cost of every line of a frame (rows, 6) to go on as every one of the next (rows, 6).

    All whiskers may turn by the same; `sd` are of what is left.
    """
    z = (after[None, :, :] - before[:, None, :]) / sd
    return 0.5 * np.nan_to_num(np.minimum(z**2, 9.0)).sum(axis=-1)


def ways(blocks: list[Block]) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Names of the tracks of every block, and how sure they are (posterior probability).

    Returns
    -------
    names, sure : per block, (tracks,) the whisker and its probability
    """
    states, scores, edges = [], [], []
    for number, block in enumerate(blocks):
        if number == 0:
            found = {way: [(None, -cost)] for way, cost in _first_ways(block)}
            states.append(list(found))
            scores.append(np.array([found[way][0][1] for way in states[-1]]))
            edges.append(None)
            continue
        new = _go_on(blocks[number - 1], block, states[-1], scores[-1])
        states.append(list(new))
        edges.append([new[way] for way in states[-1]])
        scores.append(np.array([max(scores[-1][k] + s for k, s in e) for e in edges[-1]]))
    return _best_way(blocks, states, scores, edges)


def _first_ways(block):
    return _assignments(block.look, {})


def _go_on(last: Block, block: Block, states, scores):
    """New way → [(number of the way that it comes from, log-odds of this step)]."""
    place = {int(t): k for k, t in enumerate(last.tracks)}
    out, best = {}, -np.inf
    for number in np.argsort(-scores, kind="stable"):
        if scores[number] < best - 2 * LIKELY:
            break
        way = states[number]
        line_of = {w: k for k, w in enumerate(way)}
        cost = block.look.copy()
        for w in range(cost.shape[1]):
            k = line_of.get(w)
            # less the cost of this whisker's end, which is there for all that do not go on
            cost[:, w] += BORN if k is None else np.minimum(block.motion[k], 2 * BORN) - BORN
        fixed = {
            j: way[place[int(t)]]
            for j, t in enumerate(block.tracks)
            if not block.loose[j] and int(t) in place
        }
        for new, total in _assignments(cost, fixed):
            step = -total
            best = max(best, scores[number] + step)
            if scores[number] + step > best - LIKELY:
                out.setdefault(new, []).append((int(number), step))
    ranked = sorted(out, key=lambda w: -max(scores[k] + s for k, s in out[w]))
    top = max(scores[k] + s for k, s in out[ranked[0]])
    return {
        way: out[way]
        for way in ranked[:MOST_WAYS]
        if max(scores[k] + s for k, s in out[way]) > top - LIKELY
    }


def _assignments(cost, fixed):
    """Ways to name all lines, [(names, cost)], best first, none much worse than the best.

    fixed : line → its name; all others get any name that is free.
    """
    taken = set(fixed.values())
    base = sum(cost[j, w] for j, w in fixed.items())
    open_lines = [j for j in range(len(cost)) if j not in fixed]
    names = [w for w in range(cost.shape[1]) if w not in taken]
    if not open_lines:
        return [(tuple(fixed[j] for j in range(len(cost))), base)]
    part = cost[np.ix_(open_lines, names)]
    found = k_best(part)
    out = []
    for columns, total in found:
        way = dict(fixed)
        way.update({j: names[c] for j, c in zip(open_lines, columns, strict=True)})
        out.append((tuple(int(way[j]) for j in range(len(cost))), base + total))
    return out


def k_best(cost):
    """Assignments of rows to columns and their costs, near the best one's; the best first."""
    rows, columns = linear_sum_assignment(cost)
    least = cost[rows, columns].sum()
    for window in WINDOWS:
        found = _all_within(cost, least + window)
        if len(found) >= ENOUGH:
            break
    return sorted(found, key=lambda item: item[1])[:ENOUGH]


def _all_within(cost, limit):
    """Assignments of all rows that cost no more than `limit`; at most 4 × ENOUGH."""
    rows = len(cost)
    least = cost.min(axis=1)
    order = np.argsort(least - np.partition(cost, 1, axis=1)[:, 1]) if cost.shape[1] > 1 else [0]
    rest = np.append(np.cumsum(least[order][::-1])[::-1][1:], 0.0)
    columns = [[(float(cost[j, k]), int(k)) for k in np.argsort(cost[j])] for j in order]
    found, chosen = [], [0] * rows

    def search(depth, used, total):
        if depth == rows:
            found.append((tuple(chosen), total))
            return
        for value, k in columns[depth]:
            if total + value + rest[depth] > limit + 1e-9 or len(found) >= 4 * ENOUGH:
                return
            if not used >> k & 1:
                chosen[order[depth]] = k
                search(depth + 1, used | 1 << k, total + value)

    search(0, 0, 0.0)
    return found


def _best_way(blocks, states, scores, edges):
    """Viterbi's names, and by forward and backward sums their probabilities."""
    n = len(blocks)
    forward = [scores[0]]
    for e in edges[1:]:
        last = forward[-1]
        forward.append(np.array([_log_sum([last[k] + s for k, s in each]) for each in e]))
    backward = [np.zeros(len(states[-1]))]
    for t in range(n - 1, 0, -1):
        sums = [[] for _ in states[t - 1]]
        for value, each in zip(backward[0], edges[t], strict=True):
            for k, s in each:
                sums[k].append(value + s)
        backward.insert(0, np.array([_log_sum(each) for each in sums]))
    at = int(np.argmax(scores[-1]))
    names, sure = [None] * n, [None] * n
    for t in range(n - 1, -1, -1):
        weight = forward[t] + backward[t]
        weight = np.exp(weight - weight.max())
        weight /= weight.sum()
        way = np.array(states[t][at], int)
        table = np.array(states[t], int).reshape(len(states[t]), -1)
        names[t] = way
        sure[t] = ((table == way) * weight[:, None]).sum(axis=0)
        if t:
            at = max(edges[t][at], key=lambda e: scores[t - 1][e[0]] + e[1])[0]
    return names, sure


def _log_sum(values):
    if not len(values):
        return -np.inf
    top = max(values)
    return top + np.log(np.sum(np.exp(np.asarray(values) - top))) if np.isfinite(top) else top


def blocks_of(features, cost, frame, whisker, motion_sd) -> tuple[list[Block], list]:
    """Cut a video's lines wherever a name may change.

    Parameters
    ----------
    features : (rows, 6) ordered by frame
    cost : (rows, whiskers) of the rows' looks (`FanModel.costs`)
    frame, whisker : (rows,)

    Returns
    -------
    blocks, and for each the rows that belong to it: a list of (tracks,) lists of rows
    """
    starts = np.append(np.flatnonzero(np.diff(frame, prepend=-2)), len(frame))
    a, b = starts[:2]
    first = np.zeros((0, b - a)), np.ones(b - a, bool)
    blocks = [Block(whisker[a:b], WEIGHT * cost[a:b], *first)]
    rows_of = [[[r] for r in range(a, b)]]
    for p, a, b in zip(starts, starts[1:], starts[2:], strict=False):
        tracks = whisker[a:b]
        before, after = features[p:a], features[a:b].copy()
        place = {int(t): k for k, t in enumerate(whisker[p:a])}
        pairs = [(place[int(t)], j) for j, t in enumerate(tracks) if int(t) in place]
        if pairs:
            i, j = np.array(pairs).T
            after[:, ANGLE] -= np.nanmedian(after[j, ANGLE] - before[i, ANGLE])
        motion = motions(before, after, motion_sd)
        loose = _loose(motion, pairs, b - a)
        gap = frame[a] - frame[p] > 1
        if gap:
            loose[:] = True
            motion[:] = np.minimum(motion, BORN)
        if loose.any() or len(pairs) < a - p:
            blocks.append(Block(tracks, WEIGHT * cost[a:b], motion, loose))
            rows_of.append([[r] for r in range(a, b)])
        else:
            order = {int(t): k for k, t in enumerate(blocks[-1].tracks)}
            for j, t in enumerate(tracks):
                k = order[int(t)]
                blocks[-1].look[k] += WEIGHT * cost[a + j]
                rows_of[-1][k].append(a + j)
    return blocks, rows_of


def _loose(motion, pairs, n):
    """Which of n lines may be another whisker's than in the frame before."""
    loose = np.ones(n, bool)
    loose[[j for _, j in pairs]] = False
    for i, j in pairs:
        if motion[i, j] > STRANGE:
            loose[j] = True
        for k, m in pairs:
            if m != j and motion[i, m] + motion[k, j] - motion[i, j] - motion[k, m] < AMBIGUOUS:
                loose[j] = loose[m] = True
    return loose
