"""Gauss–Newton's normal equations of a rod and the stations seen, solved by Cholesky."""

from typing import NamedTuple

import numpy as np
from numba import njit

from pipeline.forces.rod_integration import LOADED
from pipeline.forces.rod_types import COMPILED
from pipeline.kinematics.base_curves import HUBER
from pipeline.numerics.cholesky import solve


class Sums(NamedTuple):
    """Misfit and weight of every station, normal equations, their solution's parts, and the
    prior's rest shape `mean`."""

    misfit: np.ndarray
    weight: np.ndarray
    share: np.ndarray
    normal: np.ndarray
    rhs: np.ndarray
    lower: np.ndarray
    inverse: np.ndarray
    mean: np.ndarray


@njit(**COMPILED)
def empty_sums(m, terms):
    """Sums of `m` stations and `terms` rest coefficients to be filled."""
    square = (LOADED, LOADED)
    return Sums(
        np.zeros(m), np.zeros(m), np.zeros(m),
        np.zeros(square), np.zeros(LOADED), np.zeros(square), np.zeros(square), np.zeros(terms),
    )  # fmt: skip


@njit(**COMPILED)
def fill_equations(seen, rod, size, precision, p, sums, chi2, robust):
    """Fill Gauss–Newton's normal equations; returns the reduced χ² of the misfit.

    `chi2` is what it was before, or, of a first guess that is not `robust`, what is usual.
    """
    mean, normal, rhs = sums.mean, sums.normal, sums.rhs
    terms, usual = len(mean), chi2
    chi2 = weigh(seen, rod, chi2, robust, sums.misfit, sums.weight)
    _products(rod.shift, sums.misfit, sums.weight, size, sums.share, normal, rhs)
    # the covariance is scaled by χ² afterwards, the prior must not be
    inflate = max(chi2 if robust else usual, 1.0)
    for a in range(terms):
        for b in range(terms):
            normal[2 + a, 2 + b] += precision[a, b] * inflate
            rhs[2 + a] += precision[a, b] * inflate * (mean[b] - p[2 + b])
    return chi2


@njit(**COMPILED)
def weigh(seen, rod, chi2, robust, misfit, weight):
    """Fill misfit [m] and weight [1/m²] of every station, 0 where none was seen; returns χ²."""
    info = seen.information
    total, count = 0.0, 0
    for k in range(len(info)):
        known = info[k] > 0
        misfit[k] = misfit_of(seen, rod, k) if known else 0.0
        weight[k] = info[k] if known else 0.0
        count += known
    if robust:
        scale = 1 / max(chi2, 1.0)
        for k in range(len(info)):
            weight[k] = robust_weight(weight[k], misfit[k], scale)
    for k in range(len(info)):
        total += weight[k] * misfit[k] * misfit[k]
    return total / max(count - 4, 1)


@njit(**COMPILED)
def _products(shift, misfit, weight, size, share, normal, rhs):
    """Fill Σ weight shift shiftᵀ and Σ weight shift misfit of the first `size` parameters."""
    m = len(misfit)
    for a in range(size):
        one, total = shift[a], 0.0
        for k in range(m):
            share[k] = weight[k] * one[k]
            total += share[k] * misfit[k]
        rhs[a] = total
        for b in range(a + 1):
            other, total = shift[b], 0.0
            for k in range(m):
                total += share[k] * other[k]
            normal[a, b] = total
            normal[b, a] = total


@njit(**COMPILED, inline="always")
def robust_weight(info, misfit, scale):
    """Information of a station, less where it lies off by more than HUBER usual misfits.

    `scale`: 1/χ² of all stations, at most 1.
    """
    deviation = abs(misfit) * np.sqrt(info * scale)
    return info * (HUBER / deviation if deviation > HUBER else 1.0)


@njit(**COMPILED, inline="always")
def misfit_of(seen, rod, k):
    """How far station `k` was seen to lie beside the rod, along its normal [m]."""
    return (seen.y[k] - rod.y[k]) * rod.cos[k] - (seen.x[k] - rod.x[k]) * rod.sin[k]


@njit(**COMPILED)
def take_step(size, p, lower, rhs):
    """One Gauss–Newton step of `p`; returns its length, of all together, in SD where χ² is 1.

    `lower` as in `factorise`; `rhs` becomes the step.
    """
    square = solve(lower, size, rhs)
    # half a radian at most: the rod is integrated again before it goes on
    rhs[:size] *= min(1.0, 0.5 / max(abs(rhs[1]), 1e-9))
    p[:size] += rhs[:size]
    return np.sqrt(square)
