"""Exact modes of the truncated cone: Bessel functions and the 4×4 frequency equation.

φ(ξ) = ξ⁻¹ [a J₂(z) + b Y₂(z) + c I₂(z) + d K₂(z)], ξ = 1 − λx, z = (2/λ) √(p' ξ).
Differentiating ξ^(−n/2) C_n(2α√ξ) by ξ raises the order, ∓α ξ^(−(n+1)/2) C_(n+1), so that every
derivative is again one Bessel function. I and K are scaled by their exponentials. The tip of a
full cone is a limit: at ξ = 0 only J and I stay finite, and they meet the free end by themselves.
Near it Y and K grow alike at the tip; there K gives way to Y + (2/π) K, free of what they share.
"""

from functools import lru_cache

import numpy as np
from scipy import special
from scipy.optimize import brentq

_SHARP_TIP = 1e-9  # below this ξ at the tip the singular solutions' share is under rounding
_SMALLEST_Z = 0.05  # below, the four solutions are too alike to distinguish in 16 digits


@lru_cache(maxsize=64)
def bessel_modes(taper, stiffness, n_modes):
    """Exact p' (n_modes,), and the amplitudes of the solutions (n_modes, 4 or 2).

    Parameters are those of `polynomial_modes`; 0 < taper ≤ 1. The pinned end's rigid rotation is
    p' = 0 with amplitudes NaN.
    """
    rigid = 1 if stiffness == 0 else 0
    roots = _roots(taper, stiffness, n_modes - rigid)
    amplitudes = np.array([_null_vector(taper, stiffness, root) for root in roots])
    p = np.concatenate([np.zeros(rigid), roots**2])
    width = 2 if 1 - taper < _SHARP_TIP else 4
    amplitudes = amplitudes.reshape(-1, width)
    return p, np.concatenate([np.full((rigid, width), np.nan), amplitudes])


def bessel_shape(taper, p_prime, amplitudes, x, derivative=0):
    """One mode's φ or derivative by x at `x`, not normalised, in the shape of `x`."""
    if p_prime == 0:
        return np.asarray(x, dtype=float) if derivative == 0 else np.full_like(x, derivative == 1)
    return np.tensordot(amplitudes, _solutions(taper, np.sqrt(p_prime), x, derivative), 1)


def _solutions(taper, root, x, derivative):
    """d-th derivative by x of the solutions J, I (and Y, K) at x, (2 or 4, *x.shape).

    `root` = √p'. I is scaled by its exponential at the base, K by that at the tip.
    """
    order = 2 + derivative
    xi = np.maximum(1 - taper * np.asarray(x, dtype=float), 0.0)
    base, tip = 2 * root / taper, 2 * root / taper * np.sqrt(1 - taper)
    z = base * np.sqrt(xi)
    per = root**derivative * base**order  # ξ^(−order/2) = (2√p'/λ)^order z^−order
    limit = 0.5**order / special.factorial(order)  # of J and I over z^order, at z = 0
    z_safe = np.maximum(z, 1e-8)
    power = z_safe**-order
    growth = np.exp(z_safe - base)
    ordinary = np.where(z < z_safe, limit, special.jv(order, z_safe) * power)
    modified = np.where(z < z_safe, limit, special.ive(order, z_safe) * power) * growth
    out = [ordinary, (-1) ** derivative * modified]
    if 1 - taper >= _SHARP_TIP:
        singular = special.yv(order, z) * z**-order
        decaying = special.kve(order, z) * np.exp(tip - z) * z**-order
        if tip < 1:
            decaying = singular + 2 / np.pi * np.exp(-tip) * decaying
        out += [singular, decaying]
    return per * np.stack(out)


def _conditions(taper, stiffness, root):
    """The end conditions' square matrix by columns of unit height, and the columns' heights."""
    base = [_solutions(taper, root, np.zeros(()), d) for d in range(3)]
    turn = base[1] if np.isinf(stiffness) else base[2] - stiffness * base[1]
    rows = [base[0], turn]
    if 1 - taper >= _SHARP_TIP:
        rows += [_solutions(taper, root, np.ones(()), d) for d in (2, 3)]
    # heights are positive and change steadily with root, so the determinant keeps its sign
    matrix = np.array(rows)
    matrix = matrix / np.abs(matrix).max(axis=1, keepdims=True)
    heights = np.abs(matrix).max(axis=0)
    matrix = matrix / heights
    rows = np.abs(matrix).max(axis=1, keepdims=True)
    return matrix / rows, heights


def _roots(taper, stiffness, n_modes):
    """√p' of the first modes, from sign changes of the determinant.

    Successive modes lie about π apart in z(base) − z(tip), which sets the step of the search.
    """

    def determinant(root):
        return np.linalg.det(_conditions(taper, stiffness, root)[0])

    step = np.pi / 12 * taper / (2 * (1 - np.sqrt(max(1 - taper, 0.0))))
    low = min(_SMALLEST_Z * taper / 2, step)
    left, at_left, roots = low, determinant(low), []
    while len(roots) < n_modes:
        right = left + step
        at_right = determinant(right)
        if at_left * at_right < 0:
            roots.append(brentq(determinant, left, right, xtol=1e-15, rtol=1e-15))
        left, at_left = right, at_right
        if left > 400 * step + 40 * step * n_modes:
            raise ValueError(
                f"follicle stiffness {stiffness!r} (k L/(E I0)) gives a first mode too slow for "
                f"the exact frequency equation; use basis 'complete'"
            )
    return np.array(roots)


def _null_vector(taper, stiffness, root):
    """Amplitudes of the solutions that meet the end conditions."""
    matrix, heights = _conditions(taper, stiffness, root)
    return np.linalg.svd(matrix)[2][-1] / heights
