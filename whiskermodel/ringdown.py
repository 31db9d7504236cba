"""Ring-down after a slip: damping, frequency and Young's modulus (Hires et al. 2013, Fig. 5).

A sin(p_d t + φ) e^(−dt) is fitted by least squares. The frequency that swings is the damped one;
the modes' own is √(p_d² + d²), and E follows from it (Eq. 39). The paper leaves that step out.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares
from scipy.special import ndtri, stdtrit

from whiskermodel.checks import finite_array
from whiskermodel.modes import modes

CONFIDENCE = 0.95


@dataclass(frozen=True)
class Estimate:
    """A value with its 95 % interval."""

    value: float
    low: float
    high: float

    def __str__(self):
        return f"{self.value:.4g} ({self.low:.4g} to {self.high:.4g})"


@dataclass(frozen=True)
class RingdownFit:
    """Fitted decay A sin(p_d (t − t0) + φ) e^(−d (t − t0)) + offset, t0 the first sample.

    Attributes
    ----------
    damping_rate : Estimate, d [1/s]
    angular_frequency : Estimate, p_d of the damped swing [rad/s]
    undamped_angular_frequency : Estimate, √(p_d² + d²) [rad/s]
    amplitude, phase, offset : Estimate, of the signal's unit, rad, signal's unit
    residual_sd : standard deviation of the noise, of the signal's unit
    start : t0 [s]
    """

    damping_rate: Estimate
    angular_frequency: Estimate
    undamped_angular_frequency: Estimate
    amplitude: Estimate
    phase: Estimate
    offset: Estimate
    residual_sd: float
    start: float

    def __call__(self, time):
        """The fitted curve at `time` [s]."""
        t = np.asarray(time, dtype=float) - self.start
        swing = np.sin(self.angular_frequency.value * t + self.phase.value)
        decay = np.exp(-self.damping_rate.value * t)
        return self.amplitude.value * swing * decay + self.offset.value


def fit_ringdown(time, signal, with_offset=False):
    """Fit a decaying swing to `signal` (n,) at `time` (n,) [s]; curvature change, for instance.

    Parameters
    ----------
    time, signal : (n,) arrays
        Ascending times, even or not, from after the slip on; n ≥ 6 (7 with an offset).
    with_offset : bool
        Fit a constant too: what the signal swings about, if that is not zero.

    Returns
    -------
    RingdownFit

    Raises
    ------
    ValueError
        Where the input is not finite, too short or not ascending, or does not swing.
    """
    time, signal = _checked(time, signal, with_offset)
    scale = (time[-1] - time[0]) / 2
    t = (time - time[0]) / scale
    unit = np.abs(signal - signal.mean() * with_offset).max()
    if not unit > 0:
        raise ValueError("signal must swing, got a constant")
    start = _starting_values(t, signal / unit, with_offset)
    # unknowns: d, p (per scale), cosine and sine amplitudes, offset
    solution = least_squares(
        lambda q: _curve(q, t) - signal / unit, start, jac=lambda q: _slopes(q, t), method="lm"
    )
    free = len(t) - len(start)
    variance = 2 * solution.cost / free
    covariance = np.linalg.inv(solution.jac.T @ solution.jac) * variance
    width = stdtrit(free, (1 + CONFIDENCE) / 2)
    return _described(
        solution.x, covariance, width, scale, unit, np.sqrt(variance) * unit, time[0]
    )


def youngs_modulus(fit, whisker, boundary="fixed", length_se=0.0, base_radius_se=0.0):
    """E [Pa] with its 95 % interval, from a ring-down of the first mode that swings.

    Parameters
    ----------
    fit : RingdownFit, or Estimate of the undamped angular frequency [rad/s]
    whisker : Whisker
        Its geometry and density; its own E is not used.
    boundary : "fixed", "pinned" or float
        As in `whiskermodel.modes`, a number in units of E I0/L.
    length_se, base_radius_se : float
        Standard errors [m], added to the interval.

    Returns
    -------
    Estimate
    """
    frequency = fit.undamped_angular_frequency if isinstance(fit, RingdownFit) else fit
    first = modes(whisker.taper, boundary, 2).p_prime
    p_prime = first[0] if first[0] > 0 else first[1]
    # p = (p'/2) (r0/L²) √(E/ρ)  (Eq. 39)
    root = 2 * frequency.value * whisker.length**2 / (p_prime * whisker.base_radius)
    value = whisker.density * root**2
    z = ndtri((1 + CONFIDENCE) / 2)
    geometry = z * np.hypot(
        4 * length_se / whisker.length, 2 * base_radius_se / whisker.base_radius
    )
    low = np.hypot(2 * (frequency.value - frequency.low) / frequency.value, geometry)
    high = np.hypot(2 * (frequency.high - frequency.value) / frequency.value, geometry)
    return Estimate(value, value * (1 - low), value * (1 + high))


def mean_estimate(estimates):
    """Mean over independent ring-downs, with Student's 95 % interval of the mean.

    Takes the values alone, as the paper does: slips differ by more than their fits' errors.
    """
    values = np.array([e.value for e in estimates])
    if len(values) < 2:
        raise ValueError(f"estimates must be at least two, got {len(values)}")
    se = values.std(ddof=1) / np.sqrt(len(values))
    half = stdtrit(len(values) - 1, (1 + CONFIDENCE) / 2) * se
    return Estimate(values.mean(), values.mean() - half, values.mean() + half)


def _checked(time, signal, with_offset):
    time, signal = finite_array("time", time), finite_array("signal", signal)
    least = 7 if with_offset else 6
    if time.ndim != 1 or time.shape != signal.shape or len(time) < least:
        raise ValueError(
            f"time and signal must be rows of one length >= {least}, "
            f"got shapes {time.shape} and {signal.shape}"
        )
    if (np.diff(time) <= 0).any():
        raise ValueError(f"time must ascend, got steps down to {np.diff(time).min()!r} s")
    return time, signal


def _curve(q, t):
    d, p, cosine, sine = q[:4]
    swing = np.exp(-d * t) * (cosine * np.cos(p * t) + sine * np.sin(p * t))
    return swing + (q[4] if len(q) > 4 else 0.0)


def _slopes(q, t):
    d, p, cosine, sine = q[:4]
    decay = np.exp(-d * t)
    c, s = decay * np.cos(p * t), decay * np.sin(p * t)
    columns = [-t * (cosine * c + sine * s), t * (sine * c - cosine * s), c, s]
    return np.stack([*columns, np.ones_like(t)][: len(q)], axis=1)


def _starting_values(t, signal, with_offset):
    """Best of a grid of damping and frequency, the amplitudes solved for at each point."""
    highest = np.pi / np.median(np.diff(t))
    d, p = np.meshgrid(np.linspace(0, 8, 9), np.linspace(1.0, highest, 4 * len(t)), indexing="ij")
    d, p = d.ravel(), p.ravel()
    decay = np.exp(-d[:, None] * t)
    columns = [decay * np.cos(p[:, None] * t), decay * np.sin(p[:, None] * t)]
    if with_offset:
        columns.append(np.ones_like(decay))
    basis, triangle = np.linalg.qr(np.stack(columns, axis=2))
    projected = np.einsum("gnk,n->gk", basis, signal)
    sound = np.abs(np.diagonal(triangle, axis1=1, axis2=2)).min(axis=1) > 1e-6
    best = np.argmax(np.where(sound, (projected**2).sum(axis=1), -1.0))
    return np.array([d[best], p[best], *np.linalg.solve(triangle[best], projected[best])])


def _described(q, covariance, width, scale, unit, residual_sd, start):
    """RingdownFit of the unknowns in physical units; intervals by the delta method."""
    d, p, cosine, sine = q[:4]
    if p < 0:  # the same curve, told the other way round
        p, sine = -p, -sine
        flip = np.diag([1.0, -1.0, 1.0, -1.0, 1.0][: len(q)])
        covariance = flip @ covariance @ flip
    amplitude, undamped = np.hypot(cosine, sine), np.hypot(d, p)

    def estimate(value, gradient, factor):
        gradient = np.pad(gradient, (0, len(q) - len(gradient)))
        half = width * np.sqrt(gradient @ covariance @ gradient)
        return Estimate(*(float(factor * v) for v in (value, value - half, value + half)))

    turn = np.array([0, 0, sine, -cosine]) / amplitude**2  # of φ = atan2(cosine, sine)
    offset = Estimate(0.0, 0.0, 0.0)
    if len(q) > 4:
        offset = estimate(q[4], np.array([0, 0, 0, 0, 1.0]), unit)
    return RingdownFit(
        damping_rate=estimate(d, np.array([1.0, 0]), 1 / scale),
        angular_frequency=estimate(p, np.array([0, 1.0]), 1 / scale),
        undamped_angular_frequency=estimate(undamped, np.array([d, p]) / undamped, 1 / scale),
        amplitude=estimate(amplitude, np.array([0, 0, cosine, sine]) / amplitude, unit),
        phase=estimate(np.arctan2(cosine, sine), turn, 1.0),
        offset=offset,
        residual_sd=float(residual_sd),
        start=float(start),
    )
