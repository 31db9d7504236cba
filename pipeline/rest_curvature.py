"""Rest shape of a whisker: how it is curved while nothing touches it, and how well that is known.

A whisker rolls as it whisks and drifts over a session, so its rest curvature is estimated from
free frames (pole far or away) as a polynomial in the base angle plus a slow function of time,
robustly, for one number (curvature at one arc length) or several (shape coefficients) at once.
"""

from dataclasses import dataclass

import numpy as np
import pandas as pd

FREE_DISTANCE_M = 0.2e-3  # surface to surface; farther than any tracing error
FEWEST_FRAMES = 20
LARGEST_DEGREE = 2
CORRELATED_FRAMES = 10  # neighbouring frames share their errors: how many count as one
DRIFT_TIME_S = 0.3  # drift is followed over times longer than this
DRIFT_SHRINK_FRAMES = 8  # so many frames of zero drift are added everywhere
START_DRAWS = 100  # random small samples of frames, the best of which starts the robust fit
TUKEY = 4.5  # SD beyond which a frame counts nothing


@dataclass(frozen=True)
class RestModel:
    """Rest values a(φ, t) = Σ_k weights_k u^k + drift(t), u = (φ − centre)/scale.

    Attributes
    ----------
    weights : (terms, values)
    weights_cov : (terms, terms), and values_cov : (values, values), whose product is the
        covariance of the weights
    centre, scale : of the base angle [rad]
    time, residual, share : of the free frames, for the drift: s, (frames, values), (frames,)
    scatter : (values, values) covariance of the true rest values about the model
    frames : how many free frames it rests on
    """

    weights: np.ndarray
    weights_cov: np.ndarray
    values_cov: np.ndarray
    centre: float
    scale: float
    time: np.ndarray
    residual: np.ndarray
    share: np.ndarray
    scatter: np.ndarray
    frames: int

    @property
    def degree(self) -> int:
        """Degree of the polynomial in the base angle."""
        return len(self.weights) - 1

    def drift(self, time) -> np.ndarray:
        """Slow deviation from the polynomial at `time` [s], (frames, values)."""
        return _smooth(self.time, self.residual, self.share, np.asarray(time, float))

    def predict(self, angle, time):
        """Rest values and their covariance at base angles [rad] and times [s].

        Returns
        -------
        values : (frames, values)
        cov : (frames, values, values)
        """
        powers = _powers((np.asarray(angle, float) - self.centre) / self.scale, self.degree)
        values = powers @ self.weights + self.drift(time)
        known = np.einsum("nk,kl,nl->n", powers, self.weights_cov, powers)
        return values, self.scatter + known[:, None, None] * self.values_cov


def fit_rest(values, variances, angle, time, free) -> RestModel | None:
    """Fit rest values to the free frames.

    Parameters
    ----------
    values : (frames,) or (frames, values)
        Measured curvature or shape coefficients; NaN where unknown.
    variances : same shape; their variances
    angle, time : (frames,) base angle [rad] and time [s]
    free : bool (frames,), frames in which nothing touches the whisker

    Returns
    -------
    RestModel, or None where fewer than FEWEST_FRAMES frames are free.
    """
    values = np.asarray(values, float).reshape(len(angle), -1)
    variances = np.asarray(variances, float).reshape(values.shape)
    use = np.asarray(free) & np.isfinite(values).all(axis=1) & np.isfinite(angle)
    use &= np.isfinite(variances).all(axis=1)
    if use.sum() < FEWEST_FRAMES:
        return None
    values, variances, angle, time = values[use], variances[use], angle[use], time[use]
    centre = float(np.median(angle))
    scale = max(float(np.ptp(np.percentile(angle, [5, 95]))) / 2, 1e-3)
    u = (angle - centre) / scale
    # the sampling variance of a scatter estimate needs some frames per term
    degrees = range(min(LARGEST_DEGREE, len(u) // (3 * FEWEST_FRAMES)) + 1)
    fits = [_robust_polynomial(u, values, degree) for degree in degrees]
    weights, share = min(fits, key=lambda fit: _information_criterion(u, values, *fit))
    powers = _powers(u, len(weights) - 1)
    residual = values - powers @ weights
    for _ in range(5):  # drift and polynomial in turn
        drift = _smooth(time, residual, share, time)
        weights, share = _robust_polynomial(u, values - drift, len(weights) - 1, weights)
        residual = values - powers @ weights
        middle = np.average(residual, axis=0, weights=share)
        weights[0] += middle  # a drift of mean zero: it is shrunk to that
        residual -= middle
    left = residual - drift
    total = (left * share[:, None]).T @ left / share.sum()
    scatter = _positive(total - np.diag((variances * share[:, None]).sum(axis=0) / share.sum()))
    weights_cov = CORRELATED_FRAMES * np.linalg.inv((powers * share[:, None]).T @ powers)
    return RestModel(
        weights, weights_cov, total, centre, scale, time, residual, share, scatter, int(use.sum())
    )


def free_frames(distance, pole_known) -> np.ndarray:
    """Frames in which the whisker is surely untouched, bool (frames,).

    `distance` [m] from the pole's surface to the whisker's, NaN where unknown; `pole_known` is
    False where no pole is in view.
    """
    with np.errstate(invalid="ignore"):
        return ~np.asarray(pole_known) | (np.asarray(distance) > FREE_DISTANCE_M)


def add_rest_curvature(frames: pd.DataFrame, rest: dict) -> pd.DataFrame:
    """Fill the rest curvature and the curvature change of the table of frames.

    Parameters
    ----------
    frames : records.FRAME_COLUMNS with `base_angle_deg`, `curvature_per_m` and its error
    rest : whisker's name → RestModel of `curvature_per_m`, or None where it is not known
    """
    frames = frames.copy()
    for name, model in rest.items():
        rows = frames.index[frames["whisker"] == name]
        part = frames.loc[rows]
        if model is None:
            value = error = np.full(len(part), np.nan)
        else:
            angle = np.radians(part["base_angle_deg"].to_numpy())
            value, cov = model.predict(angle, part["time_s"].to_numpy())
            value, error = value[:, 0], np.sqrt(cov[:, 0, 0])
        measured, measured_error = part["curvature_per_m"], part["curvature_per_m_se"]
        frames.loc[rows, "rest_curvature_per_m"] = value
        frames.loc[rows, "rest_curvature_per_m_se"] = error
        frames.loc[rows, "curvature_change_per_m"] = measured - value
        frames.loc[rows, "curvature_change_per_m_se"] = np.hypot(measured_error, error)
    return frames


def _powers(u, degree):
    return u[:, None] ** np.arange(degree + 1)


def _robust_polynomial(u, values, degree, weights=None):
    """Tukey-weighted least squares; returns weights (terms, values) and each frame's share.

    `weights` to begin with are found among random ones where none are given.
    """
    powers = _powers(u, degree)
    begun = weights is not None
    if not begun:
        weights = _robust_start(powers, values)
    for _ in range(2 if begun else 8):
        residual = values - powers @ weights
        spread = 1.4826 * np.median(np.abs(residual), axis=0)
        away = (residual / np.maximum(spread, 1e-12)) ** 2
        worst = np.sqrt(away.max(axis=1)) / TUKEY
        share = np.where(worst < 1, (1 - worst**2) ** 2, 0.0)
        if share.sum() < FEWEST_FRAMES / 2:
            share = np.ones(len(u))
        weighted = powers * share[:, None]
        weights = np.linalg.lstsq(weighted.T @ powers, weighted.T @ values, rcond=None)[0]
    return weights, share


def _robust_start(powers, values):
    """Polynomial through a few frames that most frames are nearest to (least median)."""
    n, terms = powers.shape
    rng = np.random.default_rng(0)
    rows = rng.integers(0, n, (START_DRAWS, terms + 1))
    part = powers[rows]
    square = np.swapaxes(part, 1, 2) @ part + 1e-9 * np.eye(terms)
    trials = np.linalg.solve(square, np.swapaxes(part, 1, 2) @ values[rows])
    judges = np.unique(np.linspace(0, n - 1, 400).astype(int))
    misfit = np.abs(values[judges] - powers[judges] @ trials)
    middle = np.median(misfit, axis=1)
    return trials[np.argmin((middle / np.maximum(middle.min(axis=0), 1e-12)).sum(axis=1))]


def _information_criterion(u, values, weights, share):
    """Schwarz's criterion with neighbouring frames counted once."""
    residual = values - _powers(u, len(weights) - 1) @ weights
    spread = 1.4826 * np.median(np.abs(residual), axis=0)
    n = len(u) / CORRELATED_FRAMES
    return 2 * n * np.log(np.maximum(spread, 1e-12)).sum() + weights.size * np.log(max(n, 2))


def _smooth(time, residual, share, at):
    """Local line through the residual at times `at`, shrunk to zero where there are few frames."""
    if len(time) == 0 or len(at) == 0:
        return np.zeros((len(at), residual.shape[1]))
    # frames are dense in time: bins of a fifth of the kernel's width lose nothing
    step = DRIFT_TIME_S / 5
    low = min(time.min(), np.nanmin(at)) - step
    bins = int((max(time.max(), np.nanmax(at)) + step - low) / step) + 2
    place = ((time - low) / step).astype(int)
    reach = np.arange(-20, 21) / 5.0
    kernel = np.exp(-0.5 * reach**2)
    count = np.bincount(place, share, bins)
    s0, s1, s2 = (_convolve(count, kernel * (-reach) ** k) for k in range(3))
    s0, s2 = s0 + DRIFT_SHRINK_FRAMES, s2 + DRIFT_SHRINK_FRAMES
    centres = low + (np.arange(bins) + 0.5) * step
    out = []
    for r in residual.T:
        sums = np.bincount(place, share * r, bins)
        t0, t1 = (_convolve(sums, kernel * (-reach) ** k) for k in range(2))
        out.append(np.interp(at, centres, (s2 * t0 - s1 * t1) / (s0 * s2 - s1**2)))
    return np.stack(out, axis=1)


def _convolve(values, kernel):
    """Same-size convolution that also holds where the kernel is longer than the values."""
    full = np.convolve(values, kernel, "full")
    start = len(kernel) // 2
    return full[start : start + len(values)]


def _positive(matrix):
    """Nearest covariance: the matrix with its negative eigenvalues set to zero."""
    values, vectors = np.linalg.eigh((matrix + matrix.T) / 2)
    return (vectors * np.maximum(values, 0.0)) @ vectors.T
