"""Names of a video's lines, improved by exchanging two whiskers' names in some frames.

There are far too many ways to name the lines of a video to try all of them. But if all names are
fixed except those of two whiskers, only two are left in every frame, exchanged or not. The best of
these 2^frames is found at once (Viterbi). One pair after the other is treated, until no exchange
makes the names likelier.
"""

import numpy as np
from numba import njit

from pipeline.identity.links import Evidence, link_costs
from pipeline.numerics.chains import likeliest_path

LEAST_GAIN = 1e-6
MOST_ROUNDS = 12
MOST_CLAIMING = 4  # whiskers, for one line
MOST_LIKE = 4  # whiskers, for each, with which it may have changed places


def improved(evidence: Evidence, names, track) -> np.ndarray:
    """Names (rows,) after all exchanges that make them likelier, −1 for none.

    track : (rows,) the tracker's tracks; nameless lines of one track are treated together
    """
    rows_of = _table(evidence, names)
    pairs = _alike(evidence, rows_of)
    cache = _empty_cache(len(pairs), rows_of.shape[1])
    changed, untried = np.ones(rows_of.shape, bool), np.ones(len(names), bool)
    for _ in range(MOST_ROUNDS):
        before, changed = changed, np.zeros(rows_of.shape, bool)
        _exchange_all(evidence, rows_of, pairs, cache, before, changed)
        _claims(evidence, rows_of, track, before, changed, untried)
        if not changed.any():
            break
    return _names(rows_of, len(names))


def _alike(evidence, rows_of):
    """Pairs (n, 2) of similar whiskers, the later one first.

    Those are similar to a whisker whose names cost its lines least. With these pairs only,
    computing time grows with the number of whiskers and not with its square.
    """
    count, cost = len(rows_of), _usual_costs(evidence.appearance, rows_of)
    np.fill_diagonal(cost, np.inf)
    nearest = np.argsort(cost, axis=1)[:, :MOST_LIKE]
    pairs = {(max(a, b), min(a, b)) for a in range(count) for b in nearest[a] if a != b}
    return np.array(sorted(pairs), int).reshape(-1, 2)


@njit(cache=True)
def _usual_costs(appearance, rows_of):
    """Median cost of every whisker's rows by every name; infinite for one that is not seen."""
    out = np.full((len(rows_of), len(rows_of)), np.inf)
    for a in range(len(rows_of)):
        own = appearance[rows_of[a][rows_of[a] >= 0]]
        for b in range(len(out) if len(own) else 0):
            out[a, b] = np.median(own[:, b])
    return out


def runs(names, track, frame):
    """Nameless rows, run by run of a track without a gap, and where each run begins, and the end.

    Returns rows (n,) and their places (runs + 1,).
    """
    rows = np.flatnonzero(names < 0)
    rows = rows[np.lexsort((frame[rows], track[rows]))]
    begins = (np.diff(track[rows], prepend=-1) != 0) | (np.diff(frame[rows], prepend=0) != 1)
    return rows, np.append(np.flatnonzero(begins), len(rows))


def _table(evidence, names):
    """Rows of every whisker in every frame, (whiskers, frames), −1 where not seen."""
    out = np.full((evidence.appearance.shape[1], len(evidence.phase)), -1)
    known = names >= 0
    out[names[known], evidence.frame[known]] = np.flatnonzero(known)
    return out


def _names(rows_of, count):
    names = np.full(count, -1)
    for name, rows in enumerate(rows_of):
        names[rows[rows >= 0]] = name
    return names


def _empty_cache(pairs, frames):
    """Arrays for the steps of all pairs (pairs, frames, 2, 2), and for the rows they belong to."""
    return np.zeros((pairs, frames, 2, 2)), np.full((pairs, 2, frames), -2, np.int32)


def _claims(evidence, rows_of, track, before, changed, untried):
    """Give nameless rows, run by run, to the likeliest looking whisker that takes some.

    before, changed : as for `_exchange_all`: a whisker may claim what it did not claim in the
        last round only where its rows have changed since
    untried : (rows,) those that all whiskers may claim; those that none does are untried no longer
    """
    names = _names(rows_of, len(untried))
    untried[names >= 0] = True
    rows, first = runs(names, track, evidence.frame)
    if len(rows):
        cost = evidence.appearance[rows] - evidence.nameless[rows, None]
        cost = np.add.reduceat(cost, first[:-1], axis=0)
        likely = np.argsort(cost, axis=1)[:, :MOST_CLAIMING].copy()
        _claim_runs(evidence, rows_of, cost, likely, rows, first, before, changed, untried)


@njit(cache=True)
def _exchange_all(evidence, rows_of, pairs, cache, before, changed):
    """Exchange the rows of one pair after the other, in place, where that is likelier.

    cache : as in `_empty_cache`, which is brought up to date
    before, changed : bool (whiskers, frames), where the whiskers' rows changed in the last round,
        and in this one
    """
    steps, known = cache
    for k in range(len(pairs)):
        a, b = pairs[k]
        if before[a].any() or before[b].any() or changed[a].any() or changed[b].any():
            one, other = rows_of[a], rows_of[b]
            _renew(evidence, a, b, one, other, steps[k], known[k, 0], known[k, 1])
            states, gain = _best_states(steps[k])
            if gain >= LEAST_GAIN:
                _exchange_parts(evidence, a, b, one, other, states, changed)


@njit(cache=True, error_model="numpy")
def _renew(evidence, a, b, one, other, steps, known_one, known_other):
    """Compute `steps` again where rows `one` and `other` are not the `known` ones; set these.

    Exchanges change few frames: most steps stay as they are.
    """
    last = _seen_before(one, -1), _seen_before(other, -1)
    new = (one != known_one) | (last[0] != _seen_before(known_one, -1))
    new |= (other != known_other) | (last[1] != _seen_before(known_other, -1))
    t = np.flatnonzero(new)
    steps[t] = _step_costs(evidence, a, b, (one[t], other[t]), (last[0][t], last[1][t]))
    known_one[t], known_other[t] = one[t], other[t]


@njit(cache=True)
def _seen_before(rows, last):
    """For every frame, the row in which a whisker was last seen; `last` before the first one."""
    out = np.empty(len(rows), np.int64)
    for t in range(len(rows)):
        out[t] = last
        last = rows[t] if rows[t] >= 0 else last
    return out


@njit(cache=True, error_model="numpy")
def _step_costs(evidence, a, b, rows, last):
    """Cost (frames, 2, 2) of every step from (not) exchanged to (not) exchanged, in some frames.

    rows : of whiskers a and b, (frames,) each, −1 where not seen; b < 0: nameless rows
    last : the two rows (frames,) where they were seen last before, −1 for none
    """
    out = np.empty((len(rows[0]), 2, 2))
    for now in range(2):
        mine, theirs = rows[now], rows[1 - now]
        seen = _costs_of(evidence.appearance[:, a], mine)
        seen += _costs_of(evidence.appearance[:, b] if b >= 0 else evidence.nameless, theirs)
        for before in range(2):
            cost = link_costs(evidence, a, last[before], mine)
            if b >= 0:
                cost += link_costs(evidence, b, last[1 - before], theirs)
            out[:, before, now] = seen + cost
    return out


@njit(cache=True)
def _costs_of(cost, rows):
    """The costs of some rows, 0 where not seen."""
    out = np.zeros(len(rows))
    for k in range(len(rows)):
        if rows[k] >= 0:
            out[k] = cost[rows[k]]
    return out


@njit(cache=True, error_model="numpy")
def _exchange_parts(evidence, a, b, one, other, states, changed):
    """Exchange rows, in place, in those unbroken parts where it is likelier.

    In `_step_costs`, a whisker that is not seen counts as exchanged with the other one; the costs
    compared here are those of the names themselves.

    one, other, states : (frames,) rows of whiskers a and b, −1 where not seen; 1: to exchange
    changed : as for `_exchange_all`
    """
    last_one, last_other, t = -1, -1, 0
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
                changed[a, t:end] = changed[b, t:end] = True
            else:
                _swap(one[t:end], other[t:end])
        for i in range(t, end):
            last_one = one[i] if one[i] >= 0 else last_one
            last_other = other[i] if other[i] >= 0 else last_other
        t = end


@njit(cache=True)
def _both_seen(one, other, first):
    """The frame by which both have been seen again from the `first` one on."""
    again, seen_one, seen_other = first, False, False
    while again < len(one) and not (seen_one and seen_other):
        seen_one |= one[again] >= 0
        seen_other |= other[again] >= 0
        again += 1
    return again


@njit(cache=True, error_model="numpy")
def _cost(evidence, a, last, rows):
    """Cost of some `rows` (frames,) as whisker a's, after it was `last` seen in that row."""
    own = rows[rows >= 0]
    links = link_costs(evidence, a, _seen_before(own, last), own)
    total = 0.0
    for k in range(len(own)):
        total += evidence.appearance[own[k], a] + links[k]
    return total


@njit(cache=True)
def _swap(one, other):
    for i in range(len(one)):
        one[i], other[i] = other[i], one[i]


@njit(cache=True, error_model="numpy")
def _claimed(evidence, a, own, other, before, again):
    """States and gain as in `_best_states`, for a whisker beside a nameless line.

    Neither is exchanged before, nor where the whisker is seen `again` in the last frame.
    """
    last = _seen_before(own, before), _seen_before(other, -1)
    steps = _step_costs(evidence, a, -1, (own, other), last)
    # exchanged from the first frame on: it continues from where the whisker itself was
    if other[0] >= 0:
        first = _cost(evidence, a, before, other[:1])
        steps[0, 0, 1] = first + (evidence.nameless[own[0]] if own[0] >= 0 else 0.0)
    if again:
        steps[-1, :, 1] = np.inf
    return _best_states(steps)


@njit(cache=True)
def _seen_beside(seen, first, end):
    """The frames in which a whisker is seen last before `first`, and first from `end` on.

    They are −1 and the number of frames where it is not seen.
    """
    before, after = first - 1, end
    while before >= 0 and seen[before] < 0:
        before -= 1
    while after < len(seen) and seen[after] < 0:
        after += 1
    return before, after


@njit(cache=True)
def _claim(evidence, seen, a, rows, before, next_, changed):
    """Give rows of a nameless line to whisker a, in place, where that is likelier; whether it was.

    seen, changed : (frames,) the whisker's rows, and where they have changed
    before, next_ : the frames beside this line in which it is seen, as in `_seen_beside`
    """
    first, count = evidence.frame[rows[0]], len(rows)
    # nothing happens until the whisker is seen again: one empty frame represents all of these
    empty, again = min(next_ - first - count, 1), next_ < len(seen)
    own, other = np.full(count + empty + again, -1), np.full(count + empty + again, -1)
    own[:count], other[:count] = seen[first : first + count], rows
    if again:
        own[-1] = seen[next_]
    last = seen[before] if before >= 0 else -1
    states, gain = _claimed(evidence, a, own, other, last, again)
    if gain < LEAST_GAIN:
        return False
    for t in range(count):
        if states[t] > 0:
            seen[first + t], changed[first + t] = other[t], True
    return True


@njit(cache=True)
def _claim_runs(evidence, rows_of, cost, likely, rows, first, before, changed, untried):
    """As `_claims`, for the runs of `rows` from every `first` one to the next.

    cost : (runs, whiskers) of every name, less that of none
    likely : (runs, k) the whiskers that may claim them
    """
    for number in range(len(likely)):
        run = rows[first[number] : first[number + 1]]
        start, end = evidence.frame[run[0]], evidence.frame[run[-1]] + 1
        all_may, taken = untried[run].any(), False
        for a in likely[number]:
            if cost[number, a] >= 0 or taken:
                break
            last, next_ = _seen_beside(rows_of[a], start, end)
            near = slice(max(last, 0), next_ + 1)
            if all_may or before[a, near].any() or changed[a, near].any():
                taken = _claim(evidence, rows_of[a], a, run, last, next_, changed[a])
        untried[run] = taken


@njit(cache=True)
def _best_states(steps):
    """Exchanged or not in every frame, and the gain over nothing exchanged."""
    states, cost = likeliest_path(steps)
    return states, steps[:, 0, 0].sum() - cost
