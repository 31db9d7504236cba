"""Base angle and follicle of every row: the base is extrapolated, and bends are regularised.

The base is measured beyond the fur (`base_curves`), and extrapolated to the follicle. The bend
seen in one frame may be exact (a clean picture, a long whisker) or worthless (codec, fur, a few
dozen pixels). So three numbers of each row are shrunk towards their usual values for this whisker
at this angle, the more so the noisier they are in this video: the bend, its change along the
whisker, and the distance at which the curve passes the usual place of the follicle.

- Usual values and their spread are learnt from all frames (expectation–maximisation); the spread
  is at most what touch and roll can do to a whisker.
- Noise that changes from frame to frame is distinguished from what lasts by the covariance of
  neighbouring frames, and smoothed (Kalman). Where the bend jumps by more than its noise, as in a
  touch, nothing is smoothed.

The angle of the visible part is neither shrunk nor smoothed in time.
"""

from dataclasses import astuple, dataclass, replace

import numpy as np
import pandas as pd
from numba import njit

from pipeline.kinematics.base_curves import FEWEST_ROWS, BaseCurves, fit_base_curves, lay_to
from pipeline.kinematics.resampled import PART_ROWS
from pipeline.numerics.angles import continuous, wrap_angle
from pipeline.numerics.cholesky import factorise, invert
from pipeline.numerics.robust import robust_sd
from pipeline.numerics.runs import evenly, parts
from pipeline.session.parameters import KinematicsParams

BASE_COLUMNS = (
    "follicle_x_px", "follicle_y_px", "base_angle_deg", "base_angle_se_deg",
    "visible_angle_deg", "visible_angle_se_deg",
)  # fmt: skip
LEARNING_ROWS = 400
PASSES = 30  # of expectation–maximisation
LEAST_SUDDEN = 0.05  # share of the noise that changes from frame to frame, at least
LAGS = (2, 4)  # frames: what is alike so far apart lasts; neighbours may share noise
STAYS = (0.9, 0.99)  # limits of the share of what lasts that is left in the next frame
LEAST_TRUE = 0.1  # share of the spread that is true, not noise, at least
JUMP_SD = 10.0  # standard errors: a larger change is a jump
FREEDOM = 5.0  # degrees of freedom of Student's t, by which outliers count less
LEAST_SWING = 0.1  # rad: in less, the bend's dependence on the angle is unknown
LEAST_SD = 1e-4  # rad, of usual values
NO_DIRECTION = np.pi / 2  # rad: an angle of such a standard error says nothing
BENDS_PER_M = 40.0  # SD of what touch and roll may bend a mouse's or rat's whisker by, and …
BENDS_PER_M2 = 5e3  # … how that may change along it: to nothing at a contact 8 mm away
GROWN_PER_M, GROWN_PER_M2 = 100.0, 2e4  # SDs at rest between whiskers, for a scale wrong by two


@dataclass(frozen=True)
class Base:
    """Base of one whisker, (rows,) each; NaN where a row is too short, or does not show it.

    Attributes
    ----------
    angle, angle_se : at the follicle, counter-clockwise, continuous in time [rad]
    visible, visible_se : mean direction over the visible window, likewise [rad]
    x, y : follicle [m, y up]
    """

    angle: np.ndarray
    angle_se: np.ndarray
    visible: np.ndarray
    visible_se: np.ndarray
    x: np.ndarray
    y: np.ndarray


def add_bases(frames, store, pixels_per_m: float, params: KinematicsParams) -> pd.DataFrame:
    """The table of FRAME_COLUMNS with base angle and follicle of all whiskers in `store`.

    Parameters
    ----------
    frames : a row per frame and whisker
    store : `StationStore` of the whole video
    pixels_per_m : scale
    params : the room's parameters
    """
    new = {name: frames[name].to_numpy(float, copy=True) for name in BASE_COLUMNS}
    for name in store.names:
        places = store.of(name)
        if len(places) == 0:
            continue
        base = measure_base(places, pixels_per_m, params)
        follicle = pixels_per_m * base.x, -pixels_per_m * base.y
        angles = map(np.degrees, (base.angle, base.angle_se, base.visible, base.visible_se))
        rows = rows_of(frames, name, places.frame)
        for column, values in zip(BASE_COLUMNS, (*follicle, *angles), strict=True):
            new[column][rows] = values
    return frames.assign(**new)


def rows_of(frames, name: str, numbers) -> np.ndarray:
    """Places of a whisker's frames of these `numbers` in the table of FRAME_COLUMNS."""
    rows = np.flatnonzero(frames["whisker"].to_numpy(object) == name)
    frame = frames["frame"].to_numpy()[rows]
    order = np.argsort(frame, kind="stable")
    return rows[order[np.searchsorted(frame, numbers, sorter=order)]]


def measure_base(places, pixels_per_m: float, params: KinematicsParams) -> Base:
    """Base angle and follicle of one whisker's `Stations`, rows in the order of their frames.

    Very long recordings are measured part by part.
    """
    every = [
        _measure_part(places.rows(part), pixels_per_m, params)
        for part in parts(len(places), PART_ROWS)
    ]
    return _continuous(Base(*map(np.concatenate, zip(*map(astuple, every), strict=True))))


def _continuous(base) -> Base:
    """The base with full turns added so that it is continuous in time, the visible part likewise.

    What few pixels show may lie several turns away: their curve is extrapolated.
    """
    known = np.isfinite(base.angle)
    angle = continuous(np.where(known, base.angle, base.visible))
    visible = angle + wrap_angle(base.visible - angle)
    return replace(base, angle=np.where(known, angle, np.nan), visible=visible)


def _measure_part(places, pixels_per_m, params) -> Base:
    """`measure_base` of a part of a recording; full turns may be missing."""
    out = Base(*np.full((6, len(places)), np.nan))
    curves = fit_base_curves(places, pixels_per_m, params)
    if curves is None:
        return out
    rows = np.flatnonzero(np.isfinite(curves.x))
    if len(rows) == 0:
        return out
    own = curves.rows(rows)
    own.shape[:, 0] = continuous(own.shape[:, 0])
    base = _regularised(own, places.frame[rows], 1e-3 * params.hidden_most_mm)
    base_is, view_is = (se < NO_DIRECTION for se in (base.angle_se, base.visible_se))
    for name, values in vars(base).items():
        known = view_is if name.startswith("visible") else base_is
        getattr(out, name)[rows[known]] = values[known]
    return out


# Extrapolation -------------------------------------------------------------------------------


def _regularised(curves: BaseCurves, frame, farthest) -> Base:
    """Curves shrunk towards usual ones: first by their bend, then also by the follicle's place."""
    scale = curves.half ** np.array([1, 2])
    stiff = 1 / (np.array([BENDS_PER_M, BENDS_PER_M2]) * scale) ** 2
    q = _as_grown(curves, (np.array([GROWN_PER_M, GROWN_PER_M2]) * scale) ** 2)
    bend = np.broadcast_to(np.eye(4)[1:], (len(q), 3, 4))
    first, _ = _drawn(q, curves.root, bend, np.zeros((len(q), 3)), stiff, frame)
    z, aside = _beside_anchor(curves, first, farthest)
    across = np.stack([np.ones_like(z), z, z**2 / 2, z**3 / 6], axis=1)
    known = np.zeros((len(q), 4))
    known[:, 1] = aside - (across * first).sum(axis=1)
    features = np.concatenate([bend[:, :1], across[:, None], bend[:, 1:]], axis=1)
    last, root = _drawn(q, curves.root, features, known, np.append(0.0, stiff), frame)
    x, y, angle = _curves_at(curves, last, z)
    zero, one = np.zeros_like(z), np.ones_like(z)
    at_base, in_view = (np.column_stack([zero, one, *t]) for t in ((z, z**2 / 2), (zero, one / 6)))
    visible = (in_view * last).sum(axis=1)
    return Base(angle, _error(at_base, root), visible, _error(in_view, root), x, y)


def _as_grown(curves, variance):
    """Parameters (rows, 4) less the error that all of them are likely to share.

    Such as where the line begins on another whisker, so that the base seems to be bent as no
    whisker grows. The mean of all rows is taken to be as uncertain as one row.

    variance : (2,) of the bend and its change, from whisker to whisker
    """
    q = np.column_stack([np.zeros(len(curves.shape)), curves.shape])
    root = _usual_root(curves.root)
    error = root @ root.T
    gain = error[:, 2:] @ np.linalg.inv(error[2:, 2:] + np.diag(variance))
    return q - gain @ np.median(q[:, 2:], axis=0)


def _beside_anchor(curves, q, farthest):
    """Where on each curve the follicle is, and how far the curve passes beside its usual place.

    In half-widths of the window, from its middle; (rows,) each.
    """
    z = np.full(len(q), -curves.middle / curves.half)
    x, y, angle = _curves_at(curves, q, z)
    anchor_x, anchor_y = np.median(x), np.median(y)
    along = (anchor_x - x) * np.cos(angle) + (anchor_y - y) * np.sin(angle)
    z = np.clip(z + along / curves.half, -1 - (curves.middle + farthest) / curves.half, -1.0)
    x, y, angle = _curves_at(curves, q, z)
    aside = (y - anchor_y) * np.cos(angle) - (x - anchor_x) * np.sin(angle)
    return z, aside / curves.half


def _curves_at(curves, q, z):
    """x, y [m] and angle [rad] at `z` of curves of parameters `q` (rows, 4)."""
    aside = curves.half * q[:, 0]
    x = curves.x - aside * np.sin(curves.shape[:, 0])
    y = curves.y + aside * np.cos(curves.shape[:, 0])
    return lay_to(x, y, q[:, 1:], curves.half, z)


def _error(weights, root):
    """Standard error of a linear measure of parameters of covariance root rootᵀ, (rows,)."""
    return np.linalg.norm(weights[:, None] @ root, axis=(1, 2))


def _usual_root(root):
    """Upper triangular root (k, k) of the covariance whose inverse is the mean of all rows'.

    root : (rows, k, k) of theirs, upper triangular or its transpose
    """
    white = np.linalg.inv(root).reshape(-1, root.shape[2])
    return np.linalg.inv(np.linalg.qr(white / np.sqrt(len(root)), mode="r"))


# What is usual -------------------------------------------------------------------------------


def _drawn(q, root, design, constant, stiff, frame):
    """Parameters shrunk towards usual values, and a root of their covariance.

    Parameters
    ----------
    q, root : (rows, 4), (rows, 4, 4), as measured
    design, constant : features with usual values are `design` q + `constant`, (rows, features);
    the
        first is the angle, on which the others depend
    stiff : (features − 1,) 1/variance that the spread of the others has at least
    frame : (rows,) numbers of the frames
    """
    seen = np.einsum("nab,nb->na", design, q) + constant
    errors = design @ root
    mean, spread = _usual(seen, errors @ errors.transpose(0, 2, 1))
    spread[0, 0] += LEAST_SWING**2
    inverse = np.linalg.inv(spread)
    rest = np.linalg.inv(inverse[1:, 1:] + np.diag(stiff))
    by_angle = -rest @ inverse[1:, 0]
    off = seen[:, 1:] - mean[1:] - (seen[:, :1] - mean[0]) * by_angle
    part = design[:, 1:] - by_angle[:, None] * design[:, :1]
    own, upper = np.linalg.qr((part @ root).transpose(0, 2, 1))
    likely, left = _denoised(off, upper.transpose(0, 2, 1), rest, frame)
    gain = root @ own @ np.linalg.inv(upper).transpose(0, 2, 1)
    drawn = q - np.einsum("nab,nb->na", gain, off - likely)
    beside = root - root @ own @ own.transpose(0, 2, 1)  # errors that the features do not have
    return drawn, np.concatenate([beside, gain @ left], axis=2)


def _usual(seen, noise):
    """Mean and covariance of features that are `seen` (rows, k) with `noise` (rows, k, k)."""
    few = evenly(len(seen), LEARNING_ROWS)
    seen, noise, k = seen[few], noise[few], seen.shape[1]
    mean = np.median(seen, axis=0)
    if len(seen) < FEWEST_ROWS:
        return mean, np.eye(k)
    spread = np.diag(robust_sd(seen, mean, axis=0) ** 2 + LEAST_SD**2)
    for _ in range(PASSES):
        mean, spread = _expected(seen, noise, mean, spread)
    return mean, spread


@njit(cache=True)
def _expected(seen, noise, mean, spread):
    """One pass of `_usual`: mean and covariance of the likely values, given the last ones."""
    n, k = seen.shape
    new, total_mean, weights = np.zeros((k, k)), np.zeros(k), 0.0
    total, lower, inverse, gain = np.zeros((4, k, k))
    off, likely = np.zeros((2, k))
    for i in range(n):
        for a in range(k):
            off[a] = seen[i, a] - mean[a]
            for b in range(k):
                total[a, b] = noise[i, a, b] + spread[a, b]
        factorise(total, k, lower)
        invert(lower, k, inverse)
        misfit = 0.0
        for a in range(k):
            likely[a] = 0.0
            for b in range(k):
                gain[a, b] = 0.0
                for c in range(k):
                    gain[a, b] += spread[a, c] * inverse[c, b]
                likely[a] += gain[a, b] * off[b]
                misfit += off[a] * inverse[a, b] * off[b]
        weight = (FREEDOM + k) / (FREEDOM + misfit)
        weights += weight
        for a in range(k):
            total_mean[a] += weight * likely[a]
            for b in range(k):
                new[a, b] += spread[a, b] + weight * likely[a] * likely[b]
                for c in range(k):
                    new[a, b] -= gain[a, c] * spread[c, b]
    return mean + total_mean / weights, new / n + LEAST_SD**2 * np.eye(k)


# Noise from frame to frame -------------------------------------------------------------------


def _denoised(off, root, spread, frame):
    """Likely true deviations from usual values, which are `off` (rows, k), and their errors' root.

    They are separated in the directions in which noise, of which `root` is a root (rows, k, k),
    and spread are independent.
    """
    lower = _usual_root(root)
    white = np.linalg.inv(lower)
    size, axes = np.linalg.eigh(white @ spread @ white.T)
    to, back = axes.T @ white, lower @ axes
    channels, share = off @ to.T, ((to @ root) ** 2).sum(axis=2)
    likely, left = np.empty_like(channels), np.empty_like(channels)
    for k in range(len(size)):
        likely[:, k], left[:, k] = _channel(channels[:, k], share[:, k], max(size[k], 1e-9), frame)
    return likely @ back.T, back * np.sqrt(left)[:, None]


def _channel(seen, noise, true, frame):
    """Values of variance `true` that are `seen` with `noise`, and what is left of it.

    Seen is the true value, an error that lasts and an error of the moment. The first two change
    as slowly as the channel is seen to, and what they have in common is shared out between them.
    What is left includes the error of the usual, which is a mean of all rows.
    """
    typical = np.median(noise)
    lasting, stays = _lasting(seen, frame)
    if np.isfinite(lasting):
        moment = max(_variance(seen) - lasting, 0.0)
        true = np.clip(lasting, LEAST_TRUE * true, true)
        wrong = np.clip(lasting - true, 0.0, (1 - LEAST_SUDDEN) * typical)
    else:
        wrong = moment = 0.0
    part, sudden = true / (true + wrong), noise * max(1 - wrong / typical, moment / typical)
    slow, left = _smooth(seen, sudden, true + wrong, stays, np.asarray(frame, float))
    of_usual = (np.median(sudden) + (true + wrong) * (1 + stays) / (1 - stays)) / len(seen)
    return part * slow, part**2 * left + true * (1 - part) + of_usual


def _lasting(seen, frame):
    """Variance of what lasts for more than a few frames, and the part that stays in each frame.

    NaN and 0 where too few frames follow each other.
    """
    early, late = (_covariance(seen, frame, lag) for lag in LAGS)
    if np.isnan(early + late):
        return np.nan, 0.0
    share = max(late, 0.0) / early if early > 0 else 0.0
    stays = np.clip(share ** (1 / (LAGS[1] - LAGS[0])), *STAYS)
    return max(early, 0.0) / stays ** LAGS[0], stays


def _covariance(seen, frame, lag):
    """Robust covariance of values `lag` frames apart; NaN where there are too few."""
    later = np.searchsorted(frame, frame + lag)
    at = np.flatnonzero(np.append(frame, -1)[later] == frame + lag)
    if len(at) < FEWEST_ROWS:
        return np.nan
    early, late = seen[at], seen[later[at]]
    return (_variance(early + late) - _variance(early - late)) / 4


def _variance(values):
    return robust_sd(values, about=0.0) ** 2


@njit(cache=True)
def _smooth(seen, noise, variance, stays, frame):
    """Kalman smoother of a stationary process that keeps `stays` of itself from frame to frame.

    Where it jumps it begins anew. Returns its mean and variance, (rows,) each, for `seen` with
    `noise`, a variance per row.
    """
    n = len(seen)
    mean, var, ahead, spread, keep = np.empty((5, n))
    m, v = 0.0, variance
    for i in range(n):
        keep[i] = stays ** (frame[i] - frame[i - 1]) if i else 0.0
        m, v = keep[i] * m, keep[i] ** 2 * v + variance * (1 - keep[i] ** 2)
        if (seen[i] - m) ** 2 > JUMP_SD**2 * (v + noise[i]):
            keep[i], m, v = 0.0, 0.0, variance
        ahead[i], spread[i] = m, v
        gain = v / (v + noise[i])
        m, v = m + gain * (seen[i] - m), (1 - gain) * v
        mean[i], var[i] = m, v
    for i in range(n - 2, -1, -1):
        back = var[i] * keep[i + 1] / spread[i + 1]
        mean[i] += back * (mean[i + 1] - ahead[i + 1])
        var[i] += back**2 * (var[i + 1] - spread[i + 1])
    return mean, var
