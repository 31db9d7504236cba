"""How lines move from frame to frame: the turn of all whiskers, and each one's own motion."""

import numpy as np
from numba import njit
from scipy.ndimage import median_filter

from pipeline.identity.appearance import LEAST_SLOPE, FanModel, medians
from pipeline.identity.features import ANGLE, BEND, N_FEATURES
from pipeline.identity.links import TAKEN, Evidence, link_costs
from pipeline.identity.tracked_lines import TrackedLines
from pipeline.numerics.robust import sd_about_0

WEIGHT = 0.3  # of the appearance in one frame: errors of neighbouring frames are alike
QUIET = 0.02  # weight of a frame in which the whiskers rest: all such frames show the same
STRANGER = 20.0  # cost of an appearance that is no whisker's
LEAST_MOTION = np.array([0.002, np.radians(0.15), 0.01, 0.005, 0.001, 0.001])
FEWEST = 50  # motions needed to estimate their spread
FARTHEST = 4.0  # standard deviations: what is farther off is a jump
RENAMED = 40.0  # cost of a new name for a line that is seen to go on
SLOW, QUICK = 0.5, 0.8  # quantiles of the turn, below and above which motions are compared


def evidence_of(model: FanModel, lines: TrackedLines, phase, appearance=1.0) -> Evidence:
    """The `Evidence` from which the names of a video's lines are inferred.

    Parameters
    ----------
    model : the whiskers' appearance
    lines : tracks as traced
    phase : (frames,) at which the lines are looked at
    appearance : how much appearance counts beside motions
    """
    features, frame, before, limits = lines.features, lines.frame, lines.before, lines.limits
    cost = model.costs(features, phase[frame])
    slope = np.nan_to_num(model.slope)
    likely = cost.argmin(axis=1)
    turn = common_turns(features, frame, before, np.maximum(slope[likely, ANGLE], LEAST_SLOPE))
    step = _steps(features, before) - slope[likely] * turn[frame, None]
    drift, sd, fast = _spread(step, before, np.abs(turn[frame]))
    usual_sd = [medians(sd, np.array([0, len(sd)]))[0] for sd in model.sd.T]
    most = np.sqrt(2) * np.where(np.isfinite(model.sd), model.sd, usual_sd)
    weight = appearance * WEIGHT * newness(turn, limits)[frame]
    steady = _goes_on(frame, before, step[:, ANGLE], turn, limits.own_turn)
    alone = _alone(features, frame, before, limits.alone)
    evidence = Evidence(
        features=features,
        drift=drift,
        appearance=weight[:, None] * cost,
        nameless=weight * STRANGER,
        frame=frame.astype(np.int64),
        phase=np.cumsum(turn),
        slope=slope,
        sd=sd,
        fast=fast,
        most_sd=np.nan_to_num(most, nan=1.0),
        before=before,
        rename_cost=np.where(steady, np.where(alone, RENAMED, TAKEN), 0.0),
        lasting=_lasting(before, steady, limits.lasting),
    )
    return evidence._replace(nameless=evidence.nameless + _own_motion(evidence, likely))


def newness(turn, limits) -> np.ndarray:
    """Weight of every frame (frames,), by the turn of all whiskers [rad]; 1 where not known.

    While they rest, each frame shows the same as the one before.
    """
    moved = np.nan_to_num(np.abs(turn) / limits.moving, nan=1.0)
    return np.clip(moved, QUIET, 1.0)


def _goes_on(frame, before, step, turn, own_turn):
    """Rows whose line moves on as all do from that of its track in the frame before, bool.

    step : (rows,) change of the angle since then, less the turn of all
    turn : (frames,) which is even itself, or the whole row may have moved on by one
    """
    return (before >= 0) & (np.abs(step) < own_turn) & _is_even(turn, own_turn)[frame]


def _is_even(turn, own_turn):
    """Frames in which the common turn is about that of the neighbouring frames, bool (frames,)."""
    return np.abs(turn - median_filter(turn, 3, mode="nearest")) < own_turn


def _alone(features, frame, before, apart):
    """Rows whose line has no other one near, neither now nor in the frame before, bool."""
    gap = _gaps(features, frame)
    return (before >= 0) & (np.minimum(gap, gap[before]) > apart)


@njit(cache=True)
def _lasting(before, steady, count):
    """Rows that are part of at least `count` rows of one track, each steady beside the last."""
    run = np.arange(len(before))
    for j in np.flatnonzero(steady):  # by frame: the row before is known
        run[j] = run[before[j]]
    return np.bincount(run, minlength=len(run))[run] >= count


def phases(model: FanModel, features, frame, names) -> np.ndarray:
    """Phase of every frame (frames,) from its named lines; interpolated where it has none."""
    known = np.flatnonzero(names >= 0)
    present, starts = np.unique(frame[known], return_index=True)
    starts = np.append(starts, len(known))
    found = model.phases_of(features[known, ANGLE], names[known], starts)
    return np.interp(np.arange(frame[-1] + 1), present, found)


def common_turns(features, frame, before, slope=1.0) -> np.ndarray:
    """Turn of all whiskers from the frame before to each frame, (frames,) [rad]."""
    turn = _steps(features[:, ANGLE], before) / slope
    known = np.flatnonzero(np.isfinite(turn))
    out = np.zeros(frame[-1] + 1)
    present, starts = np.unique(frame[known], return_index=True)
    out[present] = medians(turn[known], np.append(starts, len(known)))
    return out


def sure_turns(features, frame, before, slope, own_turn) -> np.ndarray:
    """The same, NaN where no line shows it or tracks seem to have gone on with other lines."""
    turn = common_turns(features, frame, before, slope)
    seen = np.isfinite(_steps(features[:, ANGLE], before) / slope)
    shown = np.isin(np.arange(len(turn)), frame[seen])
    return np.where(shown & _is_even(turn, own_turn), turn, np.nan)


def _steps(features, before):
    """Change of every row's features (rows, …) since the frame before, NaN where not seen."""
    out = np.full(features.shape, np.nan)
    on = before >= 0
    out[on] = features[on] - features[before[on]]
    return out


@njit(cache=True)
def _spread(step, before, turn):
    """How steps (rows, 6), less the common turn, go on and scatter.

    Returns
    -------
    drift : (rows, 6) expected of the next step
    sd, fast : (6,) scatter of what is left, and its part that goes with the `turn` (rows,)
    """
    drift = np.zeros(step.shape)
    sd, fast = LEAST_MOTION.copy(), np.zeros(N_FEATURES)
    for j in range(N_FEATURES):
        y = step[:, j].copy()
        x = np.where(before >= 0, y[before], np.nan)
        seen = np.isfinite(x) & np.isfinite(y)
        if seen.sum() < FEWEST:
            continue
        limit = FARTHEST * max(sd_about_0(y[seen]), LEAST_MOTION[j])
        seen &= (np.abs(x) < limit) & (np.abs(y) < limit)
        again = min(max(x[seen] @ y[seen] / max(x[seen] @ x[seen], 1e-12), 0.0), 1.0)
        for i in range(len(y)):
            drift[i, j] = again * min(max(y[i], -limit), limit) if np.isfinite(y[i]) else 0.0
        rest, of = y[seen] - again * x[seen], turn[seen]
        slow, quick = np.quantile(of, SLOW), np.quantile(of, QUICK)
        sd[j] = max(sd_about_0(rest[of <= slow]), LEAST_MOTION[j])
        more = sd_about_0(rest[of >= quick]) ** 2 - sd[j] ** 2
        fast[j] = np.sqrt(max(more, 0.0) / max(np.mean(of[of >= quick] ** 2), 1e-12))
    return drift, sd, fast


def _own_motion(evidence, likely):
    """Cost (rows,) of every line to go on as its track."""
    out = np.empty(len(likely))
    for whisker in np.unique(likely):
        rows = np.flatnonzero(likely == whisker)
        out[rows] = link_costs(evidence, whisker, evidence.before[rows], rows)
    return out


@njit(cache=True)
def _gaps(features, frame):
    """Angle (rows,) from every line to the nearest other one of its frame, near or far out."""
    out = np.full(len(frame), np.inf)
    first = 0
    for i in range(len(frame)):
        if frame[i] != frame[first]:
            first = i
        for j in range(first, i):
            near = abs(features[i, ANGLE] - features[j, ANGLE])
            far = abs(
                features[i, ANGLE] + features[i, BEND] - features[j, ANGLE] - features[j, BEND]
            )
            gap = near if np.isnan(far) else min(near, far)
            out[i], out[j] = min(out[i], gap), min(out[j], gap)
    return out
