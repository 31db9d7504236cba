"""How exactly a whisker's place and curvature can be known from one noisy frame at best.

Cramér–Rao bounds, derived in docs/accuracy_limits.md. A picture holds, per pixel of length along
the whisker, the Fisher information j(s) about the whisker's offset across its line; a linear model
of the shape, v(s) = Σ c_k f_k(s), then has the information matrix M = Σ j f fᵀ, and no unbiased
estimator of the curvature v''(s₀) has a variance below f''(s₀)ᵀ M⁻¹ f''(s₀).
"""

import numpy as np
from scipy.interpolate import BSpline

from synthetic.scene import Camera
from synthetic.strips import step_table

ROUNDING_VARIANCE = 1 / 12  # of grey levels stored as whole numbers
_STEP_PX = 0.02


def line_profile(radius_px, blur_px, direction=0.0):
    """Light share taken across a straight strip, and its derivative, by blur and square pixels.

    Parameters
    ----------
    radius_px : half-width of the strip [px]
    blur_px : SD of the optics' Gaussian [px]
    direction : the strip's direction on the screen [rad]

    Returns
    -------
    distance [px], share and d share/d distance [1/px], each (points,), evenly spaced
    """
    if not radius_px > 0:
        raise ValueError(f"radius_px must be > 0 px, got {radius_px!r}")
    _, table, reach, per_px = step_table(float(blur_px))
    folded = abs((direction + np.pi / 4) % (np.pi / 2) - np.pi / 4)  # 0 along an axis … 45°
    place = folded / (np.pi / 4) * (len(table) - 1)
    row = min(int(place), len(table) - 2)
    step = table[row] + (place - row) * (table[row + 1] - table[row].astype(float))
    nodes = np.arange(table.shape[1]) / per_px - reach
    distance = np.arange(-reach - radius_px, reach + radius_px, _STEP_PX)
    edges = (np.interp(distance + side, nodes, step, 0, 1) for side in (radius_px, -radius_px))
    share = np.subtract(*edges)
    return distance, share, np.gradient(share, _STEP_PX)


def offset_information(radius_px, light, camera: Camera, opacity=1.0, direction=0.0) -> float:
    """Fisher information about a strip's offset, per pixel of its length [1/px³].

    `light` is the backlight's grey level above black. Absorbance, width and background are even
    functions across the line, the offset's effect is odd: not knowing them costs nothing.
    """
    distance, share, slope = line_profile(radius_px, camera.blur_px, direction)
    left = light * (1 - opacity * share)
    variance = camera.read_noise**2 + camera.noise_gain * left + ROUNDING_VARIANCE
    effect = light * opacity * slope
    return float(np.trapezoid(effect**2 / variance, distance))


# Shape models --------------------------------------------------------------------------------


def polynomial_bound(arc_px, information, at_px, degree) -> float:
    """Least SD of the curvature [1/px] at `at_px`, for v(s) a polynomial of the given degree.

    Parameters
    ----------
    arc_px : (points,) evenly spaced arc lengths of the window [px]
    information : (points,) or float, information per pixel of length [1/px³]
    at_px : arc length at which curvature is wanted
    degree : 2 or more
    """
    if degree < 2:
        raise ValueError(f"degree must be 2 or more for a curvature, got {degree!r}")
    arc_px = np.asarray(arc_px, float)
    scale = np.ptp(arc_px) / 2
    u = (arc_px - at_px) / scale
    wanted = np.zeros(degree + 1)
    wanted[2] = 2.0
    return (
        _bound(np.vander(u, degree + 1, increasing=True), arc_px, information, wanted) / scale**2
    )


def spline_bound(arc_px, information, at_px, knot_px) -> float:
    """Least SD of the curvature [1/px] at `at_px` for any shape with knots `knot_px` apart.

    The shapes are all whose curvature is a parabola between one knot and the next, joined with
    a continuous slope: whatever a whisker does over lengths of the knots' spacing and more. The
    knots are laid so that `at_px` falls in the middle between two.
    """
    arc_px = np.asarray(arc_px, float)
    first, last = arc_px[0], arc_px[-1]
    before = np.arange(at_px - knot_px / 2, first, -knot_px)[::-1]
    inner = np.concatenate([before, np.arange(at_px + knot_px / 2, last, knot_px)])
    knots = np.concatenate([[first] * 5, inner[(inner > first) & (inner < last)], [last] * 5])
    basis = BSpline.design_matrix(arc_px, knots, 4).toarray()
    count = basis.shape[1]
    wanted = BSpline(knots, np.eye(count), 4)(at_px, 2)
    return _bound(basis, arc_px, information, wanted)


def _bound(basis, arc_px, information, wanted) -> float:
    """√(wᵀ M⁻¹ w) by least squares: M = AᵀA with the rows of A weighted by √(j ds)."""
    step = np.ptp(arc_px) / (len(arc_px) - 1)
    weight = np.sqrt(np.broadcast_to(information, arc_px.shape) * step)
    _, triangle = np.linalg.qr(basis * weight[:, None])
    return float(np.linalg.norm(np.linalg.solve(triangle.T, wanted)))


# A whisker in a picture ----------------------------------------------------------------------


def whisker_information(hair, light, camera: Camera, arc_length, direction=0.0) -> np.ndarray:
    """Information per pixel of length [1/px³] at `arc_length` [m] of a scene's whisker.

    `light` is the backlight above black [grey levels], a float or one per arc length.
    """
    arc_length = np.atleast_1d(np.asarray(arc_length, float))
    light = np.broadcast_to(light, arc_length.shape)
    radius = hair.whisker.radius(arc_length) * camera.pixels_per_m
    return np.array(
        [
            offset_information(max(r, 1e-3), b, camera, hair.opacity, direction)
            for r, b in zip(radius, light, strict=True)
        ]
    )


def curvature_bounds(
    hair, light, camera: Camera, at=5.5e-3, first=1.4e-3, last=None, direction=0.0
) -> dict[str, float]:
    """Least SDs of the curvature [1/m] at arc length `at` [m] of a whisker in one frame.

    Parameters
    ----------
    hair : synthetic.scene.Hair; light : backlight above black [grey levels]
    first, last : the part that models may use [m]: from where the whisker leaves the fur to
        its tip (None), or to a pole that it touches, where its bending has a kink

    Returns
    -------
    dict: "quadratic ±2 mm", "quartic ±3 mm", "knots 3 mm", "knots 6 mm", "polynomial 5" … "8"
    (over the whole visible length)
    """
    scale = camera.pixels_per_m
    last = hair.whisker.length if last is None else last
    arc = np.arange(first * scale, last * scale - 1, 1.0)
    information = whisker_information(hair, light, camera, arc / scale, direction)

    def within(half):
        keep = np.abs(arc - at * scale) <= half * scale
        return arc[keep], information[keep], at * scale

    whole = arc, information, at * scale
    bounds = {
        "quadratic ±2 mm": polynomial_bound(*within(2e-3), 2),
        "quartic ±3 mm": polynomial_bound(*within(3e-3), 4),
        "knots 6 mm": spline_bound(*whole, 6e-3 * scale),
        "knots 3 mm": spline_bound(*whole, 3e-3 * scale),
    }
    for degree in (5, 6, 8):
        bounds[f"polynomial {degree}"] = polynomial_bound(*whole, degree)
    return {name: sd * scale for name, sd in bounds.items()}
