"""Banded spline least squares against dense linear algebra."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from pipeline.numerics import bsplines


def dense_basis(n, spacing):
    """The basis as a full matrix, one row per node."""
    out = np.zeros((n, bsplines.n_coefficients(n, spacing)))
    for i in range(n):
        j = int(i * (1 / spacing))
        out[i, j : j + 4] = bsplines.basis(i * (1 / spacing) - j)
    return out


@settings(max_examples=30, deadline=None)
@given(
    n=st.integers(8, 120),
    spacing=st.floats(3.0, 20.0),
    seed=st.integers(0, 10**6),
    strength=st.floats(0.01, 100.0),
)
@example(n=66, spacing=2.6, seed=0, strength=1.0)  # the last node is at a knot but for rounding
def test_penalised_fit_equals_dense_solution(n, spacing, seed, strength):
    rng = np.random.default_rng(seed)
    weight, value = rng.uniform(0.1, 2, n), rng.standard_normal(n)
    band, rhs = np.zeros((n + 8, 4)), np.zeros(n + 8)
    at_nodes = bsplines.basis_at_nodes(n + 5, spacing)  # of more nodes than there are
    k = bsplines.normal_equations(weight, weight * value, n, at_nodes, spacing, band, rhs)
    bsplines.add_difference_penalty(band, k, bsplines.SECOND, strength)
    bsplines.factorise(band, k)
    bsplines.solve_factorised(band, rhs, k)

    basis = dense_basis(n, spacing)
    difference = np.diff(np.eye(k), 2, axis=0)
    matrix = basis.T @ (weight[:, None] * basis) + strength * difference.T @ difference
    expected = np.linalg.solve(matrix, basis.T @ (weight * value))
    np.testing.assert_allclose(rhs[:k], expected, atol=1e-7 * np.abs(expected).max() + 1e-7)


def test_basis_sums_to_one():
    for t in np.linspace(0, 1, 11):
        assert sum(bsplines.basis(t)) == pytest.approx(1)


def test_smooth_keeps_a_cubic():
    n, spacing = 200, 16.0
    i = np.arange(n)
    cubic = 3 + 0.1 * i - 2e-4 * i**2 + 1e-6 * i**3
    out, straight = cubic.copy(), i * 1.0
    knots = np.zeros((2, n))
    at_nodes = bsplines.basis_at_nodes(n, spacing)
    bsplines.smooth(out, straight, n, at_nodes, spacing, np.zeros((n, 4)), *knots)
    assert np.abs(out - cubic).max() < 0.02  # px; the weak third-difference penalty bends it
    assert np.abs(straight - i).max() < 1e-9


def straightened(y, strength=1e3, weights=bsplines.THIRD):
    """A line y (n,) after the smoothness prior has moved it, with hardly anything against it."""
    n, spacing = len(y), 10.0
    x, y = np.arange(n, dtype=float), y.copy()
    nx, ny = np.zeros(n), -np.ones(n)
    band, rhs = np.zeros((n, 4)), np.zeros(n)
    at_nodes = bsplines.basis_at_nodes(n, spacing)
    k = bsplines.normal_equations(np.full(n, 1e-3), np.zeros(n), n, at_nodes, spacing, band, rhs)
    knot_x, knot_y = np.zeros((2, n))
    bsplines.smooth(x, y, n, at_nodes, spacing, np.zeros((n, 4)), knot_x, knot_y)
    line = knot_x, knot_y, nx, ny, n, spacing
    bsplines.add_smoothness_prior(band, rhs, k, weights, *line, strength)
    for i in range(k):
        band[i, 0] += 1e-6
    bsplines.factorise(band, k)
    bsplines.solve_factorised(band, rhs, k)
    offset = np.zeros(n)
    bsplines.evaluate(rhs, n, at_nodes, spacing, offset)
    return y, y + ny * offset


def test_smoothness_prior_pulls_a_kinked_line_straight():
    kinked = np.abs(np.arange(200) - 100.0) * 0.05
    before, after = (np.diff(y[::10], 3)[2:-2] for y in straightened(kinked))
    assert (after**2).sum() < 0.35 * (before**2).sum()


def test_third_differences_leave_an_even_bend_and_second_ones_straighten_it():
    bent = 1e-3 * (np.arange(200) - 100.0) ** 2  # px, 10 of them off its chord
    before, after = straightened(bent)
    assert np.abs(after - before).max() < 0.3
    before, after = straightened(bent, strength=1e5, weights=bsplines.SECOND)
    assert np.abs(np.diff(after[:-20], 2)).max() < 0.05 * np.diff(before, 2)[0]


def test_smoothness_prior_holds_a_line_from_its_first_node_on():
    curled = 0.02 * np.maximum(12.0 - np.arange(200), 0.0) ** 2  # as at a fur's edge
    before, after = straightened(curled)
    assert before[0] > 2.0
    assert abs(after[0]) < 0.5 * before[0]
