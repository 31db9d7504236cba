"""Rest shape of a whisker: its curvature while nothing touches it, and the error of that.

A whisker rolls as it whisks and drifts over a session, so its rest curvature is a polynomial in
the base angle plus a slow function of time, learnt robustly from free frames (pole far or away),
for one number (curvature at one arc length) or several (shape coefficients) at once.

Free frames may be few and may all lie at one base angle: a whisker at rest, then a touch at
another angle. So the model is Bayesian. Its prior is that the whisker keeps its shape: slope and
bend over the angle are zero, ± what rolling can do. Polynomials of degree 0, 1, 2 are averaged by
their posterior probabilities (Hoeting et al. 1999, Statist. Sci. 14, 382). Frames at many angles
override the prior; where there are none the shape stays constant, with an error that grows.
"""

from dataclasses import dataclass, replace

import numpy as np
from numba import njit
from scipy.ndimage import median_filter

from pipeline.numerics.robust import MAD_TO_SD, column_medians, robust_sd

CLEAR_SD = 8.0  # standard errors of the distance by which a whisker is clear of a touch
PLENTY, PLENTY_SHARE = 20, 0.25  # frames beyond free_distance_mm, of those clear of a touch
ASTRAY_SHARE = 0.1  # of the largest group of frames at one distance: fewer are tracking errors
FEWEST_FRAMES = 3
LARGEST_DEGREE = 2
# rolling by 0.7 rad per rad (Knutsen et al. 2008) shows up to this much of a bend of 20 1/m
TURNING_SD = 12.0  # of a rest value [1/m per rad of base angle, and per rad²]
LEAST_SD = 1e-6  # [1/m]
# neighbouring frames share their errors: how many count as one (measured, rendered videos)
CORRELATED_FRAMES = 4
# frames in which the whisker lies on the same pixels share errors, too: about a pixel at 5 mm
SAME_ANGLE_RAD = 0.008
MANY_FRAMES, LONGEST_STEP = 1000, 10  # kept at least, and every so many-th, of many free frames
DRIFT_TIME_S = 0.3  # drift is followed over times longer than this
DRIFT_SHRINK_FRAMES = 8  # so many frames of zero drift are added everywhere
TUKEY = 4.685  # SD beyond which a frame does not count: in normal noise, 95 % as exact as a mean


@dataclass(frozen=True)
class RestModel:
    """Rest values a(φ, t) = Σ_k weights_k u^k + drift(t), u = (φ − centre)/scale.

    Attributes
    ----------
    weights : (terms, values)
    weights_cov : (terms, values, terms, values)
    centre, scale : of the base angle [rad]
    time, residual, share : of the free frames, for the drift: s, (frames, values), (frames,)
    rows : (frames,) their numbers among those given
    turned : (frames, terms) their 1, u, u², …
    degrees : (terms,) probability of each degree
    noise : (values, values) covariance of a free frame about the model
    scatter : (values, values) covariance of the true rest values about the model
    """

    weights: np.ndarray
    weights_cov: np.ndarray
    centre: float
    scale: float
    time: np.ndarray
    residual: np.ndarray
    share: np.ndarray
    rows: np.ndarray
    turned: np.ndarray
    degrees: np.ndarray
    noise: np.ndarray
    scatter: np.ndarray

    @property
    def degree(self) -> int:
        """Degree of the polynomial in the base angle."""
        return len(self.weights) - 1

    def drift(self, time) -> np.ndarray:
        """Slow deviation from the polynomial at `time` [s], (frames, values)."""
        return _smooth(self.time, self.residual, self.share, np.asarray(time, float))[0]

    def values(self, angle, time) -> np.ndarray:
        """Rest values at base angles [rad] and times [s], (frames, values): those of `predict`."""
        return self.powers(angle) @ self.weights + self.drift(time)

    def predict(self, angle, time):
        """Rest values and their covariance at base angles [rad] and times [s].

        Returns
        -------
        values : (frames, values)
        cov : (frames, values, values)
        """
        powers = self.powers(angle)
        drift, frames = _smooth(self.time, self.residual, self.share, np.asarray(time, float))
        drift_cov = CORRELATED_FRAMES / frames[:, None, None] * self.noise
        known = of_polynomials(powers, self.weights_cov)
        return powers @ self.weights + drift, self.scatter + known + drift_cov

    def smoother(self, values):
        """Function of angle and time: what the model would say if free frames had these `values`.

        By the same shares and degrees; `values` (frames, any).
        """
        root = np.sqrt(self.share)[:, None]
        weights = np.zeros((len(self.degrees), values.shape[1]))
        for degree, probability in enumerate(self.degrees):
            own = slice(degree + 1)
            fit = np.linalg.lstsq(root * self.turned[:, own], root * values, rcond=None)[0]
            weights[own] += probability * fit
        left = values - self.turned @ weights
        return lambda angle, time: (
            self.powers(angle) @ weights + _smooth(self.time, left, self.share, time)[0]
        )

    def turning_cov(self, angle) -> np.ndarray:
        """Covariance (frames, values, values) of how the values change from the centre."""
        return of_polynomials(self.powers(angle)[:, 1:], self.weights_cov[1:, :, 1:])

    def powers(self, angle) -> np.ndarray:
        """(frames, terms) of u at base angles [rad]."""
        return _powers((np.asarray(angle, float) - self.centre) / self.scale, self.degree)


def of_polynomials(powers, cov) -> np.ndarray:
    """Covariance (frames, values, values) of `powers` @ weights that have the covariance `cov`."""
    return np.tensordot(powers[:, :, None] * powers[:, None], cov.transpose(0, 2, 1, 3), 2)


def fit_rest(values, variances, angle, time, free, degree=LARGEST_DEGREE) -> RestModel | None:
    """Fit rest values to the free frames.

    Parameters
    ----------
    values : (frames,) or (frames, values)
        Measured curvature or shape coefficients [1/m]; NaN where unknown.
    variances : same shape; their variances, or (frames, values, values) covariances
    angle, time : (frames,) base angle [rad] and time [s]. Errors of the angle must not go with
        those of the values, or they are taken for a slope where the angle hardly changes
    free : bool (frames,), frames in which nothing touches the whisker
    degree : the highest of the polynomial in the angle

    Returns
    -------
    RestModel, or None where fewer than FEWEST_FRAMES frames are free.
    """
    values, covs, use = _usable(values, variances, angle, free)
    if use.sum() < FEWEST_FRAMES:
        return None
    values, covs, angle, time = values[use], covs[use], angle[use], time[use]
    centre = float(np.median(angle))
    scale = max(float(np.ptp(np.percentile(angle, [5, 95]))) / 2, 1e-3)
    powers = _powers((angle - centre) / scale, degree)
    # of slope and bend; a constant may have any size
    precision = np.append(0.0, (TURNING_SD * scale ** np.arange(1, degree + 1)) ** -2.0)
    distinct = 1 + 2 * scale / SAME_ANGLE_RAD  # angles
    alike = len(values) / np.clip(len(values) / CORRELATED_FRAMES, 1, distinct)
    floor = np.sqrt(np.diag(np.median(covs, axis=0)))
    drift, left, share = _drift_and_rest(powers, values, time, precision * alike, floor)
    noise, measured = _noise(left, covs, share)
    weights, weights_cov, degrees = _averaged(
        powers, values - drift, share / alike, noise, precision
    )
    return RestModel(
        weights=weights,
        weights_cov=weights_cov,
        centre=centre,
        scale=scale,
        time=time,
        residual=values - powers @ weights,
        share=share,
        rows=np.flatnonzero(use),
        turned=powers,
        degrees=degrees,
        noise=noise,
        scatter=_positive(noise - measured),
    )


def _usable(values, variances, angle, free):
    """Values (frames, values), their covariances, and which frames are free and known."""
    values = np.asarray(values, float).reshape(len(angle), -1)
    covs = np.asarray(variances, float).reshape(len(angle), values.shape[1], -1)
    if covs.shape[2] == 1:
        covs = covs * np.eye(values.shape[1])
    use = np.asarray(free) & np.isfinite(values).all(axis=1) & np.isfinite(angle)
    return values, covs, use & np.isfinite(covs).all(axis=(1, 2))


def _drift_and_rest(powers, values, time, precision, floor):
    """Drift, what polynomial and drift leave, (frames, values) each, and the frames' shares."""
    drift, weights = np.zeros_like(values), np.zeros((powers.shape[1], values.shape[1]))
    weights[0] = np.median(values, axis=0)  # the same at all angles at first
    # drift and polynomial in turn: each leaves a tenth of what is missing
    for rounds in (8, 2, 2):
        weights, share = _robust_polynomial(
            powers, values - drift, precision, floor, weights, rounds
        )
        residual = values - powers @ weights
        middle = np.average(residual, axis=0, weights=share)
        weights[0] += middle  # a drift of mean zero: it is shrunk to that
        residual -= middle
        drift = _smooth(time, residual, share, time)[0]
    return drift, residual - drift, share


def _noise(left, covs, share):
    """Covariance (values, values) of a frame about the model, and that of its measurement."""
    measured = np.average(covs, axis=0, weights=share)
    # a few frames do not show their scatter: then the measurement's own error counts
    noise = (left * share[:, None]).T @ left + CORRELATED_FRAMES * measured
    noise /= share.sum() + CORRELATED_FRAMES
    return noise + np.eye(len(noise)) * LEAST_SD**2, measured


def enough(rows) -> np.ndarray:
    """Some of `rows` (frames in order) that tell about as much as all: neighbours share errors."""
    return rows[:: int(np.clip(len(rows) // MANY_FRAMES, 1, LONGEST_STEP))]


def by_leaning_angle(model: RestModel, lean) -> RestModel:
    """Return the model by another angle, φ + a · lean, with `lean` (values,) [rad m]."""
    u = np.linspace(-2, 2, 9)
    values = _powers(u, model.degree) @ model.weights
    angle = model.centre + model.scale * u + values @ lean
    centre = float(angle[len(u) // 2])
    powers = _powers((angle - centre) / model.scale, model.degree)
    weights = np.linalg.lstsq(powers, values, rcond=None)[0]
    return replace(model, weights=weights, centre=centre)


def free_frames(distance, pole_known, params) -> np.ndarray:
    """Frames in which the whisker is surely untouched, bool (frames,).

    `distance` [m] from the pole's surface to the whisker's, frame after frame, NaN where unknown;
    `pole_known` is False where no pole is in view. Where few frames are `free_distance_mm` away,
    those count as free that are clearly farther away than the nearest ones.
    """
    distance, away = np.asarray(distance, float), ~np.asarray(pole_known)
    with np.errstate(invalid="ignore"):
        far = away | (distance > 1e-3 * params.free_distance_mm)
        clear = away | (distance > _clear_distance(distance, params.clear_distance_mm, params))
        if clear.sum() < FEWEST_FRAMES:
            clear = away | (distance > _clear_distance(distance, params.least_clear_mm, params))
    return far if far.sum() >= max(PLENTY, PLENTY_SHARE * clear.sum()) else clear


def _clear_distance(distance, least_mm, params):
    """Distance [m] from which on a whisker does not touch, at least `least_mm` beyond the nearest.

    In the touches of one video, the distance is nearly the same.
    """
    free = 1e-3 * params.free_distance_mm
    known = distance[np.isfinite(distance)]
    if len(known) < 3:
        return free
    noise = robust_sd(np.diff(known, 2), about=0.0) / np.sqrt(6)
    reach = max(1e-3 * least_mm, CLEAR_SD * noise)
    # a single frame with a tracking error does not count as the nearest
    nearest = _nearest(median_filter(known, 5, mode="nearest"), reach, free)
    return min(free, nearest + reach)


def _nearest(distance, reach, free):
    """Least distance [m] that has others within `reach`: it is no tracking error.

    Touches have nearly the same distance; a line that followed something else has another one.
    """
    distance = np.sort(distance)
    company = np.searchsorted(distance, distance + reach, "right") - np.arange(len(distance))
    most = company[distance < free].max(initial=1)
    return distance[np.argmax(company >= ASTRAY_SHARE * most)]


def _powers(u, degree):
    return u[:, None] ** np.arange(degree + 1)


@njit(cache=True)
def _robust_polynomial(powers, values, precision, floor, weights, rounds):
    """Tukey-weighted least squares with a prior; weights (terms, values) and frames' shares.

    `precision` (terms,) of the prior, `floor` (values,) the least spread of a frame, `weights` to
    begin with.
    """
    share = np.ones(len(powers))
    for _ in range(rounds):
        residual = np.abs(values - powers @ weights)
        spread = np.maximum(MAD_TO_SD * column_medians(residual), floor)
        for n in range(len(share)):
            worst = 0.0
            for v in range(len(spread)):
                worst = max(worst, residual[n, v] / max(TUKEY * spread[v], 1e-12))
            share[n] = (1 - worst**2) ** 2 if worst < 1 else 0.0
        if share.sum() < min(len(powers), 2 * FEWEST_FRAMES) / 2:
            share[:] = 1.0
        weighted = np.ascontiguousarray((powers * share.reshape(-1, 1)).T)
        square, rhs, weights = weighted @ powers, weighted @ values, np.empty_like(weights)
        for v in range(values.shape[1]):
            prior = spread[v] ** 2 * np.diag(precision)
            weights[:, v] = np.linalg.solve(square + prior, rhs[:, v].copy())
    return weights, share


def _averaged(powers, values, share, noise, precision):
    """Posterior mean (terms, values), covariance, and probabilities of the degrees."""
    terms, several = powers.shape[1], values.shape[1]
    weighted = powers * share[:, None]
    inverse = np.linalg.inv(noise)
    information = np.kron(weighted.T @ powers, inverse)
    rhs = (weighted.T @ values @ inverse).ravel()
    prior = np.repeat(precision, several)
    means, covs = np.zeros((terms, len(rhs))), np.zeros((terms, len(rhs), len(rhs)))
    evidence = np.zeros(terms)
    for degree in range(terms):
        own = slice(0, (degree + 1) * several)
        matrix = information[own, own] + np.diag(prior[own])
        covs[degree, own, own] = np.linalg.inv(matrix)
        means[degree, own] = covs[degree, own, own] @ rhs[own]
        evidence[degree] = 0.5 * (
            rhs[own] @ means[degree, own]
            - np.linalg.slogdet(matrix)[1]
            + np.log(prior[several : own.stop]).sum()  # that of the constant is always the same
        )
    probability = np.exp(evidence - evidence.max())
    probability /= probability.sum()
    mean = probability @ means
    apart = means - mean
    cov = np.einsum("d,dij->ij", probability, covs + apart[:, :, None] * apart[:, None, :])
    cov = cov.reshape(terms, several, terms, several)
    return mean.reshape(terms, several), cov, probability


def _smooth(time, residual, share, at):
    """Local line through the residual at times `at`, shrunk to zero where there are few frames.

    Returns its values (times, values), and the number of frames that support each, (times,).
    """
    if len(time) == 0 or len(at) == 0:
        return np.zeros((len(at), residual.shape[1])), np.full(len(at), DRIFT_SHRINK_FRAMES)
    # frames are dense in time: bins of a fifth of the kernel's width lose nothing
    step = DRIFT_TIME_S / 5
    low = min(time.min(), np.nanmin(at)) - step
    bins = int((max(time.max(), np.nanmax(at)) + step - low) / step) + 2
    lines = _local_lines(((time - low) / step).astype(int), residual, share, bins)
    centres = low + (np.arange(bins) + 0.5) * step
    *values, frames = (np.interp(at, centres, line) for line in lines.T)
    return np.stack(values, axis=1), frames


@njit(cache=True)
def _local_lines(place, residual, share, bins):
    """Lines at the centres of all bins, and the frames that support them, (bins, values + 1).

    `place` (frames,): the bin of each frame.
    """
    sums = np.zeros((bins, residual.shape[1] + 1))
    for n in range(len(place)):
        sums[place[n], :-1] += share[n] * residual[n]
        sums[place[n], -1] += share[n]
    lines, moments = np.empty_like(sums), np.empty((3, sums.shape[1]))
    for k in range(bins):
        moments[:] = 0.0
        for j in range(max(k - 20, 0), min(k + 21, bins)):
            u = (j - k) / 5
            weight = np.exp(-0.5 * u * u)
            for v in range(sums.shape[1]):
                moments[0, v] += weight * sums[j, v]
                moments[1, v] += weight * u * sums[j, v]
                moments[2, v] += weight * u * u * sums[j, v]
        s0, s1, s2 = moments[:, -1]
        s0, s2 = s0 + DRIFT_SHRINK_FRAMES, s2 + DRIFT_SHRINK_FRAMES
        lines[k] = (s2 * moments[0] - s1 * moments[1]) / (s0 * s2 - s1**2)
        lines[k, -1] = s0 - s1**2 / s2
    return lines


def _positive(matrix):
    """Nearest covariance: the matrix with its negative eigenvalues set to zero."""
    values, vectors = np.linalg.eigh((matrix + matrix.T) / 2)
    return (vectors * np.maximum(values, 0.0)) @ vectors.T
