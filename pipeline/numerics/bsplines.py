"""Uniform cubic B-splines along an index, fitted by weighted, penalised least squares.

A curve is sampled at nodes 0, 1, 2 … (one pixel of arc length apart); knots stand `spacing`
nodes apart, so the spline's smoothing is a physical length. All normal equations have a
half-bandwidth of three and are solved in place, in time linear in the number of nodes.
"""

import numpy as np
from numba import njit

BAND = 4  # diagonal and three above it
SECOND, THIRD = (1.0, -2.0, 1.0), (1.0, -3.0, 3.0, -1.0)  # differences of coefficients


@njit(cache=True, inline="always")
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
    last = int((n - 1) * (1.0 / spacing))
    return last + 4 + (int(np.ceil((last + 1) * spacing)) < n)  # as `_end` rounds


@njit(cache=True, inline="always")
def _end(j, last, n, spacing):
    """One past the last node of knot interval `j`, of which `last` is the last that holds any."""
    return n if j == last else min(int(np.ceil((j + 1) * spacing)), n)


@njit(cache=True)
def basis_at_nodes(n, spacing):
    """The four values of the basis at nodes 0 … n − 1, (4, n); that of fewer nodes begins so."""
    out, at = np.empty((4, n)), np.empty(n)
    b0, b1, b2, b3 = out[0], out[1], out[2], out[3]
    per_node = 1.0 / spacing
    last = n_coefficients(n, spacing) - 4
    start = 0
    for j in range(last + 1):
        end = _end(j, last, n, spacing)
        for i in range(start, end):
            at[i] = i * per_node - j
        start = end
    for i in range(n):  # all at once, for vector instructions
        b0[i], b1[i], b2[i], b3[i] = basis(at[i])
    return out


@njit(cache=True)
def normal_equations(weight, target, n, at_nodes, spacing, band, rhs):
    """Fill `band` (k, 4) and `rhs` (k,) with Σ weight B Bᵀ and Σ B target; return k.

    `target` is already multiplied by its weight (an information-form right-hand side);
    `at_nodes` are the `basis_at_nodes`, of `n` nodes at least.
    """
    k = n_coefficients(n, spacing)
    band[:k] = 0.0
    rhs[:k] = 0.0
    start = 0
    for j in range(k - 3):
        end = _end(j, k - 4, n, spacing)
        m00 = m01 = m02 = m03 = m11 = m12 = m13 = m22 = m23 = m33 = 0.0
        r0 = r1 = r2 = r3 = 0.0
        for i in range(np.uint64(start), np.uint64(end)):
            b0, b1, b2, b3 = at_nodes[0, i], at_nodes[1, i], at_nodes[2, i], at_nodes[3, i]
            w0, w1, w2, w3 = weight[i] * b0, weight[i] * b1, weight[i] * b2, weight[i] * b3
            m00 += w0 * b0
            m01 += w0 * b1
            m02 += w0 * b2
            m03 += w0 * b3
            m11 += w1 * b1
            m12 += w1 * b2
            m13 += w1 * b3
            m22 += w2 * b2
            m23 += w2 * b3
            m33 += w3 * b3
            r0 += b0 * target[i]
            r1 += b1 * target[i]
            r2 += b2 * target[i]
            r3 += b3 * target[i]
        rows = (m00, m01, m02, m03), (m11, m12, m13, 0.0), (m22, m23, 0.0, 0.0)
        for p in range(3):
            for q in range(4 - p):
                band[j + p, q] += rows[p][q]
        band[j + 3, 0] += m33
        rhs[j] += r0
        rhs[j + 1] += r1
        rhs[j + 2] += r2
        rhs[j + 3] += r3
        start = end
    return k


@njit(cache=True)
def right_hand_side(target, n, at_nodes, spacing, rhs):
    """Fill `rhs` (k,) with Σ B target, as `normal_equations` does."""
    k = n_coefficients(n, spacing)
    rhs[:k] = 0.0
    start = 0
    for j in range(k - 3):
        end = _end(j, k - 4, n, spacing)
        r0 = r1 = r2 = r3 = 0.0
        for i in range(np.uint64(start), np.uint64(end)):
            r0 += at_nodes[0, i] * target[i]
            r1 += at_nodes[1, i] * target[i]
            r2 += at_nodes[2, i] * target[i]
            r3 += at_nodes[3, i] * target[i]
        rhs[j] += r0
        rhs[j + 1] += r1
        rhs[j + 2] += r2
        rhs[j + 3] += r3
        start = end


@njit(cache=True)
def add_difference_penalty(band, k, weights, strength):
    """Add strength × Σ (Σ_p weights[p] c[i + p])² to the normal equations; weights as `SECOND`."""
    for i in range(k - len(weights) + 1):
        for p in range(len(weights)):
            for q in range(p, len(weights)):
                band[i + p, q - p] += strength * weights[p] * weights[q]


@njit(cache=True)
def add_smoothness_prior(band, rhs, k, weights, knot_x, knot_y, nx, ny, n, spacing, strength):
    """Hold differences of line + offset near zero, weights as `SECOND` or `THIRD`.

    By its second differences a line is straight, by its third its curvature changes gradually.

    knot_x, knot_y : coefficients of the reference line, which the offset spline is added to
    nx, ny : normals at its nodes
    """
    d = weights
    for i in range(k - len(d) + 1):
        if int((i + len(d) - 2) * spacing) > n - 1:
            continue
        middle = int((i + 0.5 * (len(d) - 3)) * spacing)
        bend = 0.0
        for p in range(len(d)):
            bend += d[p] * (knot_x[i + p] * nx[middle] + knot_y[i + p] * ny[middle])
        for p in range(len(d)):
            rhs[i + p] -= strength * d[p] * bend
            for q in range(p, len(d)):
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
def evaluate(coefficients, n, at_nodes, spacing, out):
    """Write the spline's values at nodes 0 … n − 1 into `out`; `at_nodes` as above."""
    b0, b1, b2, b3 = at_nodes[0], at_nodes[1], at_nodes[2], at_nodes[3]
    last = n_coefficients(n, spacing) - 4
    start = 0
    for j in range(last + 1):
        end = _end(j, last, n, spacing)
        c0, c1, c2, c3 = (
            coefficients[j], coefficients[j + 1], coefficients[j + 2], coefficients[j + 3]
        )  # fmt: skip
        for i in range(np.uint64(start), np.uint64(end)):
            out[i] = b0[i] * c0 + b1[i] * c1 + b2[i] * c2 + b3[i] * c3
        start = end


@njit(cache=True)
def smooth(x, y, n, at_nodes, spacing, band, knot_x, knot_y):
    """Project a curve's nodes (n,) in place onto the splines of that knot spacing.

    All nodes weigh alike. `knot_x` and `knot_y` (k,) become the coefficients.
    """
    k = normal_equations(np.ones(n), x, n, at_nodes, spacing, band, knot_x)
    right_hand_side(y, n, at_nodes, spacing, knot_y)
    add_difference_penalty(band, k, THIRD, 1e-3)
    factorise(band, k)
    solve_factorised(band, knot_x, k)
    solve_factorised(band, knot_y, k)
    evaluate(knot_x, n, at_nodes, spacing, x)
    evaluate(knot_y, n, at_nodes, spacing, y)
