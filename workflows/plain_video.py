"""Pictures and forces of a whisker against a pole that share no line with the project's own.

The whisker is an elastic cone, clamped at its follicle, without friction at the pole. From the
touching point on, where there is no moment, SciPy integrates the rod back to the follicle (large
angles); place, direction and force there are those that end where the follicle is. Pictures are
the areas between the whisker's two edges, blurred by OpenCV.
"""

from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np
from scipy.integrate import odeint
from scipy.optimize import fsolve

LENGTH, CONE, BASE_RADIUS, YOUNG = 18e-3, 18.947e-3, 37e-6, 3e9  # m, m, m, Pa
POLE_RADIUS = 0.25e-3  # m
ARC = np.linspace(0, LENGTH, 361)  # m
SUPERSAMPLED = 4
UNITS = np.array([1.0, 1e-3, 1e-6])  # of direction, arc length, force, while they are solved for


class Touch(NamedTuple):
    """Direction [rad] and arc length [m] at the pole, force [N], moment at the follicle [N m]."""

    direction: float
    arc: float
    force: float
    moment: float


@dataclass(frozen=True)
class Whisker:
    """Of this curvature [1/m, not 0] without a force, its follicle at (0, 0).

    The pole (x, y) [m] is on its right, where it touches at `arc` [m] when the angle of its base
    is `touching` [rad, from +x to +y]; at smaller angles it is bent.
    """

    curvature: float
    touching: float
    arc: float

    @property
    def pole(self):
        """Centre (2,) [m]."""
        point = self._circle(self.touching, self.arc)
        return point - _off(self.arc) * _left(self.touching + self.curvature * self.arc)

    def stiffness(self, s):
        """E I(s) [N m²] at arc lengths s [m]: a cone's, of one Young's modulus."""
        return YOUNG * np.pi / 4 * radius(s) ** 4

    def free(self, angle):
        """Points (arc lengths, 2) [m] without a force."""
        return self._circle(angle, ARC)

    def sweep(self, angles):
        """Points (frames, arc lengths, 2) [m], and a `Touch` per frame, None without one.

        Raises
        ------
        RuntimeError
            If no equilibrium is found: the whisker would slip off.
        """
        points, touches, last = [], [], None
        for angle in angles:
            if angle >= self.touching:
                points.append(self.free(angle))
                last = None
            else:
                start = last or Touch(angle + self.curvature * self.arc, self.arc, 1e-8, 0.0)
                line, last = self._bent(angle, start)
                points.append(line)
            touches.append(last)
        return np.array(points), touches

    def _circle(self, direction, s):
        """Points (…, 2) [m] at arc lengths s on a free whisker that leaves (0, 0)."""
        turned = direction + self.curvature * s
        x, y = np.sin(turned) - np.sin(direction), np.cos(direction) - np.cos(turned)
        return np.stack([x, y], axis=-1) / self.curvature

    def _bent(self, angle, start):
        def missed(values):
            x, y, turned = self._to_follicle(*values * UNITS, [0.0])[:, 0]
            return 1e3 * x, 1e3 * y, turned - angle

        found, _, status, message = fsolve(missed, start[:3] / UNITS, full_output=True)
        direction, arc, force = found * UNITS
        if status != 1 or not 0 < arc < 0.97 * LENGTH:
            raise RuntimeError(f"no equilibrium at {angle:.3f} rad: {message}")
        near = self._to_follicle(direction, arc, force, ARC[ARC < arc][::-1])[:2, ::-1].T
        contact, push = self._contact(direction, arc)
        far = contact + self._circle(direction, ARC[ARC >= arc] - arc)
        moment = force * (contact[0] * push[1] - contact[1] * push[0])
        return np.vstack([near, far]), Touch(direction, arc, force, moment)

    def _contact(self, direction, arc):
        """Point (2,) of the axis that touches, and where to it is pushed (2,)."""
        push = _left(direction)
        return self.pole + _off(arc) * push, push

    def _to_follicle(self, direction, arc, force, at):
        """x, y, direction (3, n) at arc lengths `at`, integrated from the pole on."""
        contact, push = self._contact(direction, arc)

        def slope(s, state):
            x, y, turned = state
            moment = force * ((contact[0] - x) * push[1] - (contact[1] - y) * push[0])
            bent = self.curvature + moment / self.stiffness(s)
            return np.cos(turned), np.sin(turned), bent

        start = [*contact, direction]
        places = np.concatenate([[arc], at])
        return odeint(slope, start, places, tfirst=True, rtol=1e-10, atol=1e-13)[1:].T


def radius(s):
    """Of the whisker at arc length s [m]."""
    return BASE_RADIUS * (1 - s / CONE)


def _off(arc):
    return POLE_RADIUS + radius(arc)


def _left(direction):
    return np.array([-np.sin(direction), np.cos(direction)])


def pictures(points_px, pole_px, pixels_per_mm, light, dark, noise, blur, seed=0):
    """Yield frames uint8 (height, width).

    Parameters
    ----------
    points_px : (frames, arc lengths, 2) of x, y
    pole_px : (2,), its centre; it lets nothing pass
    light : (height, width) without whisker and pole [grey levels]
    dark : share of the light that the whisker takes
    noise, blur : SDs [grey levels, px]
    """
    rng = np.random.default_rng(seed)
    rows, columns = np.indices(light.shape)
    width = 2e3 * pixels_per_mm * radius(ARC)
    off = POLE_RADIUS * 1e3 * pixels_per_mm - np.hypot(columns - pole_px[0], rows - pole_px[1])
    passed = 1 - np.clip(off + 0.5, 0, 1)
    for points in points_px:
        image = light * (1 - dark * _covered(points, width, light.shape)) * passed
        image = cv2.GaussianBlur(image, (0, 0), blur) + rng.normal(8, noise, light.shape)
        yield np.clip(np.rint(image), 0, 255).astype(np.uint8)


def _covered(points, width, shape):
    """Share (height, width) of every pixel that a strip along the points covers.

    It is exact down the columns, of which each pixel has `SUPERSAMPLED`. The points go from left
    to right.
    """
    along = np.gradient(points, axis=0)
    across = np.column_stack([-along[:, 1], along[:, 0]]) / np.hypot(*along.T)[:, None]
    half = 0.5 * width[:, None] * across
    columns = (np.arange(SUPERSAMPLED * shape[1]) + 0.5) / SUPERSAMPLED - 0.5
    edges = ((points + sign * half).T for sign in (-1, 1))
    low, high = (np.interp(columns, *edge, left=np.nan, right=np.nan) for edge in edges)
    ends = np.nanmin(low), np.nanmax(high) + 2  # no row beyond them is covered
    first, last = (int(np.clip(end, 0, shape[0])) for end in ends)
    rows = np.arange(first, last)[:, None]
    covered = np.minimum(high, rows + 0.5) - np.maximum(low, rows - 0.5)
    covered = np.fmax(covered, 0)  # also where the whisker is not: NaN
    share = np.zeros(shape)
    share[first:last] = covered.reshape(last - first, shape[1], SUPERSAMPLED).mean(axis=2)
    return share
