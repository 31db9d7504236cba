"""Two whiskers' names exchanged for the rest of a video, with their looks learned anew.

Looks are learned from the lines of a name. Where two whiskers have changed names once, in the
middle of a video, both looks are mixtures of both whiskers, and neither name fits better than the
other. So at every frame where an exchange costs little the looks are learned once more, as if the
names were exchanged from there on; two whiskers that are not mixed vary less.
"""

import numpy as np

from pipeline import exchanges
from pipeline.exchanges import Evidence
from pipeline.fan_model import FanModel
from pipeline.line_motion import WEIGHT

CHEAP = 18.0  # cost of an exchange's motion, up to which it is tried
TRIED = 4  # frames, at most, for two whiskers
APART = 8  # frames between two of them
LEAST_FRAMES = 30  # that each must be seen, on either side
LEAST_GAIN = 4.0


def recombined(evidence: Evidence, model: FanModel, names, phase) -> np.ndarray:
    """Names (rows,) after all such exchanges that make them likelier.

    names : (rows,), −1 for nobody
    phase : (frames,)
    """
    names = names.copy()
    features, frame = evidence.features, evidence.frame
    at = phase[frame]
    for a in range(len(model.middle)):
        for b in range(a):
            change = exchanges.change_costs(evidence, names, a, b)
            tried = [
                (change[t] + _gain(model, features, at, frame, names, (a, b), t), t)
                for t in _cheapest(change)
            ]
            cost, t = min(tried, default=(0.0, -1))
            if cost < -LEAST_GAIN:
                names = _exchanged(names, frame, (a, b), t)
    return names


def _cheapest(change):
    """Frames at which an exchange costs least, some frames apart."""
    out = []
    for t in np.argsort(change):
        if change[t] > CHEAP or len(out) == TRIED:
            break
        if all(abs(t - other) >= APART for other in out):
            out.append(int(t))
    return out


def _gain(model, features, at, frame, names, pair, t):
    """Change of the looks' cost, with looks learned anew from two whiskers' rows as exchanged."""
    rows = np.flatnonzero(np.isin(names, pair))
    later = frame[rows] >= t
    own = names[rows] == pair[0]
    parts = later & own, later & ~own, ~later & own, ~later & ~own
    if min(part.sum() for part in parts) < LEAST_FRAMES:
        return np.inf
    now = _cost(model, pair, features[rows], at[rows], names[rows])
    then = _exchanged(names[rows], frame[rows], pair, t)
    return _cost(model, pair, features[rows], at[rows], then) - now


def _cost(model, pair, features, at, names):
    """Cost of two whiskers' rows by looks that are learned from them."""
    two = FanModel(
        model.middle[list(pair)], model.slope[list(pair)], model.sd[list(pair)], model.least_sd
    )
    number = (names == pair[1]).astype(int)
    cost = two.fitted(features, number, at).costs(features, at)
    return WEIGHT * float(cost[np.arange(len(number)), number].sum())


def _exchanged(names, frame, pair, t):
    """The names with two exchanged before or from frame t on, whichever are fewer rows."""
    a, b = pair
    rows = np.isin(names, pair)
    part = rows & (frame >= t)
    if 2 * part.sum() > rows.sum():
        part = rows & (frame < t)
    out = names.copy()
    out[part & (names == a)] = b
    out[part & (names == b)] = a
    return out
