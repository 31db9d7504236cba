"""Ring-down after a slip: damping, frequency and Young's modulus (Hires et al. 2013, Fig. 5).

A sin(p_d t + φ) e^(−dt) is fitted by least squares. The frequency that swings is the damped one;
the modes' own is √(p_d² + d²), and E follows from it (Eq. 39). The paper leaves that step out.
Higher modes die away no faster than the first. They may be fitted beside it: their frequencies
are known multiples of its own, each adds two amplitudes and no other unknown.
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
    _curve: object

    def __call__(self, time):
        """The fitted curve at `time` [s], with all that was fitted."""
        return self._curve(np.asarray(time, dtype=float) - self.start)


def fit_ringdown(
    time, signal, with_offset=False, overtones=(), signal_se=None, frequency_range=None
):
    """Fit a decaying swing to `signal` (n,) at `time` (n,) [s]; curvature change, for instance.

    Parameters
    ----------
    time, signal : (n,) arrays
        Ascending times, even or not, from after the slip on; at least two more than unknowns.
    with_offset : bool or int
        Fit a constant too: what the signal swings about, if that is not zero; 2: a constant and
        a drift.
    overtones : floats
        Undamped frequencies of higher modes over that of the first (`modes(...).p_prime`), which
        are fitted as well.
    signal_se : (n,) array, optional
        Standard errors of the signal, up to a common factor; even where they are not given.
    frequency_range : (low, high), optional
        Where the damped angular frequency [rad/s] is looked for; by default up to half the
        sampling rate.

    Returns
    -------
    RingdownFit

    Raises
    ------
    ValueError
        Where the input is not finite, too short or not ascending, or does not swing.
    """
    overtones = tuple(float(ratio) for ratio in overtones)
    time, signal = _checked(time, signal, 6 + int(with_offset) + 2 * len(overtones))
    scale = (time[-1] - time[0]) / 2
    t = (time - time[0]) / scale
    unit = np.abs(signal - signal.mean() * bool(with_offset)).max()
    if not unit > 0:
        raise ValueError("signal must swing, got a constant")
    weight = _weights(signal_se, len(t))
    basis = _Basis(overtones, int(with_offset))
    wanted = weight * signal / unit
    limits = [1.0, np.pi / np.median(np.diff(t))]
    if frequency_range is not None:
        limits = [bound * scale for bound in frequency_range]
    start = _starting_values(basis, t, wanted, weight, limits)
    # unknowns: d, p (per scale), cosine and sine amplitudes of every mode, offset and drift
    solution = least_squares(
        lambda q: weight * basis.curve(q, t) - wanted,
        start,
        jac=lambda q: weight[:, None] * basis.slopes(q, t),
        method="lm",
    )
    if not np.isfinite(solution.jac).all():
        raise ValueError("signal must swing, got one that no decaying swing describes")
    free = len(t) - len(start)
    variance = 2 * solution.cost / free
    width = stdtrit(free, (1 + CONFIDENCE) / 2)
    spread = _spread(solution.jac) * np.sqrt(variance)
    fitted = _Fitted(basis, solution.x, spread, width, scale, unit)
    return fitted.described(np.sqrt(variance) * unit, time[0])


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


def _checked(time, signal, least):
    time, signal = finite_array("time", time), finite_array("signal", signal)
    if time.ndim != 1 or time.shape != signal.shape or len(time) < least:
        raise ValueError(
            f"time and signal must be rows of one length >= {least}, "
            f"got shapes {time.shape} and {signal.shape}"
        )
    if (np.diff(time) <= 0).any():
        raise ValueError(f"time must ascend, got steps down to {np.diff(time).min()!r} s")
    return time, signal


def _weights(signal_se, n):
    """Weights (n,) of the residuals, 1 on average in the square."""
    if signal_se is None:
        return np.ones(n)
    se = finite_array("signal_se", signal_se)
    if se.shape != (n,) or not (se > 0).all():
        raise ValueError(f"signal_se must be {n} numbers > 0, got {signal_se!r}")
    return (1 / se) / np.sqrt(np.mean(1 / se**2))


@dataclass(frozen=True)
class _Basis:
    """What the signal is a sum of, at given d and p: swings of all modes, offset, drift."""

    overtones: tuple[float, ...]
    background: int

    def columns(self, d, p, t):
        """The summands (..., len(t), m) at d and p of any one shape."""
        d, p = np.asarray(d)[..., None], np.asarray(p)[..., None]
        decay = np.exp(-d * t)
        parts = []
        for ratio in (1.0, *self.overtones):
            swing = self._frequency(ratio, d, p) * t
            parts += [decay * np.cos(swing), decay * np.sin(swing)]
        parts += [np.broadcast_to(t**k, decay.shape) for k in range(self.background)]
        return np.stack(parts, axis=-1)

    def curve(self, q, t):
        """The signal of the unknowns (2 + m,)."""
        return self.columns(q[0], q[1], t) @ q[2:]

    def slopes(self, q, t):
        """Its derivatives by the unknowns, (len(t), 2 + m)."""
        d, p = q[:2]
        columns = self.columns(d, p, t)
        by_d, by_p = np.zeros_like(t), np.zeros_like(t)
        for k, ratio in enumerate((1.0, *self.overtones)):
            c, s = columns[:, 2 * k], columns[:, 2 * k + 1]
            cosine, sine = q[2 + 2 * k : 4 + 2 * k]
            swing, turned = cosine * c + sine * s, t * (sine * c - cosine * s)
            frequency = self._frequency(ratio, d, p)
            by_d += -t * swing + turned * (ratio**2 - 1) * d / frequency
            by_p += turned * ratio**2 * p / frequency
        return np.column_stack([by_d, by_p, columns])

    def _frequency(self, ratio, d, p):
        """Damped frequency of a mode: √(ratio² (p² + d²) − d²)."""
        return np.sqrt(ratio**2 * (p**2 + d**2) - d**2)


def _starting_values(basis, t, wanted, weight, limits):
    """Best of a grid of damping and frequency, the amplitudes solved for at each point."""
    d, p = np.meshgrid(np.linspace(0, 8, 9), np.linspace(*limits, 4 * len(t)), indexing="ij")
    d, p = d.ravel(), p.ravel()
    orthogonal, triangle = np.linalg.qr(weight[:, None] * basis.columns(d, p, t))
    projected = np.einsum("gnk,n->gk", orthogonal, wanted)
    sound = np.abs(np.diagonal(triangle, axis1=1, axis2=2)).min(axis=1) > 1e-6
    best = np.argmax(sound * (projected**2).sum(axis=1))
    return np.array([d[best], p[best], *np.linalg.solve(triangle[best], projected[best])])


def _spread(slopes):
    """A root R of the covariance R Rᵀ of the unknowns (m,), for noise of SD 1; (m, m).

    By singular values: what the signal does not determine gets a wide interval, not NaN.
    """
    _, singular, axes = np.linalg.svd(slopes, full_matrices=False)
    return axes.T / np.maximum(singular, np.finfo(float).eps * singular[0])


@dataclass(frozen=True)
class _Fitted:
    """Unknowns in units of `scale` and `unit`, a root of their covariance, half-width of intervals
    in SE."""

    basis: _Basis
    q: np.ndarray
    spread: np.ndarray
    width: float
    scale: float
    unit: float

    def described(self, residual_sd, start):
        """RingdownFit in physical units; intervals by the delta method."""
        d, p, cosine, sine = self.q[:4]
        amplitude, undamped = np.hypot(cosine, sine), np.hypot(d, p)
        turn = np.array([0, 0, sine, -cosine]) / amplitude**2  # of φ = atan2(cosine, sine)
        offset = Estimate(0.0, 0.0, 0.0)
        if self.basis.background:
            at = 4 + 2 * len(self.basis.overtones)
            offset = self._estimate(self.q[at], np.eye(len(self.q))[at], self.unit)
        per_s, unit, q = 1 / self.scale, self.unit, self.q
        return RingdownFit(
            damping_rate=self._estimate(d, [1.0], per_s),
            angular_frequency=self._estimate(abs(p), [0, 1.0], per_s),  # the curve has p² only
            undamped_angular_frequency=self._estimate(
                undamped, [d / undamped, p / undamped], per_s
            ),
            amplitude=self._estimate(
                amplitude, [0, 0, cosine / amplitude, sine / amplitude], unit
            ),
            phase=self._estimate(np.arctan2(cosine, sine), turn, 1.0),
            offset=offset,
            residual_sd=float(residual_sd),
            start=float(start),
            _curve=lambda t: unit * self.basis.curve(q, t * per_s),
        )

    def _estimate(self, value, gradient, factor):
        gradient = np.pad(gradient, (0, len(self.q) - len(gradient)))
        half = self.width * np.linalg.norm(gradient @ self.spread)
        return Estimate(*(float(factor * v) for v in (value, value - half, value + half)))
