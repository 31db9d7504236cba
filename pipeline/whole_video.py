"""The tracer's lines of a whole video, named anew: who is who is decided when all is seen.

Lines wait in a file meanwhile; in memory there are a few numbers per line.
"""

import tempfile
from collections.abc import Iterable, Iterator
from dataclasses import fields, replace
from itertools import pairwise

import numpy as np
from scipy.ndimage import uniform_filter1d

from pipeline import naming
from pipeline.fan_model import FanModel, learn
from pipeline.line_features import ANGLE, THICKNESS, line_features, sample_features
from pipeline.records import Centrelines

FEWEST_FRAMES = 20  # from which there is something to learn
LEARN_FRAMES = 600  # of the video, that the whiskers' looks are learned from
LEAST_MM = 0.08  # standard deviation of a place along the face
LEAST_SD = np.array([np.nan, np.radians(1.5), 0.05, 0.03, 0.01, 0.01])
LEAST_MOTION_MM = 0.02
LEAST_MOTION = np.array([np.nan, np.radians(0.4), 0.02, 0.01, 0.004, 0.004])
SURE = 0.9  # probability of a name, below which it counts as not known
LOOK_SURE = 0.8  # probability of a name by the looks alone, frame by frame, over LOOK_FRAMES
LOOK_FRAMES = 21
THICK = 3.0  # standard deviations: a thicker line lies on two whiskers
UNKNOWN = 0.4  # confidence is lowered to this part where a name is not known


def settled(chunks: Iterable[Centrelines], roster, ruler, pixels_per_m) -> Iterator[Centrelines]:
    """Hand on the chunks of a video with the names that suit the whole of it best.

    Parameters
    ----------
    chunks : as the tracer named them, in order
    roster : the `Slot`s that they are named after
    ruler : `identities.Ruler` of the face
    """
    with tempfile.TemporaryFile() as file:
        found, count = [], 0
        for chunk in chunks:
            _store(chunk, file)
            found.append((chunk.frame, chunk.whisker, line_features(chunk, ruler)))
            count += 1
        if not found:
            return
        frame, whisker, features = (np.concatenate(each) for each in zip(*found, strict=True))
        named, sure = whisker, np.ones(len(frame))
        if len(np.unique(frame)) >= FEWEST_FRAMES:
            samples = [sample_features(slot, ruler) for slot in roster]
            named, sure = names(frame, whisker, features, samples, pixels_per_m)
        file.seek(0)
        first = 0
        for _ in range(count):
            chunk = _load(file)
            own = slice(first, first + len(chunk))
            first += len(chunk)
            trust = np.where(sure[own] < SURE, UNKNOWN, 1.0)
            yield replace(
                chunk,
                whisker=named[own].astype(np.int32),
                confidence=(chunk.confidence * trust).astype(np.float32),
            )


def names(frame, whisker, features, samples, pixels_per_m):
    """Name of every line (rows,) and how sure it is (rows,), 0 to 1.

    Parameters
    ----------
    frame, whisker : (rows,) the tracer's names
    features : (rows, 6) of `line_features`
    samples : per whisker, dict of sample frame → features, from the roster
    """
    order = np.lexsort((whisker, frame))
    frame, tracks, features = frame[order], whisker[order].astype(int), features[order]
    starts = np.append(np.flatnonzero(np.diff(frame, prepend=-2)), len(frame))
    scale = 1e-3 * pixels_per_m
    least = LEAST_SD.copy()
    least[0] = max(LEAST_MM * scale, 0.4)
    model = FanModel.first(samples, least)
    model = learn(model, *_some(features, tracks, starts))
    guess = model.phases_of(features[:, ANGLE], tracks, starts)
    phase = np.repeat(model.phases(features, starts, guess), np.diff(starts))
    cost = model.costs(features, phase)
    blocks, rows_of = naming.blocks_of(
        features,
        cost,
        frame,
        tracks,
        _motion_sd(features, frame, tracks, scale),
    )
    named, sure = tracks.copy(), np.ones(len(frame))
    for rows, way, probable in zip(rows_of, *naming.ways(blocks), strict=True):
        for lines, name, p in zip(rows, way, probable, strict=True):
            named[lines], sure[lines] = name, p
    sure[_double(model, features, phase, named)] = 0.0
    sure[_by_look(cost, named) < LOOK_SURE] = 0.0
    back = np.empty(len(order), int)
    back[order] = np.arange(len(order))
    return named[back], sure[back]


def _double(model, features, phase, named):
    """Which lines are so thick that they lie on two whiskers, bool (rows,)."""
    expected = model.middle[named, THICKNESS] + model.slope[named, THICKNESS] * phase
    return features[:, THICKNESS] - expected > THICK * model.sd[named, THICKNESS]


def _by_look(cost, named):
    """Probability of the names by single frames' looks, averaged over LOOK_FRAMES, (rows,)."""
    like = np.exp(cost.min(axis=1, keepdims=True) - cost)
    own = like[np.arange(len(named)), named] / like.sum(axis=1)
    out = np.empty(len(named))
    for name in np.unique(named):
        rows = np.flatnonzero(named == name)
        out[rows] = uniform_filter1d(own[rows], min(LOOK_FRAMES, len(rows)))
    return out


def _some(features, whisker, starts):
    """Rows of LEARN_FRAMES frames, evenly over the video, and where each begins."""
    frames = np.unique(np.linspace(0, len(starts) - 2, LEARN_FRAMES).astype(int))
    rows = np.concatenate([np.arange(starts[k], starts[k + 1]) for k in frames])
    counts = (starts[1:] - starts[:-1])[frames]
    return features[rows], whisker[rows], np.append(0, np.cumsum(counts))


def _motion_sd(features, frame, whisker, scale):
    """SD of what a line's features change from frame to frame, less the turn of all, (6,)."""
    order = np.lexsort((frame, whisker))
    step = np.diff(features[order], axis=0)
    then = frame[order][1:]
    after = (np.diff(frame[order]) == 1) & (np.diff(whisker[order]) == 0)
    step, then = step[after], then[after]
    by_frame = np.argsort(then, kind="stable")
    step, then = step[by_frame], then[by_frame]
    starts = np.append(np.flatnonzero(np.diff(then, prepend=-2)), len(then))
    for a, b in pairwise(starts):
        step[a:b, ANGLE] -= np.median(step[a:b, ANGLE])
    least = LEAST_MOTION.copy()
    least[0] = max(LEAST_MOTION_MM * scale, 0.15)
    seen = np.isfinite(step).sum(axis=0) > 0
    sd = least.copy()
    sd[seen] = np.maximum(1.4826 * np.nanmedian(np.abs(step[:, seen]), axis=0), least[seen])
    return sd


def _store(chunk: Centrelines, file) -> None:
    for each in fields(Centrelines):
        np.save(file, np.asarray(getattr(chunk, each.name)), allow_pickle=True)


def _load(file) -> Centrelines:
    values = {}
    for each in fields(Centrelines):
        value = np.load(file, allow_pickle=True)
        values[each.name] = None if value.dtype == object else value
    values["names"] = tuple(str(name) for name in values["names"])
    return Centrelines(**values)
