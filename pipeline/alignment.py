"""Names of a video's later part exchanged so that whiskers go on looking as they did before.

Looks are learned from the lines of a name. Where several whiskers have changed names together in
the middle of a video, all their looks are mixtures, and no exchange of two makes them better. So
looks are learned from the frames before a cut alone, and the lines after it are given the names
that suit these looks and the motion across the cut best, all at once.
"""

import numpy as np
from scipy.optimize import linear_sum_assignment

from pipeline import exchanges
from pipeline.exchanges import Evidence
from pipeline.fan_model import FanModel
from pipeline.line_motion import WEIGHT

REACH = 400  # frames before and after a cut that tell the looks
EVERY = 50  # frames after which the looks are learned anew
LEAST_ROWS = 40  # of a whisker before a cut, that tell its look
UNKNOWN = 8.0  # cost of a look that is compared with one not known
LEAST_GAIN = 5.0


def aligned(evidence: Evidence, model: FanModel, names, phase) -> np.ndarray:
    """Names (rows,) with the later parts' names exchanged at all cuts where that is likelier.

    names : (rows,), −1 for nobody
    phase : (frames,)
    """
    names = names.copy()
    for first in range(EVERY, len(phase), EVERY):
        _align_block(evidence, model, names, phase, first)
    return names


def _align_block(evidence, model, names, phase, first):
    """Exchange names, in place, from the best cut of a block of frames on."""
    starts = evidence.starts
    part = slice(starts[max(first - REACH, 0)], starts[min(first + EVERY + REACH, len(phase))])
    features, frame, named = evidence.features[part], evidence.frame[part], names[part]
    before = (frame < first) & (named >= 0)
    known = np.bincount(named[before], minlength=len(model.middle)) >= LEAST_ROWS
    if not known.any():
        return
    at = phase[frame]
    early = model.fitted(features[before], named[before], at[before])
    cost = WEIGHT * early.costs(features, at)
    cost[:, ~known] = WEIGHT * UNKNOWN
    best, cut, order = LEAST_GAIN, None, None
    last = min(first + EVERY, len(phase))
    motion = exchanges.motion_costs(evidence, names, first, last)
    later = _later_looks(cost, frame, named, first, last, len(known))
    for t in range(last - first):
        total = later[t] + motion[t]
        rows, columns = linear_sum_assignment(total)
        gain = np.trace(total) - total[rows, columns].sum()
        if gain > best:
            best, cut, order = gain, first + t, rows[np.argsort(columns)]
    if cut is not None:
        own = np.flatnonzero((evidence.frame >= cut) & (names >= 0))
        names[own] = order[names[own]]


def _later_looks(cost, frame, named, first, last, whiskers):
    """Cost (cuts, whiskers, whiskers) of the lines that are b's after the cut to look like a."""
    per_frame = np.zeros((last + REACH - first, whiskers, whiskers))
    rows = np.flatnonzero((named >= 0) & (frame >= first) & (frame < last + REACH))
    np.add.at(per_frame, (frame[rows] - first, slice(None), named[rows]), cost[rows])
    sums = np.cumsum(per_frame[::-1], axis=0)[::-1]
    out = sums[: last - first].copy()
    out[: len(sums) - REACH] -= sums[REACH : REACH + last - first]
    return out
