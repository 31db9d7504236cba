"""Eigenmodes of a whisker held at its base: frequencies, shapes and their derivatives.

Three bases for the same cone ((1 − λx)⁴ φ'')'' = p'² (1 − λx)² φ (Eq. 34, x in units of L):

complete
    polynomials of the curvature, exact to rounding; any follicle stiffness. For use.
exact
    Bessel functions and their frequency equation; the same numbers from elsewhere. For proof.
paper
    Ritz expansion in the cylinder's modes (Eq. 40), 50 of them. It converges slowly, and without
    the rigid rotation φ = x its pinned modes do not converge to the cone's. To reproduce.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.special import roots_legendre

from whiskermodel.bessel_modes import bessel_modes, bessel_shape
from whiskermodel.checks import finite_array, one_of, whole_number
from whiskermodel.paper.cylinder_modes import (
    cylinder_functions,
    cylinder_wavenumbers,
    ritz_in_cylinder_functions,
)
from whiskermodel.polynomial_modes import polynomial_modes

BASES = ("complete", "paper", "exact")
_PAPER_TERMS = 50  # cylinder modes in the paper's simulations


@dataclass(frozen=True, eq=False)
class Modes:
    """Modes of a truncated cone, lengths in units of L, normalised to ∫φ²(1 − λx)² dx = 1.

    Attributes
    ----------
    taper : λ = L/L_in
    follicle_stiffness : κ = k_θ L/(E I0); inf for the fixed end, 0 for the pinned one
    basis : "complete", "paper" or "exact"
    p_prime : (n_modes,) dimensionless angular frequencies; 0 for a rigid rotation
    """

    taper: float
    follicle_stiffness: float
    basis: str
    p_prime: np.ndarray
    _evaluate: object
    _signs: np.ndarray

    @property
    def n_modes(self):
        """How many there are."""
        return len(self.p_prime)

    def shape(self, x, derivative=0):
        """φ_k or one of its first three derivatives by x/L at `x` in 0–1, (n_modes, *x.shape).

        The tip's displacement is positive.
        """
        x = finite_array("x", x)
        if ((x < 0) | (x > 1)).any():
            raise ValueError(f"x must lie in 0–1 (units of L), got {x.min()!r} to {x.max()!r}")
        if derivative not in (0, 1, 2, 3):
            raise ValueError(f"derivative must be 0, 1, 2 or 3, got {derivative!r}")
        signs = self._signs.reshape(-1, *[1] * x.ndim)
        return signs * self._evaluate(x, derivative)

    def at_base(self, derivative):
        """The derivative's values at the base, (n_modes,)."""
        return self._at_base[derivative].copy()

    @cached_property
    def _at_base(self):
        return [self.shape(np.zeros(()), derivative) for derivative in range(4)]

    def angular_frequency(self, whisker):
        """Undamped p_k = p'_k/L² √(E I0/ρ0) [rad/s] of a whisker of this taper (Eq. 39)."""
        stiffness = whisker.base_flexural_rigidity / whisker.base_linear_density
        return self.p_prime * np.sqrt(stiffness) / whisker.length**2


@dataclass(frozen=True, eq=False)
class SupportedModes(Modes):
    """Modes of a whisker that is also held at one point, φ(support) = 0."""

    def third_beside(self, x, side):
        """φ_k's third derivative just before ("left") or after ("right") x, (n_modes,)."""
        return self._signs * self._evaluate(np.asarray(x), 3, side=side)


def follicle_stiffness(boundary, whisker=None):
    """κ = k_θ L/(E I0) of a boundary: "fixed", "pinned", or a torsional stiffness k_θ.

    k_θ is in N m/rad where a `whisker` is given, else in units of E I0/L.
    """
    words = {"fixed": np.inf, "pinned": 0.0}
    if isinstance(boundary, str):
        if boundary not in words:
            raise ValueError(
                f"boundary must be 'fixed', 'pinned' or a torsional stiffness >= 0, "
                f"got {boundary!r}"
            )
        return words[boundary]
    value = float(boundary)
    if not value >= 0:
        raise ValueError(f"boundary as a torsional stiffness must be >= 0, got {boundary!r}")
    return value if whisker is None else value * whisker.length / whisker.base_flexural_rigidity


def modes(taper, boundary="fixed", n_modes=10, basis="complete", n_terms=None):
    """First `n_modes` modes of a cone of this taper, slowest first.

    Parameters
    ----------
    taper : float
        λ = L/L_in, from 0 (cylinder) to 1 (full cone).
    boundary : "fixed", "pinned" or float
        The base's end; a number is the follicle's torsional stiffness in units of E I0/L.
        The pinned end's first mode is its rigid rotation, p' = 0 ("paper" leaves it out).
    basis : "complete", "paper" or "exact"
    n_terms : int, optional
        Basis functions: cylinder modes for "paper" (50), polynomial terms for "complete".

    Returns
    -------
    Modes

    Raises
    ------
    ValueError
        Names the argument, its value and the allowed range.

    Examples
    --------
    >>> (modes(1.0, "fixed", 3).p_prime / 2).round(6)
    array([ 4.359629, 10.572831, 19.226886])
    """
    if not 0 <= taper <= 1:
        raise ValueError(f"taper must be in 0–1, got {taper!r}")
    n_modes = whole_number("n_modes", n_modes, 1)
    one_of("basis", basis, BASES)
    kappa = follicle_stiffness(boundary)
    p, evaluate = _SOLVERS[basis](float(taper), kappa, n_modes, n_terms)
    tip = evaluate(np.ones(()), 0)
    return Modes(float(taper), kappa, basis, p, evaluate, np.where(tip < 0, -1.0, 1.0))


def supported_modes(taper, support, boundary="fixed", n_modes=10):
    """Modes of the cone held at `support` (0–1, units of L) as well, as SupportedModes.

    Other parameters are those of `modes`, with the complete basis.
    """
    free = modes(taper, boundary, n_modes)  # checks the arguments
    if not 0 < support < 1:
        raise ValueError(f"support must lie in 0–1 (units of L), got {support!r}")
    p, phi = polynomial_modes(
        free.taper, free.follicle_stiffness, free.n_modes, _enough_terms(n_modes), float(support)
    )
    signs = np.where(phi(np.ones(())) < 0, -1.0, 1.0)
    return SupportedModes(free.taper, free.follicle_stiffness, "complete", p, phi, signs)


def _enough_terms(n_modes):
    """Two terms a mode and a margin: rounding error in every mode wanted."""
    return max(40, 2 * n_modes + 30)


def _complete(taper, kappa, n_modes, n_terms):
    n_terms = _enough_terms(n_modes) if n_terms is None else n_terms
    n_terms = whole_number("n_terms", n_terms, n_modes + 3)
    return polynomial_modes(taper, kappa, n_modes, n_terms)


def _paper(taper, kappa, n_modes, n_terms):
    if kappa not in (0.0, np.inf):
        raise ValueError(
            f"basis 'paper' has only the boundary 'fixed' or 'pinned', got stiffness {kappa!r}"
        )
    boundary = "fixed" if kappa else "pinned"
    n_terms = max(_PAPER_TERMS, n_modes) if n_terms is None else n_terms
    n_terms = whole_number("n_terms", n_terms, n_modes)
    p, coefficients = ritz_in_cylinder_functions(taper, boundary, n_modes, n_terms)

    def evaluate(x, derivative):
        y = cylinder_functions(boundary, n_terms, x.ravel(), derivative)
        return (coefficients.T @ y).reshape(-1, *x.shape)

    return p, evaluate


def _exact(taper, kappa, n_modes, n_terms):
    if n_terms is not None:
        raise ValueError(f"n_terms has no meaning for basis 'exact', got {n_terms!r}")
    if taper == 0:
        return _exact_cylinder(kappa, n_modes)
    p, amplitudes = bessel_modes(taper, kappa, n_modes)
    nodes, weights = roots_legendre(200 + 8 * n_modes)
    x, weights = (nodes + 1) / 2, weights / 2
    phi = np.array([bessel_shape(taper, *mode, x) for mode in zip(p, amplitudes, strict=True)])
    norm = np.sqrt((phi**2 * weights * (1 - taper * x) ** 2).sum(axis=1))

    def evaluate(x, derivative):
        shapes = [
            bessel_shape(taper, *mode, x, derivative) for mode in zip(p, amplitudes, strict=True)
        ]
        return np.stack(shapes) / norm.reshape(-1, *[1] * x.ndim)

    return p, evaluate


def _exact_cylinder(kappa, n_modes):
    if kappa not in (0.0, np.inf):
        raise ValueError(
            f"basis 'exact' has no compliant follicle at taper 0, got stiffness {kappa!r}; "
            f"use basis 'complete'"
        )
    boundary, rigid = ("fixed", 0) if kappa else ("pinned", 1)
    p = np.concatenate([np.zeros(rigid), cylinder_wavenumbers(boundary, n_modes - rigid) ** 2])

    def evaluate(x, derivative):
        y = cylinder_functions(boundary, n_modes - rigid, x.ravel(), derivative)
        line = np.sqrt(3) * np.where(derivative == 0, x.ravel(), float(derivative == 1))
        return np.concatenate([line[None, :]] * rigid + [y]).reshape(-1, *x.shape)

    return p, evaluate


_SOLVERS = {"complete": _complete, "paper": _paper, "exact": _exact}
