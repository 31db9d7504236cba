"""Small symmetric positive definite systems in compiled loops, in place."""

import numpy as np
from numba import njit

LEAST_PIVOT = 1e-13  # of the diagonal: what is less is rounding


@njit(cache=True, error_model="numpy")
def factorise(matrix, size, lower):
    """Cholesky factor of the symmetric leading block; False where it has none to speak of.

    Its diagonal holds reciprocals: nothing divides afterwards.
    """
    for a in range(size):
        for b in range(a + 1):
            total = matrix[a, b]
            for k in range(b):
                total -= lower[a, k] * lower[b, k]
            if a > b:
                lower[a, b] = total * lower[b, b]
            elif not total > LEAST_PIVOT * matrix[a, a]:  # nor if it is NaN or infinite
                return False
            else:
                lower[a, a] = 1 / np.sqrt(total)
    return True


@njit(cache=True)
def solve(lower, size, rhs):
    """Solve with the factor of `factorise`, in place; returns rhsᵀ solution."""
    square = 0.0
    for a in range(size):
        total = rhs[a]
        for k in range(a):
            total -= lower[a, k] * rhs[k]
        rhs[a] = total * lower[a, a]
        square += rhs[a] * rhs[a]
    for a in range(size - 1, -1, -1):
        total = rhs[a]
        for k in range(a + 1, size):
            total -= lower[k, a] * rhs[k]
        rhs[a] = total * lower[a, a]
    return square


@njit(cache=True)
def invert(lower, size, inverse):
    """Fill the leading block of `inverse`, given the factor of `factorise`."""
    for a in range(size):
        column = inverse[a]  # which is a row as well
        for b in range(size):
            column[b] = 1.0 if a == b else 0.0
        solve(lower, size, column)
