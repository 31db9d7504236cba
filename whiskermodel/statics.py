"""Small-angle bending of a tapered whisker under a point force (Hires et al. 2013, Eqs 10–17).

Shapes are per newton of force at the contact c. Two frames:

chord
    the paper's: x runs along the line from the base to the contact, y(0) = y(c) = 0. The base
    turns by ỹ_s'(0) per newton: a follicle turning against a pole that stands still.
clamped
    fixed in the lab, y(0) = y'(0) = 0: the follicle stands still while the whisker is pushed.

With ξ = 1 − x/L_in the paper's Eq. 17 becomes, for x ≤ c and in the clamped frame,
ỹ_s = −[c x² (1 + 2ξ) − x³] / (6 ξ² E I0): the same function, without the differences of large
numbers that spoil Eq. 17 near the cylinder, so that L_in = ∞ (Eq. 13) needs no case of its own.
"""

import numpy as np

from whiskermodel.checks import finite_array, on_whisker, one_of

FRAMES = ("chord", "clamped")


def steady_base_angle(whisker, contact_arc_length):
    """Base angle ỹ_s'(0) in the chord frame [rad/N] (Eq. 59), of the shape of c [m]."""
    c = on_whisker(whisker, contact_arc_length)
    return c**2 / (3 * (1 - c / whisker.cone_length) * whisker.base_flexural_rigidity)


def steady_shape(whisker, contact_arc_length, arc_length, derivative=0, frame="chord"):
    """Static shape ỹ_s(x; c) per newton, or one of its first three derivatives by x.

    Parameters
    ----------
    whisker : Whisker
    contact_arc_length, arc_length : float or array
        c and x [m], broadcast against each other; 0 < c < L, 0 ≤ x ≤ L.
    derivative : 0, 1, 2 or 3
        The second is the curvature per newton; the third jumps at c (given there as inside).
    frame : "chord" or "clamped"

    Returns
    -------
    array [m/N, 1/N, 1/(m N) or 1/(m² N)]

    Raises
    ------
    ValueError
        Where c or x is off the whisker, or `derivative` or `frame` is not one of those.
    """
    one_of("frame", frame, FRAMES)
    c = on_whisker(whisker, contact_arc_length)
    x = finite_array("arc_length", arc_length)
    if ((x < 0) | (x > whisker.length)).any():
        raise ValueError(
            f"arc_length must lie from 0 to the whisker's length {whisker.length!r} m, "
            f"got {float(x.min())!r} to {float(x.max())!r} m"
        )
    c, x = np.broadcast_arrays(c, x)
    if derivative not in (0, 1, 2, 3):
        raise ValueError(f"derivative must be 0, 1, 2 or 3, got {derivative!r}")
    shape = _CLAMPED[derivative](c, x, 1 / whisker.cone_length) / whisker.base_flexural_rigidity
    if frame == "chord" and derivative < 2:
        shape = shape + steady_base_angle(whisker, c) * (x if derivative == 0 else 1.0)
    return shape


def steady_moment(contact_arc_length, arc_length):
    """Bending moment M(x) = −(c − x) per newton for x ≤ c, else 0 [m] (Eq. 11)."""
    return -np.maximum(np.asarray(contact_arc_length) - np.asarray(arc_length), 0.0)


def force_for_base_angle(whisker, contact_arc_length, base_angle):
    """Force [N] that holds the whisker at c while its base is turned by `base_angle` [rad]."""
    return finite_array("base_angle", base_angle) / steady_base_angle(whisker, contact_arc_length)


# The clamped shape times E I0; `apex` = 1/L_in, zero for a cylinder.


def _displacement(c, x, apex):
    inside = np.minimum(x, c)
    xi = 1 - apex * inside
    bent = -(c * inside**2 * (1 + 2 * xi) - inside**3) / (6 * xi**2)
    return bent + _slope(c, c, apex) * (x - inside)  # straight beyond the contact


def _slope(c, x, apex):
    x = np.minimum(x, c)
    xi = 1 - apex * x
    return -(2 * c * x * (1 + xi + xi**2) - x**2 * (2 + xi)) / (6 * xi**3)


def _curvature(c, x, apex):
    return steady_moment(c, x) / (1 - apex * np.minimum(x, c)) ** 4


def _third(c, x, apex):
    xi = 1 - apex * np.minimum(x, c)
    return np.where(x <= c, xi**-4 - 4 * apex * (c - x) / xi**5, 0.0)


_CLAMPED = (_displacement, _slope, _curvature, _third)
