"""Cost of a whisker's continuing as a given line in the next frame, by how lines move."""

from typing import NamedTuple

import numpy as np
from numba import njit

from pipeline.identity.features import N_FEATURES

TAIL = 4  # degrees of freedom of a motion's distribution: jumps happen
SEEN_AGAIN = 6.0  # cost of a whisker that is seen again after a gap
TAKEN = 15.0  # cost of a line that was another's, for a whisker that had none or a brief one


class Evidence(NamedTuple):
    """All that names are inferred from, in one tuple for the compiled functions.

    Attributes
    ----------
    features : float64 (rows, 6)
    drift : (rows, 6) what a row's features are expected to change by to the next frame, beside
        the turn of all
    appearance : (rows, whiskers) cost of every name by the line's own appearance
    nameless : (rows,) cost of none of these names
    frame : int64 (rows,), from 0, ascending
    phase : (frames,) turn of all whiskers
    slope : (whiskers, 6) change of the features with the phase
    sd, fast : (6,) of the motion from a frame to the next, and what is added to it per turn
    most_sd : (whiskers, 6) of the motion over a gap, at most
    before : (rows,) row of the same track in the frame before, −1 for none
    rename_cost : (rows,) cost of a name that is not that row's; up to TAKEN, none where lines that
        are both seen change places
    lasting : (rows,) whether the line is part of a long steady motion
    """

    features: np.ndarray
    drift: np.ndarray
    appearance: np.ndarray
    nameless: np.ndarray
    frame: np.ndarray
    phase: np.ndarray
    slope: np.ndarray
    sd: np.ndarray
    fast: np.ndarray
    most_sd: np.ndarray
    before: np.ndarray
    rename_cost: np.ndarray
    lasting: np.ndarray


@njit(cache=True, error_model="numpy")
def link_costs(evidence, a, before, now):
    """Cost (n,) of whisker `a` to go on from every row `before` to the row `now`.

    All in one call: to hand on the arrays of the evidence takes longer than a cost.

    before, now : (n,) rows, −1: not seen
    """
    e = evidence
    out = np.zeros(len(now))
    for k in range(len(now)):
        i, j = before[k], now[k]
        if j < 0:
            continue
        gap = abs(e.frame[j] - e.frame[i])
        renamed = e.rename_cost[j] if e.before[j] >= 0 and e.before[j] != i else 0.0
        if i < 0:
            out[k] = SEEN_AGAIN + renamed
            continue
        if renamed <= TAKEN and gap == 1 and (e.lasting[i] or not e.lasting[j]):
            renamed = 0.0  # lines that lie on each other may have changed places
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
        out[k] = cost + (SEEN_AGAIN if gap > 1 else 0.0) + renamed
    return out
