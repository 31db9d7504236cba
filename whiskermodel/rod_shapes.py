"""Shapes of a rod, free and loaded; the loaded ones seen from the contact, by two parameters.

See `rod` for the equations. The place c of a contact is given by u (`to_u`); its force by the
push, the angle by which it would turn a straight whisker's base at small angles.
"""

from functools import lru_cache

import numpy as np
from numpy.polynomial import chebyshev

_NODES = 33  # Chebyshev nodes on the loaded part
_PICARD_ITERATIONS = 40


@lru_cache
def _panel(nodes):
    """Chebyshev nodes on [0, 1], their ∫₀ᶻ matrix, and the matrix to Chebyshev coefficients."""
    z = (1 - np.cos(np.pi * np.arange(nodes) / (nodes - 1))) / 2
    z = (z + 1 - z[::-1]) / 2  # symmetric to the last bit
    to_coefficients = np.linalg.inv(chebyshev.chebvander(2 * z - 1, nodes - 1))
    integrals = chebyshev.chebint(to_coefficients, lbnd=-1, scl=0.5, axis=0)
    return z, chebyshev.chebvander(2 * z - 1, nodes) @ integrals, to_coefficients


def _stretch(whisker):
    """Length [m] of the map s = a (1 − e⁻ᵘ), which grades the nodes towards a cone's apex.

    With a = cone_length every u is a place on the cone, however long Newton's steps.
    """
    return min(whisker.cone_length, 10 * whisker.length)


def to_u(whisker, s):
    """Place u of the arc length s [m] on the graded scale."""
    return -np.log1p(-s / _stretch(whisker))


def to_s(whisker, u):
    """Arc length [m] of the place u."""
    return -_stretch(whisker) * np.expm1(-u)


def _polynomial(coefficients, s):
    """Value of the ascending polynomials (frames, terms) at `s` (frames, points)."""
    value = np.zeros_like(s)
    for k in coefficients.T[::-1]:
        value = value * s + k[:, None]
    return value


def force_per_push(whisker, c):
    """Force [N] that turns a straight whisker by 1 rad at small angles: F/θ of Eq. 17's slope."""
    return 3 * whisker.base_flexural_rigidity * (1 - c / whisker.cone_length) / c**2


def contact_frame(whisker, u_c, push, side, friction, curvature):
    """Loaded shape in the frame of the contact: origin r_c, x along the tangent there.

    `u_c` and `push` (frames,) stand for contact arc length and force.
    Returns s, x, y, angle, each (frames, nodes) from base to contact, and the force (fx, fy).
    """
    z, integral, _ = _panel(_NODES)
    back = (integral - integral[-1]).T  # ∫ from the contact (z = 1) back to z, as f @ back
    s = to_s(whisker, u_c[:, None] * z)
    jacobian = u_c[:, None] * (_stretch(whisker) - s)  # ds/dz
    rest = _polynomial(curvature, s)
    stiffness = whisker.base_flexural_rigidity * (1 - s / whisker.cone_length) ** 4
    normal_force = push * force_per_push(whisker, s[:, -1])
    fx, fy = friction * normal_force, -side * normal_force
    angle = (jacobian * rest) @ back
    for _ in range(_PICARD_ITERATIONS):
        x, y = (jacobian * np.cos(angle)) @ back, (jacobian * np.sin(angle)) @ back
        moment = y * fx[:, None] - x * fy[:, None]  # (r_c − r) × F with r_c = 0
        new = (jacobian * (rest + moment / stiffness)) @ back
        change = np.abs(new - angle).max(initial=0.0)
        angle = new
        if not change > 1e-14:
            break
    return s, x, y, angle, (fx, fy)


def pole_from_base(whisker, u_c, push, problem):
    """Pole's centre in the frame of the base, (2, frames), for contact u_c and force `push`."""
    _, _, pole_radius, side, friction, curvature = problem
    s, x, y, angle, _ = contact_frame(whisker, u_c, push, side, friction, curvature)
    surface = whisker.base_radius * (1 - s[:, -1] / whisker.cone_length)
    dx, dy = -x[:, 0], side * (pole_radius + surface) - y[:, 0]
    cos, sin = np.cos(angle[:, 0]), np.sin(angle[:, 0])
    return np.stack([cos * dx + sin * dy, cos * dy - sin * dx])


def interpolate(values, z):
    """Value at `z` (rows, points) of the functions known at the panel's nodes (rows, nodes)."""
    _, _, to_coefficients = _panel(values.shape[1])
    coefficients = (values @ to_coefficients.T).T[:, :, None]
    return chebyshev.chebval(2 * z - 1, coefficients, tensor=False)


def stress_free(whisker, start, x, y, angle, curvature, s, end=None):
    """Shape beyond arc length `start` (frames,), where x, y, angle are known, at s ≥ start."""
    end = whisker.length if end is None else end
    z, integral, _ = _panel(_NODES)
    span = np.maximum(end - start, 1e-9 * end)[:, None]
    nodes = start[:, None] + span * z
    antiderivative = curvature / np.arange(1, curvature.shape[1] + 1)

    def angle_at(s):
        turned = _polynomial(antiderivative, s) * s
        return (
            angle[:, None]
            + turned
            - (_polynomial(antiderivative, start[:, None]) * start[:, None])
        )

    along = angle_at(nodes)
    px, py = span * np.cos(along) @ integral.T, span * np.sin(along) @ integral.T
    at = np.clip((s - start[:, None]) / span, 0.0, 1.0)
    return x[:, None] + interpolate(px, at), y[:, None] + interpolate(py, at), angle_at(s)
