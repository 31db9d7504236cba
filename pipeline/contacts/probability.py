"""How probable a contact is in every frame, from distance and force together.

In every frame the fitted rod gives two numbers: the gap d between the surfaces and the force F
that the nearest point would feel. A free whisker has F = 0 and d > 0, a touching one d = 0 and
F > 0: an L in the plane (d, F), blurred by errors that are known from the fit or learnt from the
video. A hidden Markov model of two states turns the likelihoods of both arms into a probability
per frame.
"""

import numpy as np
import pandas as pd
from scipy.special import erfcx, log_ndtr

from pipeline.numerics.chains import state_probabilities, two_states
from pipeline.numerics.robust import robust_sd
from pipeline.session.parameters import ContactParams
from pipeline.session.recording import Recording

MOST_LIKELY_CHANGE = 0.3  # most that the probability of a start or end per frame may be
UNSEEN_LOG_ODDS = -0.5  # of an untraced frame: a few of them do not end a contact, many do
# share of frames with a wrong force, or gap: then the other of the two still counts
FORCE_OUTLIERS, GAP_OUTLIERS = 1e-4, 1e-5
SURE_PUSH_SD = 6.0  # a force of so many standard errors is no noise
STRONG_SHARE = 0.1  # of the largest force: fainter ones may be errors where others are strong
FEWEST_SURE = 10
_OBSERVED = (
    "gap_m", "gap_se_m", "distance_m", "rest_known", "gap_force_cov", "shape_force_N",
    "shape_force_se_N", "origin_force_se_N", "side", "pole_known", "nearest_m", "base_angle_rad",
)  # fmt: skip


def add_probability(
    evidence: pd.DataFrame, recording: Recording, params: ContactParams
) -> pd.DataFrame:
    """Fill `probability` of contact and its `log_odds` (of the frame alone) in every frame."""
    rate, new = recording.frames_per_second, np.zeros((2, len(evidence)))
    for part in by_whisker(evidence, (*_OBSERVED, "across")).values():
        if not part["pole_known"].any():
            continue
        log_odds = frame_log_odds(part, rate, params)
        probability = posterior(log_odds, *changes_per_frame(rate, params))
        if _passes_over(part, probability):
            probability[:] = 0.0
        new[:, part["row"]] = log_odds, probability
    return evidence.assign(log_odds=new[0], probability=new[1])


def by_whisker(table, columns=None) -> dict:
    """Arrays of each whisker's `columns` (None: all), its rows in the order of their frames.

    Under "row" is where these are in the table. The arrays are copies.
    """
    columns = table.columns.drop("whisker") if columns is None else columns
    values = {"row": np.arange(len(table)), **{name: table[name].to_numpy() for name in columns}}
    codes, names = pd.factorize(table["whisker"])
    order = np.argsort(table["frame"].to_numpy(), kind="stable")
    own = [order[codes[order] == code] for code in range(len(names))]
    return {
        name: {column: value[rows] for column, value in values.items()}
        for name, rows in zip(names, own, strict=True)
    }


def _passes_over(part, probability):
    """Whether a whisker passes over the pole, in another plane, or the "pole" is dust."""
    return np.count_nonzero(part["across"]) > np.count_nonzero(probability > 0.5)


def changes_per_frame(frames_per_second, params) -> tuple[float, float]:
    """Probabilities per frame that a contact starts, and that it ends."""
    rates = params.starts_per_s, params.ends_per_s
    return tuple(min(rate / frames_per_second, MOST_LIKELY_CHANGE) for rate in rates)


def frame_log_odds(part, frames_per_second, params: ContactParams):
    """Log-likelihood ratio of contact to no contact of every frame on its own.

    The gap's offset (radius of the pole, blur) and scatter in contact are learnt from the
    video, for both sides, together with the frames that touch.
    """
    column = {name: np.asarray(part[name], float) for name in _OBSERVED}
    gap, gap_sd, force, force_sd, cov = _observations(column, params)
    # a traced whisker without a pole surely touches nothing; an untraced frame tells nothing
    side, traced = column["side"], np.isfinite(column["base_angle_rad"])
    absent = (column["pole_known"] == 0) & np.isnan(column["nearest_m"]) & traced
    least, changes = 1e-3 * params.least_gap_sd_mm, changes_per_frame(frames_per_second, params)
    with np.errstate(invalid="ignore"):
        pushed = force > SURE_PUSH_SD * force_sd
        near = pushed & (np.abs(gap) < 1e-3 * params.pole_error_mm)
    # to begin with: a whisker that is near and strongly pushed touches
    sure = np.zeros(len(gap), bool)
    for s in (-1, 1):
        own = near & (side == s)
        sure |= own & (force > STRONG_SHARE * np.max(force[own], initial=0))
    offset, extra = np.zeros(len(gap)), np.full(len(gap), 4 * least)
    for _ in range(4):
        for s in (-1, 1):
            own = sure & (side == s)
            if own.sum() < FEWEST_SURE:
                continue
            middle = np.median(gap[own])
            spread = robust_sd(gap[own], middle)
            offset[side == s] = middle
            extra[side == s] = np.sqrt(max(spread**2 - np.median(gap_sd[own]) ** 2, least**2))
        sd = np.hypot(gap_sd, extra)
        odds = _log_odds(gap - offset, sd, force, force_sd, cov, params)
        odds = np.where(np.isfinite(odds), odds, UNSEEN_LOG_ODDS)
        odds = np.where(absent, -50.0, odds)
        before, sure = sure, pushed & (posterior(odds, *changes) > 0.9)
        if np.array_equal(before, sure):
            break
    return odds


def _observations(column, params):
    """Gap and force with standard deviations and covariance, in metres and newtons.

    Where no rod could be fitted, the gap is the traced distance, and the force is not known.
    """
    fitted = np.isfinite(column["gap_m"]) & np.isfinite(column["shape_force_se_N"])
    fitted &= column["rest_known"] == 1
    gap = np.where(fitted, column["gap_m"], column["distance_m"])
    gap_sd = np.where(fitted, column["gap_se_m"], 1e-3 * params.traced_gap_sd_mm)
    force = np.where(fitted, column["shape_force_N"], np.nan)
    return gap, gap_sd, force, force_noise(column), column["gap_force_cov"]


def force_noise(column):
    """Standard error (rows,) [N] of the force `shape`, without that of the arc-length offset.

    That one does not count here: a wrong offset scales a force, but makes none out of nothing.
    """
    total, share = column["shape_force_se_N"], column["origin_force_se_N"]
    return np.sqrt(np.maximum(total**2 - share**2, 0.0))


def bent_elsewhere(evidence: pd.DataFrame) -> pd.DataFrame:
    """Frames per whisker in which it is surely bent: `away` from the pole, and `at` it.

    evidence : with `probability`
    """
    force = evidence["shape_force_N"].where(evidence["rest_known"])
    bent = force > SURE_PUSH_SD * force_noise(evidence)
    at = evidence["probability"] > 0.5
    frames = pd.DataFrame({"away": bent & ~at, "at": bent & at})
    return frames.groupby(evidence["whisker"], sort=False).sum()


def _log_odds(gap, gap_sd, force, force_sd, cov, params):
    """log p(d, F | contact) − log p(d, F | free), bivariate normal errors and outliers."""
    gaps, forces = 1e-3 * params.gap_scale_mm, 1e-6 * params.force_scale_uN
    any_gap = np.log(GAP_OUTLIERS / (2 * gaps))
    any_force = np.log(FORCE_OUTLIERS / (2 * 5 * forces))
    with np.errstate(all="ignore"):
        free = _truly_zero(force, force_sd, any_force, gap, gap_sd, any_gap, gaps, cov)
        contact = _truly_zero(gap, gap_sd, any_gap, force, force_sd, any_force, forces, cov)
        odds = contact - free
        # without a force the gap alone decides
        alone = _log_normal(gap, gap_sd) - _log_skewed(gap, gap_sd, gaps)
        alone = np.clip(alone, -12.0, 6.0)
    return np.where(np.isfinite(force), odds, alone)


def _truly_zero(zero, zero_sd, any_zero, other, other_sd, any_other, scale, cov):
    """Log likelihood of two measurements, if the true value of the first one, `zero`, is zero.

    The other one has an exponential prior of mean `scale`; the error that both share (`cov`) is
    subtracted from it. any_zero, any_other : log likelihoods of either as an outlier
    """
    left = other - cov / zero_sd**2 * zero
    left_sd = np.sqrt(np.maximum(other_sd**2 - (cov / zero_sd) ** 2, (0.1 * other_sd) ** 2))
    return np.logaddexp(
        _log_normal(zero, zero_sd) + np.logaddexp(_log_skewed(left, left_sd, scale), any_other),
        any_zero + np.logaddexp(_log_skewed(other, other_sd, scale), any_other),
    )


def _log_normal(x, sd):
    return -0.5 * (x / sd) ** 2 - np.log(sd) - 0.5 * np.log(2 * np.pi)


def _log_skewed(x, sd, scale):
    """Log density of the sum of an exponential of mean `scale` and a normal error of `sd`."""
    z = sd / scale - x / sd
    # erfcx keeps its digits where exp and erfc would under- and overflow
    tail = np.log(erfcx(np.maximum(z, 0.0) / np.sqrt(2)) / 2) - 0.5 * (x / sd) ** 2
    body = 0.5 * (sd / scale) ** 2 - x / scale + log_ndtr(-np.minimum(z, 0.0))
    return np.where(z > 0, tail, body) - np.log(scale)


def posterior(log_odds, starts, ends):
    """Probability of contact (n,), given how likely one starts or ends from frame to frame."""
    return state_probabilities(two_states(np.asarray(log_odds, float), starts, ends))[:, 1]
