"""The cone r(s) = r0 (1 − s/L_in) through a whisker's half-widths, with realistic standard errors.

Sections that do not belong (dust, a narrowing root) count little or nothing. The others deviate
from the cone in bumps, not independently, so the errors are those of as many sections as there
are independent bumps.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import toeplitz
from scipy.special import stdtrit
from skimage.measure import LineModelND, ransac

from pipeline.numerics.robust import robust_sd

TUKEY_SDS = 4.5
ROUNDS = 30
LEAST_SECTIONS = 12
LEAST_SD_PX = 0.005
TRIALS = 200  # of lines through two sections, of which the best is the start
LONGEST_LAG = 0.15  # of the whisker, over which bumps are looked for


@dataclass(frozen=True)
class ConeFit:
    """A cone through the half-widths of a whisker.

    Attributes
    ----------
    base, slope : half-width at s = 0 [px], and its decrease per px
    covariance : (2, 2) of both
    used : bool (sections,)
    scatter : SD of the used half-widths about the cone [px]
    independent : how many independent sections the used ones are worth
    """

    base: float
    slope: float
    covariance: np.ndarray
    used: np.ndarray
    scatter: float
    independent: float

    def __call__(self, s):
        """Half-width [px] at `s` [px]."""
        return self.base - self.slope * np.asarray(s)

    def se_at(self, s) -> float:
        """Standard error of the half-width at `s` [px]."""
        row = np.array([1.0, -s])
        return float(np.sqrt(row @ self.covariance @ row))


def fit_cone(s, half_width, se, doubt) -> ConeFit:
    """Fit a cone to half-widths with standard errors `se` at `s`, each (sections,) [px].

    All half-widths may be off together by `doubt` (sections,) [px].
    """
    if len(s) < LEAST_SECTIONS:
        raise ValueError(f"sections must be at least {LEAST_SECTIONS}, got {len(s)}")
    basis = np.column_stack([np.ones_like(s), -s])
    q = _start(s, half_width)
    for _ in range(ROUNDS):
        cone = basis @ q
        residual = half_width - cone
        sd = _spread(residual, cone, se)
        z = residual / (TUKEY_SDS * sd)
        weight = np.where(np.abs(z) < 1, (1 - z**2) ** 2, 0.0) / sd**2
        matrix = (basis * weight[:, None]).T @ basis
        q = np.linalg.solve(matrix, basis.T @ (weight * half_width))
    used = np.abs(residual) < TUKEY_SDS * sd
    correlation = _correlation(np.where(used, residual / sd, 0.0), used)
    weighed = np.linalg.inv(matrix) @ (basis * (weight * sd * used)[:, None]).T
    spread = float(np.mean((residual / sd)[used] ** 2))
    covariance = spread * weighed @ toeplitz(correlation) @ weighed.T
    independent = used.sum() / (correlation[0] + 2 * correlation[1:].sum())
    covariance *= independent / max(independent - 2, 1)
    together = np.linalg.solve(matrix, basis.T @ (weight * doubt))
    covariance += np.outer(together, together)
    return ConeFit(
        base=float(q[0]),
        slope=float(q[1]),
        covariance=covariance,
        used=used,
        scatter=float(residual[used].std()),
        independent=float(independent),
    )


def students_factor(independent) -> float:
    """How much wider a 95 % interval is for so few independent sections than for many."""
    return float(stdtrit(max(independent - 2, 2.0), 0.975) / stdtrit(np.inf, 0.975))


def _spread(residual, cone, se):
    """SD (sections,) of half-widths about the cone: of the fit, and a share of the radius."""
    thick = cone > np.median(cone)
    share = robust_sd(residual[thick] / np.maximum(cone[thick], 0.1), about=0.0)
    return np.sqrt(se**2 + (share * np.maximum(cone, 0.0)) ** 2 + LEAST_SD_PX**2)


def _start(s, half_width):
    """Base and slope of the line that most sections lie near."""
    points = np.column_stack([s, half_width])
    spread = robust_sd(half_width)
    model, _ = ransac(points, LineModelND, 2, max(0.03 * spread, 0.02), max_trials=TRIALS, rng=0)
    low, high = model.predict_y(np.array([0.0, s[-1]]))
    return np.array([low, (low - high) / s[-1]])


def _correlation(z, used):
    """Correlation of standardised residuals against their distance, 0 from where it is noise."""
    power = float(np.mean(z[used] ** 2)) or 1.0
    out, weight = np.zeros(len(z)), used.astype(float)
    out[0] = 1.0
    for lag in range(1, int(LONGEST_LAG * len(z)) + 1):
        pairs = float(weight[lag:] @ weight[:-lag])
        if pairs < 4:
            break
        out[lag] = float(z[lag:] @ z[:-lag]) / pairs / power
        if out[lag] < 1 / np.sqrt(pairs):
            out[lag] = 0.0
            break
    return out
