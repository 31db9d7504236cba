"""Modes of the truncated cone in a complete polynomial basis, exact to rounding.

((1 − λx)⁴ φ'')'' = p'² (1 − λx)² φ, x in units of L (Eq. 34). The unknown is the curvature φ'',
a polynomial on each panel, made orthonormal in the bending energy; φ follows by integrating
twice from the base, with the base's rotation as one more unknown unless it is fixed. Then the
bending energy is the unit matrix and the eigenvalues wanted, 1/p'², are the *largest* of the mass
matrix: the low modes keep all digits however many terms there are (a stiffness matrix built
from polynomials would lose them). A follicle of torsional stiffness k_θ adds κ φ'(0)² to the
energy, κ = k_θ L/(E I0), and makes the problem no harder: it is self-adjoint (Eq. 33 with
φ''(0) = κ φ'(0) has no boundary term left).
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.polynomial import legendre
from scipy.linalg import eigh, null_space, solve_triangular
from scipy.special import roots_legendre

_BLUNT = 0.25  # from this ξ at the tip on, one panel does
_GRADING = 5.0  # ratio of ξ at a panel's ends, near the tip


@dataclass(frozen=True, eq=False)
class PiecewisePolynomials:
    """Functions by their Legendre coefficients on panels.

    breaks (panels + 1,); coefficients[d] (panels, terms, functions) of the d-th derivative by x.
    """

    breaks: np.ndarray
    coefficients: tuple

    def __call__(self, x, derivative=0, side="left"):
        """Values (functions, *x.shape); at a break, of the panel on that `side`."""
        x = np.asarray(x, dtype=float)
        flat = x.ravel()
        panel = np.searchsorted(self.breaks[1:-1], flat, side=side)
        values = np.empty((self.coefficients[0].shape[2], flat.size))
        for e in np.unique(panel):
            here = panel == e
            middle = (self.breaks[e] + self.breaks[e + 1]) / 2
            half = (self.breaks[e + 1] - self.breaks[e]) / 2
            terms = self.coefficients[derivative][e]
            values[:, here] = legendre.legval((flat[here] - middle) / half, terms)
        return values.reshape(-1, *x.shape)

    def combined(self, weights):
        """The functions `self @ weights`, (functions, new functions)."""
        return PiecewisePolynomials(self.breaks, tuple(c @ weights for c in self.coefficients))


@lru_cache(maxsize=256)
def polynomial_modes(taper, stiffness, n_modes, n_terms, support=None):
    """First `n_modes` modes: p' (n_modes,) and φ as PiecewisePolynomials, ∫φ²(1−λx)² dx = 1.

    Parameters
    ----------
    taper : float
        λ, 0 to 1.
    stiffness : float
        κ = k_θ L/(E I0) of the follicle: inf is the fixed end, 0 the pinned one, whose rigid
        rotation (p' = 0) is its first mode.
    n_modes, n_terms : int
        Modes wanted, and polynomial terms per panel.
    support : float, optional
        Where the whisker is held, φ(support) = 0, in units of L.
    """
    breaks = _panel_breaks(taper, support)
    basis, mass = _energy_orthonormal(taper, breaks, n_terms)
    energy = np.eye(len(mass))
    energy[0, 0] = 0.0 if np.isinf(stiffness) else stiffness  # the first is the rotation, φ = x
    keep = np.eye(len(mass))[:, 1 if np.isinf(stiffness) else 0 :]
    if support is not None:
        keep = keep @ null_space(basis(np.array([support]))[:, 0][None, :] @ keep)
    energy, mass = keep.T @ energy @ keep, keep.T @ mass @ keep
    # shifted by the mass so that a vanishing p' is allowed; p'² then as Rayleigh's quotient
    _, vectors = eigh(mass, energy + mass)
    vectors = vectors[:, ::-1][:, :n_modes]
    norm = np.einsum("ik,ij,jk->k", vectors, mass, vectors)
    vectors = vectors / np.sqrt(norm)
    p_squared = np.einsum("ik,ij,jk->k", vectors, energy, vectors)
    if stiffness == 0 and support is None:
        p_squared[0] = 0.0
    return np.sqrt(p_squared), basis.combined(keep @ vectors)


def _panel_breaks(taper, support):
    """Ends of the panels: the support, and a geometric series towards an almost sharp tip.

    With ξ = 1 − λ at the tip small but not zero, φ'' falls to zero there within a length of
    that order, which one polynomial over the whole whisker would resolve only slowly.
    """
    inner = [] if support is None else [support]
    cut = 1 - taper
    if 1e-9 < cut < _BLUNT:
        xi = cut * _GRADING ** np.arange(1, 40)
        inner += [float((1 - v) / taper) for v in xi if v < 2 * _BLUNT]
    return np.array([0.0, *sorted(inner), 1.0])


def _energy_orthonormal(taper, breaks, n_terms):
    """Basis (rotation, then curvatures panel by panel) and its mass matrix."""
    nodes, weights = roots_legendre(n_terms + 4)
    halves = np.diff(breaks) / 2
    middles = breaks[:-1] + halves
    size = 1 + len(halves) * n_terms
    curvature = np.zeros((len(halves), n_terms, size))
    for e, (half, middle) in enumerate(zip(halves, middles, strict=True)):
        cross = 1 - taper * (middle + half * nodes)
        table = legendre.legvander(nodes, n_terms - 1)
        _, upper = np.linalg.qr(table * (np.sqrt(weights * half) * cross**2)[:, None])
        block = slice(1 + e * n_terms, 1 + (e + 1) * n_terms)
        curvature[e, :, block] = solve_triangular(upper, np.eye(n_terms))
    basis = _from_curvature(breaks, curvature)
    mass = np.zeros((size, size))
    for half, middle in zip(halves, middles, strict=True):
        x = middle + half * nodes
        phi = basis(x)
        mass += (phi * (weights * half * (1 - taper * x) ** 2)) @ phi.T
    return basis, mass


def _from_curvature(breaks, curvature):
    """Integrate twice from the base; function 0 starts with slope 1, the others with 0."""
    panels, _, size = curvature.shape
    slope_at, value_at = np.zeros(size), np.zeros(size)
    slope_at[0] = 1.0
    slopes, values, thirds = [], [], []
    for e in range(panels):
        half = (breaks[e + 1] - breaks[e]) / 2
        slope = half * legendre.legint(curvature[e], lbnd=-1)
        slope[0] += slope_at
        value = half * legendre.legint(slope, lbnd=-1)
        value[0] += value_at
        slope_at, value_at = slope.sum(axis=0), value.sum(axis=0)  # every P_n(1) = 1
        slopes.append(slope)
        values.append(value)
        thirds.append(legendre.legder(curvature[e]) / half)
    derivatives = (values, slopes, curvature, thirds)
    return PiecewisePolynomials(breaks, tuple(np.stack(list(c)) for c in derivatives))
