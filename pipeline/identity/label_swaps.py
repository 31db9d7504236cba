"""Names of a video's lines, improved by exchanging two whiskers' names in some frames.

A video has far too many ways to name its lines to look at all of them. But with all names held
apart from those of two whiskers there are two ways in every frame, exchanged or not, and the best
of the 2^frames is found at once (Viterbi), as is the probability of either in every frame (forward
and backward sums). Pair after pair is taken until no exchange makes anything likelier.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from pipeline.identity.features import N_FEATURES
from pipeline.numerics.chains import likeliest_path, state_probabilities

TAIL = 4  # degrees of freedom of a motion's distribution: jumps happen
SEEN_AGAIN = 6.0  # cost of a whisker that is seen again after a gap
TAKEN = 15.0  # cost of a line that was another's, for a whisker that had none or a brief one
LEAST_GAIN = 1e-6
TRUST = 0.2  # of the costs, in probabilities: errors of neighbouring frames are alike
MOST_ROUNDS = 12
CLAIM_ROUNDS = 6  # of them, in which whiskers may claim lines without a name
MOST_CLAIMING = 4  # whiskers, for one line
MOST_LIKE = 4  # whiskers, for each, with which it may have changed places


class Evidence(NamedTuple):
    """What the names are inferred from; compiled functions take it whole.

    Attributes
    ----------
    features : float64 (rows, 6)
    drift : (rows, 6) what a row's features are expected to change by to the next frame, beside
        the turn of all
    look : (rows, whiskers) cost of every name by the row's own look
    nameless : (rows,) cost of none of these names
    frame : int64 (rows,), from 0, ascending
    phase : (frames,) turn of all whiskers
    slope : (whiskers, 6) change of the features with the phase
    sd, fast : (6,) of the motion from a frame to the next, and what is added to it per turn
    most_sd : (whiskers, 6) of the motion over a gap, at most
    source : (rows,) row of the same track in the frame before, −1 for none
    price : (rows,) cost of a name that is not that row's; up to TAKEN, none where lines that
        are both seen change places
    lasting : (rows,) whether the line is part of a long steady motion
    """

    features: np.ndarray
    drift: np.ndarray
    look: np.ndarray
    nameless: np.ndarray
    frame: np.ndarray
    phase: np.ndarray
    slope: np.ndarray
    sd: np.ndarray
    fast: np.ndarray
    most_sd: np.ndarray
    source: np.ndarray
    price: np.ndarray
    lasting: np.ndarray


def improved(evidence: Evidence, names, track) -> np.ndarray:
    """Names (rows,) after all exchanges that make them likelier, −1 for none.

    track : (rows,) the tracer's tracks, in which nameless lines are taken together
    """
    rows_of = _table(evidence, names)
    pairs = _alike(evidence, rows_of)
    kept = _nothing_kept(len(pairs), rows_of.shape[1])
    changed, fresh = np.ones(len(rows_of), bool), np.ones(len(names), bool)
    for number in range(MOST_ROUNDS):
        before, changed = changed, np.zeros(len(rows_of), bool)
        _exchange_all(evidence, rows_of, pairs, kept, before, changed)
        if number < CLAIM_ROUNDS:
            changed |= _claims(evidence, rows_of, track, before | changed, fresh)
        if not changed.any():
            break
    return _names(rows_of, len(names))


def certainty(evidence: Evidence, names, trust=TRUST) -> np.ndarray:
    """Probability of every row's name (rows,), 1 where there is none.

    trust : part of the costs that counts
    """
    rows_of = _table(evidence, names)
    sure = np.ones(len(names))
    for a, b in _alike(evidence, rows_of):
        steps = _steps(evidence, a, b, rows_of[a], rows_of[b], (-1, -1))
        right = state_probabilities(trust * steps)[:, 0]
        for rows in (rows_of[a], rows_of[b]):
            seen = rows >= 0
            sure[rows[seen]] *= right[seen]
    return sure


def _alike(evidence, rows_of):
    """Pairs (n, 2) of whiskers, the later one first, of which one is most like the other.

    Like it are those whose name costs its lines least. With these alone, not with all, the time
    grows with the number of whiskers and not with its square.
    """
    count, cost = len(rows_of), _usual_looks(evidence.look, rows_of)
    np.fill_diagonal(cost, np.inf)
    nearest = np.argsort(cost, axis=1)[:, :MOST_LIKE]
    pairs = {(max(a, b), min(a, b)) for a in range(count) for b in nearest[a] if a != b}
    return np.array(sorted(pairs), int).reshape(-1, 2)


@njit(cache=True)
def _usual_looks(look, rows_of):
    """Median cost of every whisker's rows by every name; infinite for one that is not seen."""
    out = np.full((len(rows_of), len(rows_of)), np.inf)
    for a in range(len(rows_of)):
        own = look[rows_of[a][rows_of[a] >= 0]]
        for b in range(len(out) if len(own) else 0):
            out[a, b] = np.median(own[:, b])
    return out


def runs(names, track, frame):
    """Nameless rows, run by run of a track without a gap, and where each run begins, and the end.

    Returns rows (n,) and their places (runs + 1,).
    """
    rows = np.flatnonzero(names < 0)
    rows = rows[np.lexsort((frame[rows], track[rows]))]
    cut = (np.diff(track[rows]) != 0) | (np.diff(frame[rows]) != 1)
    inner = np.flatnonzero(cut) + 1
    return rows, np.concatenate([[0], inner, [len(rows)]]) if len(rows) else np.zeros(1, int)


def _table(evidence, names):
    """Rows of every whisker in every frame, (whiskers, frames), −1 where not seen."""
    out = np.full((evidence.look.shape[1], len(evidence.phase)), -1)
    known = names >= 0
    out[names[known], evidence.frame[known]] = np.flatnonzero(known)
    return out


def _names(rows_of, count):
    names = np.full(count, -1)
    for name, rows in enumerate(rows_of):
        names[rows[rows >= 0]] = name
    return names


def _nothing_kept(pairs, frames):
    """Room for every pair's steps (pairs, frames, 2, 2), and for the rows that they are of."""
    return np.zeros((pairs, frames, 2, 2)), np.full((pairs, 2, frames), -2, np.int32)


def _claims(evidence, rows_of, track, changed, fresh):
    """Give nameless rows, run by run, to the likeliest looking whisker that takes some.

    changed : (whiskers,) those that may claim more than they did in the last round
    fresh : (rows,) those that all whiskers may claim; those that none does are fresh no longer

    Returns the whiskers that claimed some (whiskers,).
    """
    names = _names(rows_of, len(fresh))
    fresh[names >= 0] = True
    claimed = np.zeros(len(rows_of), bool)
    rows, first = runs(names, track, evidence.frame)
    if len(rows):
        cost = evidence.look[rows] - evidence.nameless[rows, None]
        cost = np.add.reduceat(cost, first[:-1], axis=0)
        likely = np.argsort(cost, axis=1)[:, :MOST_CLAIMING]
        _claim_runs(evidence, rows_of, cost, likely, rows, first, changed, fresh, claimed)
    return claimed


@njit(cache=True, inline="always")  # a call hands on all arrays of the evidence
def link(evidence, a, i, j):
    """Cost of whisker `a` to go on from row i to row j (−1: not seen)."""
    if j < 0:
        return 0.0
    e = evidence
    gap = abs(e.frame[j] - e.frame[i])
    renamed = e.price[j] if e.source[j] >= 0 and e.source[j] != i else 0.0
    if i >= 0 and renamed <= TAKEN and gap == 1 and (e.lasting[i] or not e.lasting[j]):
        renamed = 0.0  # lines that lie on each other may have changed places
    if i < 0:
        return SEEN_AGAIN + renamed
    turn = e.phase[e.frame[j]] - e.phase[e.frame[i]]
    square, freedom, wider, usual = 0.0, TAIL, 1.0, 1.0
    for f in range(N_FEATURES):
        step = e.features[j, f] - e.features[i, f] - e.slope[a, f] * turn
        if np.isnan(step):
            continue
        if gap == 1:
            step -= e.drift[i, f]
        sd, most = e.sd[f], max(e.most_sd[a, f], e.sd[f])
        variance = min((sd * gap) ** 2 + (e.fast[f] * turn) ** 2, most**2)
        square += step**2 / variance
        freedom += 1
        wider *= variance
        usual *= sd**2
    cost = 0.5 * np.log((1.0 + square / TAIL) ** freedom * (wider / usual))
    return cost + (SEEN_AGAIN if gap > 1 else 0.0) + renamed


@njit(cache=True)
def _exchange_all(evidence, rows_of, pairs, kept, before, changed):
    """Exchange the rows of one pair after the other, in place, where that is likelier.

    kept : as of `_nothing_kept`, which is brought up to date
    before, changed : (whiskers,) those whose rows changed in the last round, and in this one
    """
    steps, known = kept
    for k in range(len(pairs)):
        a, b = pairs[k]
        if before[a] or before[b] or changed[a] or changed[b]:
            one, other = rows_of[a], rows_of[b]
            _renew(evidence, a, b, one, other, steps[k], known[k, 0], known[k, 1])
            states, gain = _best_states(steps[k])
            if gain >= LEAST_GAIN and _exchange_parts(evidence, a, b, one, other, states):
                changed[a] = changed[b] = True


@njit(cache=True, error_model="numpy")
def _renew(evidence, a, b, one, other, steps, known_one, known_other):
    """Bring `steps`, which are of the `known` rows, and these up to date with one and other.

    Exchanges change few frames: most steps stay as they are.
    """
    last, known_last = (-1, -1), (-1, -1)
    for t in range(len(one)):
        rows, known = (one[t], other[t]), (known_one[t], known_other[t])
        if rows != known or last != known_last:
            _step(evidence, a, b, rows, last, steps, t)
            known_one[t], known_other[t] = rows
        last, known_last = _seen_last(rows, last), _seen_last(known, known_last)


@njit(cache=True)
def _seen_last(rows, before):
    """Rows where two whiskers were seen last, by those in a frame and those before."""
    return (
        rows[0] if rows[0] >= 0 else before[0],
        rows[1] if rows[1] >= 0 else before[1],
    )


@njit(cache=True, error_model="numpy")
def _steps(evidence, a, b, one, other, last):
    """Cost (frames, 2, 2) of every step from (not) exchanged to (not) exchanged.

    one, other : (frames,) rows of whiskers a and b, −1 where not seen; b < 0: nameless rows
    last : the two rows where they were seen last before, −1 for none
    """
    out = np.zeros((len(one), 2, 2))
    for t in range(len(one)):
        rows = (one[t], other[t])
        _step(evidence, a, b, rows, last, out, t)
        last = _seen_last(rows, last)
    return out


@njit(cache=True, inline="always")
def _step(evidence, a, b, rows, last, out, t):
    """Fill in the costs of `_steps` in frame `t`."""
    for now in range(2):
        mine, theirs = rows[now], rows[1 - now]
        seen = 0.0
        if mine >= 0:
            seen += evidence.look[mine, a]
        if theirs >= 0:
            seen += evidence.look[theirs, b] if b >= 0 else evidence.nameless[theirs]
        for before in range(2):
            cost = link(evidence, a, last[before], mine)
            if b >= 0:
                cost += link(evidence, b, last[1 - before], theirs)
            out[t, before, now] = seen + cost


@njit(cache=True, error_model="numpy")
def _exchange_parts(evidence, a, b, one, other, states):
    """Exchange rows, in place, in those unbroken parts where it is likelier; whether in any.

    In `_steps`, a whisker that is not seen counts as exchanged with the other one; the costs
    compared here are those of the names themselves.

    one, other, states : (frames,) rows of whiskers a and b, −1 where not seen; 1: to exchange
    """
    last_one, last_other, any_part, t = -1, -1, False, 0
    while t < len(one):
        end = t + 1
        while end < len(one) and states[end] == states[t]:
            end += 1
        if states[t] > 0:
            both = _both_seen(one, other, end)
            kept = _cost(evidence, a, last_one, one[t:both])
            kept += _cost(evidence, b, last_other, other[t:both])
            _swap(one[t:end], other[t:end])
            exchanged = _cost(evidence, a, last_one, one[t:both])
            exchanged += _cost(evidence, b, last_other, other[t:both])
            if exchanged < kept - LEAST_GAIN:
                any_part = True
            else:
                _swap(one[t:end], other[t:end])
        for i in range(t, end):
            last_one = one[i] if one[i] >= 0 else last_one
            last_other = other[i] if other[i] >= 0 else last_other
        t = end
    return any_part


@njit(cache=True)
def _both_seen(one, other, first):
    """The frame by which both have been seen again from the `first` one on."""
    again, seen_one, seen_other = first, False, False
    while again < len(one) and not (seen_one and seen_other):
        seen_one |= one[again] >= 0
        seen_other |= other[again] >= 0
        again += 1
    return again


@njit(cache=True, inline="always")
def _cost(evidence, a, last, rows):
    """Cost of some `rows` (frames,) as whisker a's, after it was `last` seen in that row."""
    total = 0.0
    for row in rows:
        if row >= 0:
            total += evidence.look[row, a] + link(evidence, a, last, row)
            last = row
    return total


@njit(cache=True)
def _swap(one, other):
    for i in range(len(one)):
        one[i], other[i] = other[i], one[i]


@njit(cache=True, error_model="numpy")
def _claimed(evidence, a, own, other, before, again):
    """States and gain as of `_best_states`, for a whisker beside a nameless line.

    Neither is exchanged before, nor where the whisker is seen `again` in the last frame.
    """
    steps = _steps(evidence, a, -1, own, other, (before, -1))
    # what is exchanged from the first frame on goes on from where the whisker itself was
    if other[0] >= 0:
        first = evidence.look[other[0], a] + link(evidence, a, before, other[0])
        steps[0, 0, 1] = first + (evidence.nameless[own[0]] if own[0] >= 0 else 0.0)
    if again:
        steps[-1, :, 1] = np.inf
    return _best_states(steps)


@njit(cache=True)
def _claim(evidence, seen, a, rows):
    """Give rows of a nameless line to whisker a, in place, where that is likelier; whether it was.

    seen : (frames,) the whisker's rows
    """
    first, count = evidence.frame[rows[0]], len(rows)
    before, next_ = first - 1, first + count
    while before >= 0 and seen[before] < 0:
        before -= 1
    while next_ < len(seen) and seen[next_] < 0:
        next_ += 1
    # nothing happens until the whisker is seen again: one empty frame stands for all
    empty, again = min(next_ - first - count, 1), next_ < len(seen)
    own, other = np.full((2, count + empty + again), -1)
    own[:count], other[:count] = seen[first : first + count], rows
    if again:
        own[-1] = seen[next_]
    last = seen[before] if before >= 0 else -1
    states, gain = _claimed(evidence, a, own, other, last, again)
    if gain < LEAST_GAIN:
        return False
    for t in range(count):
        if states[t] > 0:
            seen[first + t] = other[t]
    return True


@njit(cache=True)
def _claim_runs(evidence, rows_of, cost, likely, rows, first, changed, fresh, claimed):
    """As `_claims`, for the runs of `rows` from every `first` one to the next.

    cost : (runs, whiskers) of every name, less that of none
    likely : (runs, k) the whiskers that may claim them
    """
    for number in range(len(likely)):
        run = rows[first[number] : first[number + 1]]
        all_may, taken = fresh[run].any(), False
        for a in likely[number]:
            if cost[number, a] >= 0 or taken:
                break
            if all_may or changed[a] or claimed[a]:
                taken = _claim(evidence, rows_of[a], a, run)
                claimed[a] |= taken
        fresh[run] = taken


@njit(cache=True)
def _best_states(steps):
    """Exchanged or not in every frame, and the gain over nothing exchanged."""
    states, cost = likeliest_path(steps)
    return states, steps[:, 0, 0].sum() - cost
