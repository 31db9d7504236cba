"""Uniform cubic B-splines along an index, fitted by weighted, penalised least squares.

A curve is sampled at nodes 0, 1, 2 … (one pixel of arc length apart); knots stand `spacing`
nodes apart, so the spline's smoothing is a physical length. All normal equations have a
half-bandwidth of three and are solved in place, in time linear in the number of nodes.
"""

import numpy as np
from numba import njit

BAND = 4  # diagonal and three above it


@njit(cache=True)
def basis(t):
    """Return the four cubic B-spline values on the knot interval at fraction `t` in [0, 1)."""
    v = 1.0 - t
    return (
        v * v * v / 6.0,
        (3.0 * t * t * t - 6.0 * t * t + 4.0) / 6.0,
        (3.0 * v * v * v - 6.0 * v * v + 4.0) / 6.0,
        t * t * t / 6.0,
    )


@njit(cache=True)
def n_coefficients(n, spacing):
    """Return how many coefficients a spline over `n` nodes has."""
    return int((n - 1) * (1.0 / spacing)) + 4


@njit(cache=True)
def normal_equations(weight, target, n, spacing, band, rhs):
    """Fill `band` (k, 4) and `rhs` (k,) with Σ weight B Bᵀ and Σ B target; return k.

    `target` is already multiplied by its weight (an information-form right-hand side).
    """
    k = n_coefficients(n, spacing)
    band[:k] = 0.0
    rhs[:k] = 0.0
    per_node = 1.0 / spacing
    for i in range(n):
        j = int(i * per_node)
        b = basis(i * per_node - j)
        for p in range(4):
            rhs[j + p] += b[p] * target[i]
            wb = weight[i] * b[p]
            for q in range(p, 4):
                band[j + p, q - p] += wb * b[q]
    return k


@njit(cache=True)
def add_second_difference_penalty(band, k, strength):
    """Add strength × Σ (c[i] − 2 c[i+1] + c[i+2])² to the normal equations."""
    d = (1.0, -2.0, 1.0)
    for i in range(k - 2):
        for p in range(3):
            for q in range(p, 3):
                band[i + p, q - p] += strength * d[p] * d[q]


@njit(cache=True)
def add_third_difference_penalty(band, k, strength):
    """Add strength × Σ (c[i] − 3 c[i+1] + 3 c[i+2] − c[i+3])² to the normal equations."""
    d = (1.0, -3.0, 3.0, -1.0)
    for i in range(k - 3):
        for p in range(4):
            for q in range(p, 4):
                band[i + p, q - p] += strength * d[p] * d[q]


@njit(cache=True)
def add_smoothness_prior(band, rhs, k, knot_x, knot_y, nx, ny, n, spacing, strength):
    """Hold the third differences of line + offset near zero: its curvature changes gradually.

    knot_x, knot_y : coefficients of the reference line, which the offset spline is added to
    nx, ny : normals at its nodes
    """
    d = (1.0, -3.0, 3.0, -1.0)
    for i in range(k - 3):
        if i < 1 or int((i + 2) * spacing) > n - 1:
            continue
        middle = int((i + 0.5) * spacing)
        bend = 0.0
        for p in range(4):
            bend += d[p] * (knot_x[i + p] * nx[middle] + knot_y[i + p] * ny[middle])
        for p in range(4):
            rhs[i + p] -= strength * d[p] * bend
            for q in range(p, 4):
                band[i + p, q - p] += strength * d[p] * d[q]


@njit(cache=True)
def factorise(band, k):
    """Replace the banded symmetric positive definite matrix by its LDLᵀ factors."""
    for i in range(k):
        pivot = band[i, 0]
        if pivot <= 1e-300:
            pivot = 1e-300
            band[i, 0] = pivot
        for p in range(1, BAND):
            if i + p >= k:
                break
            factor = band[i, p] / pivot
            for q in range(p, BAND):
                if i + q < k:
                    band[i + p, q - p] -= factor * band[i, q]
        for p in range(1, BAND):
            band[i, p] /= pivot


@njit(cache=True)
def solve_factorised(band, rhs, k):
    """Solve with the factors of `factorise`; `rhs` (k,) becomes the solution."""
    for i in range(k):
        for p in range(1, BAND):
            if i + p < k:
                rhs[i + p] -= band[i, p] * rhs[i]
    for i in range(k):
        rhs[i] /= band[i, 0]
    for i in range(k - 1, -1, -1):
        for p in range(1, BAND):
            if i + p < k:
                rhs[i] -= band[i, p] * rhs[i + p]


@njit(cache=True)
def evaluate(coefficients, n, spacing, out):
    """Write the spline's values at nodes 0 … n − 1 into `out`."""
    per_node = 1.0 / spacing
    for i in range(n):
        j = int(i * per_node)
        b = basis(i * per_node - j)
        total = 0.0
        for p in range(4):
            total += b[p] * coefficients[j + p]
        out[i] = total


@njit(cache=True)
def smooth(x, y, n, spacing, band, knot_x, knot_y):
    """Project a curve's nodes (n,) in place onto the splines of that knot spacing.

    All nodes weigh alike. `knot_x` and `knot_y` (k,) become the coefficients.
    """
    k = normal_equations(np.ones(n), x, n, spacing, band, knot_x)
    right_hand_side(y, n, spacing, knot_y)
    add_third_difference_penalty(band, k, 1e-3)
    factorise(band, k)
    solve_factorised(band, knot_x, k)
    solve_factorised(band, knot_y, k)
    evaluate(knot_x, n, spacing, x)
    evaluate(knot_y, n, spacing, y)


@njit(cache=True)
def right_hand_side(target, n, spacing, rhs):
    """Fill `rhs` (k,) with Σ B target, as `normal_equations` does."""
    rhs[: n_coefficients(n, spacing)] = 0.0
    per_node = 1.0 / spacing
    for i in range(n):
        j = int(i * per_node)
        b = basis(i * per_node - j)
        for p in range(4):
            rhs[j + p] += b[p] * target[i]
