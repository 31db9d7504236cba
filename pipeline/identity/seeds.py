"""First appearance of each whisker of a crowd, and whiskers that were overlooked.

A long track that matches no whisker is taken for another whisker.
"""

import numpy as np

from pipeline.identity import label_swaps, motion_model
from pipeline.identity.appearance import FanModel, medians
from pipeline.identity.features import ANGLE, N_FEATURES

MOST_NEW = 3  # whiskers at a time
MOST = 20  # whiskers


def with_more(model: FanModel, names, lines) -> tuple[FanModel, np.ndarray]:
    """The model and the names with a few more whiskers, from long tracks without a name.

    lines : `TrackedLines`, whose limits say how long such a track is
    """
    features, frame, track = lines.features, lines.frame, lines.track
    known = len(model.middle)
    unnamed, first = label_swaps.runs(names, track, frame)
    length = np.diff(first)
    longest = np.argsort(-length, kind="stable")[: max(min(MOST_NEW, MOST - known), 0)]
    names = names.copy()
    new = [
        unnamed[first[k] : first[k + 1]] for k in longest if length[k] >= lines.limits.long_track
    ]
    for number, rows in enumerate(new):
        names[rows] = known + number
    if not new:
        return model, names
    phase = motion_model.phases(model, features, frame, np.where(names < known, names, -1))
    weight = motion_model.newness(np.diff(phase, prepend=np.nan), lines.limits)
    rows = np.concatenate(new)
    more = first_appearance(
        features[rows], names[rows] - known, phase[frame[rows]], weight[frame[rows]],
        len(new), model.least_sd,
    )  # fmt: skip
    parts = [
        np.concatenate([getattr(model, part), getattr(more, part)])
        for part in ("middle", "slope", "sd")
    ]
    return FanModel(*parts, model.least_sd), names


def appearance_of(lines, names, least_sd) -> FanModel:
    """The model of whiskers, from lines that are known to be theirs; the phases are not yet known.

    lines : `TrackedLines`; names : (rows,) −1 for none; least_sd : (6,) of the features
    """
    turn = motion_model.common_turns(lines.features, lines.frame, lines.before)
    phase, weight = np.cumsum(turn), motion_model.newness(turn, lines.limits)
    phase -= np.median(phase)
    known = np.flatnonzero(names >= 0)
    frame = lines.frame[known]
    return first_appearance(
        lines.features[known], names[known], phase[frame], weight[frame], names.max() + 1, least_sd
    )


def first_appearance(features, whisker, phase, weight, count, least_sd):
    """Model of `count` whiskers from rows of known whiskers, phases and weights."""
    middle = np.empty((count, N_FEATURES))
    slope = np.zeros((count, N_FEATURES))
    slope[:, ANGLE] = 1.0
    level = features - slope[whisker] * phase[:, None]
    order = np.argsort(whisker, kind="stable")
    starts = np.searchsorted(whisker[order], np.arange(count + 1))
    for j in range(N_FEATURES):
        middle[:, j] = medians(level[order, j], starts)
    sd = np.tile(3.0 * least_sd, (count, 1))
    return FanModel(middle, slope, sd, least_sd).fitted(features, whisker, phase, weight)
