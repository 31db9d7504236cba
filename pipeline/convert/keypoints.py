"""Key points along whiskers, as DeepLabCut and SLEAP give them, ↔ centrelines.

A few points with errors of a pixel or so become a smooth line through them: a polynomial, as a
whisker bends. The points' scatter about it is their noise, from which the line's errors follow.
"""

import re
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri

from pipeline.convert.results import lines_of_rows
from pipeline.errors import InputError, counted
from pipeline.kinematics.given_lines import is_place
from pipeline.numerics.polyline import arc_along, places_along
from pipeline.tables.centrelines import Centrelines

LEAST_SCORE = 0.6  # of a point that is used; DeepLabCut's own limit for drawing
FEWEST_POINTS = 4
HIGHEST_DEGREE = 4
USUAL_NOISE_PX = 1.0  # where too few frames show it
LEAST_NOISE_PX = 0.05
FEWEST_ROWS = 10  # from which the noise is estimated
DENSE = 400  # places along a line at which its length is taken
SHORTER = 0.97  # a path through the points is another one's right order if it is shorter by this
LAST_PART = re.compile(r"[\W_]*(\d+|base|root|follicle|mid(dle)?|tip|end)$", re.IGNORECASE)


@dataclass(frozen=True)
class KeyPoints:
    """Points of individuals (animals, instances, tracks) in every frame.

    Attributes
    ----------
    individuals, parts : names
    xy : float64 (frames, individuals, parts, 2) [px], NaN where a point is not there
    score : float64 (frames, individuals, parts), 0 to 1
    """

    individuals: tuple[str, ...]
    parts: tuple[str, ...]
    xy: np.ndarray
    score: np.ndarray


def scores_of(xy, given):
    """Scores of points at `xy` (…, 2): those `given`, 0 where there is no point.

    A point without a score is a person's, as programs give scores to their own ones only: it is 1.
    SLEAP's are heights of a peak, and may be a little more than 1.
    """
    return np.where(is_place(xy), np.fmin(given, 1.0), 0.0)


def lines_of(points: KeyPoints, settings, source, names=()) -> Centrelines:
    """Centrelines through the key points of every whisker, follicle side → tip.

    A whisker is an individual with all its points, or, where there is one individual, the parts
    whose names begin alike (C2_0, C2_1, …; C2_base, C2_mid, C2_tip). The order of the points
    along it is that of the file, unless another one makes a clearly shorter path.

    Parameters
    ----------
    names : of the whiskers, in the file's order; empty: as in the file or, if none of these is in
        the settings, those of the settings
    source : the file, for messages

    Raises
    ------
    InputError
        Where there are too few points, none is certain, or not as many names as whiskers.
    """
    whiskers = _whiskers(points)
    names = _names(tuple(whiskers), tuple(names), settings, source)
    rows, keys, information, confidence = [], [], [], []
    for k, (xy, score) in enumerate(whiskers.values()):
        if xy.shape[1] < FEWEST_POINTS:
            raise InputError(
                f"{source}: {names[k]} has {counted(xy.shape[1], 'key point')}, expected at least "
                f"{FEWEST_POINTS} along the whisker; its points' names must begin with its name"
            )
        order = _order_along(xy, score)
        xy, score = _from_face(xy[:, order], score[:, order], settings.recording.face)
        fitted = {f: fit for f in range(len(xy)) if (fit := _fit(xy[f], score[f])) is not None}
        noise = _noise([fit for _, fit, _ in fitted.values()])
        for frame, (line, (_, count, _), sure) in fitted.items():
            rows.append(line)
            keys.append((frame, k))
            information.append(np.full(len(line), count / len(line) / noise**2))
            confidence.append(sure)
    if not rows:
        raise InputError(
            f"{source}: in no frame has a whisker {FEWEST_POINTS} key points with x, y and a "
            f"score of {LEAST_SCORE} or more; look at them in the other program, or train it on"
        )
    return _with_information(lines_of_rows(names, keys, rows), information, confidence)


def _whiskers(points: KeyPoints) -> dict:
    """Name in the file → places (frames, points, 2) and scores (frames, points)."""
    if len(points.individuals) != 1:
        each = enumerate(points.individuals)
        return {name: (points.xy[:, i], points.score[:, i]) for i, name in each}
    groups = {}
    for i, part in enumerate(points.parts):
        groups.setdefault(LAST_PART.sub("", part), []).append(i)
    return {name: (points.xy[:, 0, i], points.score[:, 0, i]) for name, i in groups.items()}


def _names(found, given, settings, source):
    """The whiskers' names: those given, or found in the file, or those of the settings."""
    known = tuple(w.name for w in settings.whisker)
    if not given and (not known or set(found) <= set(known)):
        return found
    given = given or known
    if len(given) != len(found):
        raise InputError(
            f"{source}: holds {counted(len(found), 'whisker')} ({', '.join(found)}), but "
            f"{counted(len(given), 'name')} given ({', '.join(given)}); name the key points C2_0, "
            "C2_1, … in the other program, or give --names"
        )
    return given


def _order_along(xy, score):
    """Indices of a whisker's points along it.

    Programs that sort points by name mix them up: C2_10 comes before C2_2, mid before root. Such a
    path runs back and forth, and is longer than that through the points by their place along the
    whisker's main direction.
    """
    there = _is_used(xy, score)
    whole, as_given = xy[there.all(axis=1)], np.arange(xy.shape[1])
    if not len(whole):
        return as_given
    centred = whole - whole.mean(axis=1, keepdims=True)
    direction = np.linalg.svd(centred, full_matrices=False)[2][:, 0]
    place = np.einsum("fpk,fk->fp", centred, direction)
    place *= np.sign(place @ place[0])[:, None]  # a direction has no sign of its own
    by_place = np.argsort(np.median(place, axis=0), kind="stable")
    given, sorted_one = (_path(whole[:, order]) for order in (as_given, by_place))
    return by_place if sorted_one < SHORTER * given else as_given


def _path(xy) -> float:
    """Median length of the path through the points of each frame [px]."""
    return float(np.median(np.hypot(*np.diff(xy, axis=1).T).sum(axis=0)))


def _from_face(xy, score, face):
    """Points and scores of a whisker with the end first that is nearer to the face."""
    axis, sign = {"left": (0, 1), "right": (0, -1), "top": (1, 1), "bottom": (1, -1)}[face]
    used = _is_used(xy, score)
    ends = [
        (points[-1, axis] - points[0, axis]) * sign
        for points in (frame[there] for frame, there in zip(xy, used, strict=True))
        if len(points)
    ]
    turned = bool(ends) and np.median(ends) < 0
    return (xy[:, ::-1], score[:, ::-1]) if turned else (xy, score)


def _is_used(xy, score):
    """Which points (…, 2) are there and certain enough."""
    return is_place(xy) & (score >= LEAST_SCORE)


def _fit(xy, score):
    """A line's nodes 1 px apart, (misfit [px²], points, free ones), its score; None: too few."""
    used = _is_used(xy, score)
    xy, n = xy[used], int(used.sum())
    if n < FEWEST_POINTS:
        return None
    t = arc_along(xy)
    if t[-1] < n:  # all upon each other
        return None
    t /= t[-1]
    degree = min(n - 2, HIGHEST_DEGREE)
    basis = np.polynomial.legendre.legvander(2 * t - 1, degree)
    fitted, *_ = np.linalg.lstsq(basis, xy, rcond=None)
    dense = np.polynomial.legendre.legvander(np.linspace(-1, 1, DENSE), degree) @ fitted
    line = places_along(dense, np.arange(int(arc_along(dense)[-1]) + 1))
    slope = np.gradient(dense, axis=0)
    tangent = np.column_stack([np.interp(t, np.linspace(0, 1, DENSE), v) for v in slope.T])
    tangent /= np.hypot(*tangent.T)[:, None]
    away = xy - basis @ fitted
    misfit = np.sum((away[:, 0] * tangent[:, 1] - away[:, 1] * tangent[:, 0]) ** 2)
    return line, (misfit, n, n - degree - 1), float(score[used].mean())


def _noise(fits) -> float:
    """Standard deviation of a key point across the whisker [px]."""
    if len(fits) < FEWEST_ROWS:
        return USUAL_NOISE_PX
    misfit, _, free = np.array(fits, float).T
    return max(float(np.sqrt(np.median(misfit / chdtri(free, 0.5)))), LEAST_NOISE_PX)


def _with_information(lines, information, confidence) -> Centrelines:
    """The lines with what they are worth; a line through few points has no raw offsets."""
    information = np.concatenate([np.empty(0), *information]).astype(np.float32)
    lines.information, lines.se_px = information, information**-0.5
    lines.offset_px = np.zeros_like(information)
    lines.thickness_px = np.full_like(information, np.nan)
    lines.confidence = np.array(confidence, np.float32)
    return lines


def points_along(line: np.ndarray, count: int) -> np.ndarray:
    """`count` points (count, 2) of a line (n, 2), at even distances, its ends among them."""
    return places_along(line, np.linspace(0, arc_along(line)[-1], count))
