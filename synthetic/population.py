"""Contacts as the paper's Fig. 3 d–f counts them: how strong, how long, how the two go together.

The two published distributions are drawn through smooth quantile functions that pass through the
published percentiles and have the published means; a Gaussian copula gives the published r².
Contact number i is the same however many there are: a Kronecker sequence fills the distributions
evenly, so that small sessions already look like large ones.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.optimize import brentq
from scipy.special import ndtr, ndtri

PUBLISHED_CONTACTS = 12417
PUBLISHED_R2 = 0.368  # of peak force on duration

_PROBABILITIES = np.array([0.0005, 0.05, 0.5, 0.8, 0.95, 0.9995])
_STEPS = np.array([0.7548776662466927, 0.5698402909980532])  # of the plane's Kronecker sequence


@dataclass(frozen=True)
class Published:
    """A published distribution: 5 %, 50 %, 95 % and mean, and ends that seem likely."""

    least: float
    p5: float
    median: float
    p95: float
    most: float
    mean: float


PEAK_FORCE_UN = Published(0.8, 1.8, 16.1, 44.4, 75.0, 19.6)
DURATION_MS = Published(2.6, 5.0, 16.0, 113.0, 260.0, 30.9)


@lru_cache
def quantile_function(published: Published):
    """Smooth quantile function of a published distribution, of normal deviates z.

    Its 80 % point, which the paper does not give, is set so that the mean is the published one.
    """
    z = ndtri(_PROBABILITIES)
    grid = np.linspace(*z[[0, -1]], 4001)
    share = np.gradient(ndtr(grid))

    def values(p80):
        knots = (
            published.least, published.p5, published.median, p80, published.p95, published.most
        )  # fmt: skip
        return PchipInterpolator(z, np.log(knots))

    def excess(p80):
        return np.sum(np.exp(values(p80)(grid)) * share) / share.sum() - published.mean

    log_quantile = values(brentq(excess, 1.02 * published.median, 0.98 * published.p95))
    return lambda deviate: np.exp(log_quantile(np.clip(deviate, z[0], z[-1])))


@lru_cache
def copula_correlation() -> float:
    """Correlation of the normal deviates that gives the published r²."""
    z = _deviates(np.arange(20000), (0.5, 0.5))
    duration = np.maximum(np.rint(quantile_function(DURATION_MS)(z[:, 0])), 3)

    def excess(rho):
        force = quantile_function(PEAK_FORCE_UN)(_joined(z, rho))
        return np.corrcoef(force, duration)[0, 1] - np.sqrt(PUBLISHED_R2)

    return brentq(excess, 0.2, 0.95)


def draw_contacts(numbers, seed: int):
    """Peak force [N] and duration [ms, whole numbers >= 3] of the contacts with these numbers.

    `numbers` is int (contacts,), each >= 0; the same number and seed give the same contact.
    """
    start = np.random.default_rng([seed, 31]).uniform(size=2)
    z = _deviates(np.asarray(numbers), start)
    duration = np.maximum(np.rint(quantile_function(DURATION_MS)(z[:, 0])), 3).astype(int)
    force = quantile_function(PEAK_FORCE_UN)(_joined(z, copula_correlation()))
    return 1e-6 * force, duration


def _deviates(numbers, start):
    """Two independent normal deviates per contact, (contacts, 2), evenly spread."""
    uniform = np.mod(np.asarray(start) + numbers[:, None] * _STEPS, 1)
    return ndtri(np.clip(uniform, 1e-6, 1 - 1e-6))


def _joined(z, rho):
    return rho * z[:, 0] + np.sqrt(1 - rho**2) * z[:, 1]


def share_out(forces, able, rng):
    """Give each contact a pole that can bear it, about as many to each.

    Parameters
    ----------
    forces : (contacts,) wanted peak forces [N]; the hardest to place come first
    able : bool (contacts, poles), which poles can bear which contact
    rng : numpy Generator

    Returns
    -------
    int (contacts,), the pole's index, −1 where no pole is able
    """
    able = np.asarray(able, bool)
    room = np.full(able.shape[1], -(-len(forces) // able.shape[1]))
    chosen = np.full(len(forces), -1)
    for i in np.lexsort([-np.asarray(forces), able.sum(1)]):
        if not able[i].any():
            continue
        weight = able[i] * np.maximum(room, 1e-6)
        chosen[i] = rng.choice(len(room), p=weight / weight.sum())
        room[chosen[i]] -= 1
    return chosen
