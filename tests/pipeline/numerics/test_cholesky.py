"""Cholesky factors in loops, beside NumPy's."""

import numpy as np
import pytest

from pipeline.numerics.cholesky import factorise, invert, solve

ROUNDING = 1e-9  # relative


@pytest.fixture(params=[1, 3, 6])
def system(request):
    """A well-conditioned matrix in the leading block of a larger array, and a right side."""
    rng = np.random.default_rng(request.param)
    size = request.param
    root = rng.normal(size=(size + 4, size))
    matrix = np.full((8, 8), np.nan)
    matrix[:size, :size] = root.T @ root
    return matrix, size, rng.normal(size=size)


def test_solution_and_its_square(system):
    matrix, size, rhs = system
    lower, solution = np.empty((8, 8)), rhs.copy()
    assert factorise(matrix, size, lower)
    square = solve(lower, size, solution)
    np.testing.assert_allclose(matrix[:size, :size] @ solution, rhs, rtol=ROUNDING)
    assert square == pytest.approx(rhs @ solution, rel=ROUNDING)


def test_inverse(system):
    matrix, size, _ = system
    lower, inverse = np.empty((8, 8)), np.empty((8, 8))
    assert factorise(matrix, size, lower)
    invert(lower, size, inverse)
    block = np.s_[:size, :size]
    np.testing.assert_allclose(inverse[block], np.linalg.inv(matrix[block]), rtol=1e-7)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -1.0, 0.0])
def test_a_matrix_that_has_no_factor(bad):
    matrix = np.eye(3)
    matrix[1, 1] = bad
    assert not factorise(matrix, 3, np.empty((3, 3)))


def test_a_singular_matrix_has_no_factor():
    assert not factorise(np.ones((2, 2)), 2, np.empty((2, 2)))
