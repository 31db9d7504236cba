"""Chains of states: the likeliest path (Viterbi), and the probability of every state.

`steps` (n, states, states) holds minus log probabilities: `steps[t, a, b]` that of going from
state a at t − 1 to state b at t, together with what was observed at t. At t = 0 only the row
`steps[0, 0]` counts.
"""

import numpy as np
from numba import njit


@njit(cache=True)
def likeliest_path(steps):
    """The likeliest states (n,), and minus log probability of the path.

    Of equally likely paths, the one that stays in its state.
    """
    n, size = len(steps), steps.shape[2]
    came = np.zeros((n, size), np.int64)
    cost, new = steps[0, 0].copy(), np.empty(size)
    for t in range(1, n):
        for now in range(size):
            new[now], came[t, now] = cost[now] + steps[t, now, now], now
            for before in range(size):
                other = cost[before] + steps[t, before, now]
                if other < new[now]:
                    new[now], came[t, now] = other, before
        cost, new = new, cost
    states = np.zeros(n, np.int64)
    states[-1] = np.argmin(cost)
    for t in range(n - 1, 0, -1):
        states[t - 1] = came[t, states[t]]
    return states, cost.min()


@njit(cache=True)
def state_probabilities(steps):
    """Probability of every state at every time (n, states), of all paths together."""
    n, size = len(steps), steps.shape[2]
    forward, backward = np.empty((n, size)), np.zeros((n, size))
    forward[0] = steps[0, 0]
    for t in range(1, n):
        for now in range(size):
            forward[t, now] = _sum_of(forward[t - 1] + steps[t, :, now])
    for t in range(n - 1, 0, -1):
        for before in range(size):
            backward[t - 1, before] = _sum_of(backward[t] + steps[t, before])
    out = np.empty((n, size))
    for t in range(n):
        both = forward[t] + backward[t]
        out[t] = np.exp(_sum_of(both) - both)
    return out


@njit(cache=True)
def _sum_of(parts):
    """Minus log of the sum of probabilities, given as minus logs."""
    least = np.argmin(parts)
    low, rest = parts[least], 0.0
    for k in range(len(parts)):
        if k != least:
            rest += np.exp(low - parts[k])
    return low - np.log1p(rest)


@njit(cache=True)
def two_states(log_odds, starts, ends):
    """Steps of a chain of two states, off (0) and on (1).

    Parameters
    ----------
    log_odds : (n,) log of the likelihood of an observation when on over that when off
    starts, ends : probability of a change at each time, off → on and on → off
    """
    n = len(log_odds)
    steps = np.empty((n, 2, 2))
    on = starts / (starts + ends)
    for t in range(n):
        odds = min(max(log_odds[t], -600.0), 600.0)
        steps[t, 0, 0], steps[t, 0, 1] = -np.log(1 - starts), -np.log(starts) - odds
        steps[t, 1, 0], steps[t, 1, 1] = -np.log(ends), -np.log(1 - ends) - odds
        if t == 0:
            steps[0, 0, 0], steps[0, 0, 1] = -np.log(1 - on), -np.log(on) - odds
    return steps
