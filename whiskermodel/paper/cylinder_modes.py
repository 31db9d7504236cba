"""Eigenmodes of the cylinder and the paper's Ritz expansion in them (Eqs 21–42, 53–54).

Lengths are in units of the whisker's L. The hyperbolic functions are written as decaying
exponentials, so that modes of any number keep all their digits.
"""

from functools import lru_cache

import numpy as np
from scipy.linalg import eigh
from scipy.special import roots_legendre


def cylinder_wavenumbers(boundary, n_modes):
    """k_i L of the first `n_modes` bending modes, (n_modes,); "fixed" or "pinned".

    Fixed: cos kL cosh kL = −1 (Eq. 26); pinned: tan kL = tanh kL (Eq. 31), without the rigid
    rotation k = 0.
    """
    i = np.arange(1, n_modes + 1)
    k = np.pi * (i - 0.5 if boundary == "fixed" else i + 0.25)
    for _ in range(20):  # Newton; both right sides decay, so the large-i limit is a good start
        decay = np.exp(-k)
        sech = 2 * decay / (1 + decay**2)
        tanh = (1 - decay**2) / (1 + decay**2)
        if boundary == "fixed":
            step = (np.cos(k) + sech) / (np.sin(k) + sech * tanh)
        else:
            value = np.sin(k) - tanh * np.cos(k)
            step = -value / (np.cos(k) + tanh * np.sin(k) - sech**2 * np.cos(k))
        k = k + step
    return k


def cylinder_functions(boundary, n_modes, x, derivative=0):
    """Y_i and its derivatives by x in units of L, (n_modes, points), with ∫₀¹ Y_i² dx = 1.

    `x` (points,) from 0 to 1; Eq. 28 (fixed) and Eq. 32 (pinned). Any `derivative` ≥ 0.
    """
    k = cylinder_wavenumbers(boundary, n_modes)[:, None]
    x = np.asarray(x, dtype=float)[None, :]
    parts = _fixed_parts(k) if boundary == "fixed" else _pinned_parts(k)
    cosine, sine, falling, rising = parts
    quarter = np.pi / 2 * derivative
    y = cosine * np.cos(k * x + quarter) + sine * np.sin(k * x + quarter)
    y = y + (-1) ** derivative * falling * np.exp(-k * x) + rising * np.exp(-k * (1 - x))
    return k**derivative * y


def _fixed_parts(k):
    """Amplitudes of cos kx, sin kx, e^(−kx), e^(−k(1−x)); this form has unit norm."""
    decay = np.exp(-k)
    below = 1 - decay**2 + 2 * decay * np.sin(k)  # 2 e^(−k) (sinh k + sin k)
    alpha = (1 + decay**2 + 2 * decay * np.cos(k)) / below
    rising = (np.sin(k) - np.cos(k) - decay) / below  # e^k (1 − α)/2, without the difference
    return -np.ones_like(k), alpha, (1 + alpha) / 2, rising


def _pinned_parts(k):
    decay = np.exp(-k)
    rising = np.sin(k) / (1 - decay**2)  # of sin k sinh kx / sinh k
    # ∫Y² = Y(1)²/4 for a free tip over a base with Y = 0 and Y'Y'' = 0
    norm = np.abs(2 * np.sin(k)) / 2
    return np.zeros_like(k), 1 / norm, -rising * decay / norm, rising / norm


@lru_cache(maxsize=64)
def ritz_in_cylinder_functions(taper, boundary, n_modes, n_terms):
    """The paper's Ritz approximation (Eq. 40, truncated: Eq. 53–54).

    Returns p' (n_modes,) and coefficients C (n_terms, n_modes), ∫φ²(1−λx)² dx = 1.
    """
    nodes, weights = roots_legendre(4 * n_terms + 40)
    x, weights = (nodes + 1) / 2, weights / 2
    cross = 1 - taper * x
    y = cylinder_functions(boundary, n_terms, x)
    bent = cylinder_functions(boundary, n_terms, x, 2)
    scale = cylinder_wavenumbers(boundary, n_terms) ** 2  # keeps the pencil well conditioned
    stiffness = (bent * (weights * cross**4)) @ bent.T / np.outer(scale, scale)
    mass = (y * (weights * cross**2)) @ y.T / np.outer(scale, scale)
    inverse_square, c = eigh(mass, stiffness)  # 1/p'²: the low modes come out sharpest
    p = inverse_square[::-1][:n_modes] ** -0.5
    c = c[:, ::-1][:, :n_modes] * p / scale[:, None]  # ∫φ²(1−λx)² = 1
    return p, c
