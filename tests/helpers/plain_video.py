"""Pictures and forces of a whisker against a pole that share no line with the project's own.

The whisker is an elastic cone, clamped at its follicle, without friction at the pole. From the
touching point on, where there is no moment, SciPy integrates the rod back to the follicle (large
angles); place, direction and force there are those that end where the follicle is. Pictures are
polygons, filled by OpenCV in fourfold resolution.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, fsolve

LENGTH, CONE, BASE_RADIUS, YOUNG = 18e-3, 18.947e-3, 37e-6, 3e9  # m, m, m, Pa
CURVATURE = 8.0  # 1/m, of the shape without a force
POLE_RADIUS = 0.25e-3  # m
POINTS = 361
SUPERSAMPLED = 4


def radius(s):
    return BASE_RADIUS * (1 - s / CONE)


def stiffness(s):
    return YOUNG * np.pi / 4 * radius(s) ** 4


@dataclass(frozen=True)
class Touch:
    """Force [N] of the pole on the whisker, its moment about the follicle [N m], where [m]."""

    force: float
    moment: float
    arc: float


@dataclass(frozen=True)
class Whisker:
    """Leaves its follicle at (0, 0) at `angle` [rad] from +x; and a pole (x, y) [m]."""

    angle: float
    pole: tuple = (np.inf, np.inf)

    def free(self):
        """Points (POINTS, 2) [m] without a force: an arc of a circle."""
        s = np.linspace(0, LENGTH, POINTS)
        turned = self.angle + CURVATURE * s
        x = (np.sin(turned) - np.sin(self.angle)) / CURVATURE
        return np.column_stack([x, (np.cos(self.angle) - np.cos(turned)) / CURVATURE])

    def bent(self, guess):
        """Points (POINTS, 2) [m], `Touch` and the next guess; the pole is on the whisker's right.

        guess : direction [rad], arc length [m] and force [N] at the pole
        """
        scale = np.array([1.0, 1e-3, 1e-6])

        def missed(values):
            x, y, turned = self._from_pole(*values * scale).y[:3, -1]
            return np.array([1e3 * x, 1e3 * y, turned - self.angle])

        found, _, status, message = fsolve(missed, np.asarray(guess) / scale, full_output=True)
        if status != 1:
            raise RuntimeError(message)
        direction, arc, force = found * scale
        s = np.linspace(0, LENGTH, POINTS)
        near = s[s < arc]
        points = self._from_pole(direction, arc, force, near[::-1]).y[:2].T[::-1]
        contact, pushed = self._contact(direction, arc)
        turned = direction + CURVATURE * (s[s >= arc] - arc)
        rest = np.column_stack([
            (np.sin(turned) - np.sin(direction)) / CURVATURE,
            (np.cos(direction) - np.cos(turned)) / CURVATURE,
        ])  # fmt: skip
        moment = force * (contact[0] * pushed[1] - contact[1] * pushed[0])
        return np.vstack([points, contact + rest]), Touch(force, moment, arc), found * scale

    def _contact(self, direction, arc):
        """Point of the axis that touches (2,), and the direction in which it is pushed (2,)."""
        pushed = np.array([-np.sin(direction), np.cos(direction)])
        return np.asarray(self.pole) + (POLE_RADIUS + radius(arc)) * pushed, pushed

    def _from_pole(self, direction, arc, force, at=(0.0,)):
        """x, y, direction at arc lengths `at`, integrated from the pole towards the follicle."""
        contact, (px, py) = self._contact(direction, arc)

        def slope(s, state):
            x, y, turned = state
            moment = force * ((contact[0] - x) * py - (contact[1] - y) * px)
            return np.cos(turned), np.sin(turned), CURVATURE + moment / stiffness(s)

        start = [*contact, direction]
        return solve_ivp(slope, (arc, 0.0), start, t_eval=at, rtol=1e-9, atol=1e-12)


def nearest(points, pole):
    """Arc length [m] of the point next to the pole, and how far it is off the pole's edge [m]."""
    away = np.hypot(*(points - pole).T)
    k = int(away.argmin())
    s = k * LENGTH / (POINTS - 1)
    return s, away[k] - POLE_RADIUS - radius(s)


def pole_beside(angle, arc):
    """Centre (2,) [m] of a pole that just touches a free whisker, at `arc` on its right."""
    points = Whisker(angle).free()
    k = round(arc / LENGTH * (POINTS - 1))
    turned = angle + CURVATURE * arc
    off = POLE_RADIUS + radius(arc)
    return points[k] - off * np.array([-np.sin(turned), np.cos(turned)])


def shapes(angles, pole, touching_angle):
    """Points (frames, POINTS, 2) [m] and `Touch`es, None without one, of a whisker that turns.

    touching_angle : below which the free whisker would be in the pole
    """
    points, touches, guess = [], [], None
    for angle in angles:
        free = Whisker(angle).free()
        touch = None
        if angle < touching_angle:
            if guess is None:
                s, _ = nearest(free, pole)
                guess = angle + CURVATURE * s, s, 1e-8
            free, touch, guess = Whisker(angle, tuple(pole)).bent(guess)
        else:
            guess = None
        points.append(free)
        touches.append(touch)
    return np.array(points), touches


def touching_angle(pole, low, high):
    """Angle [rad] between `low` and `high` at which the free whisker just touches."""
    return brentq(lambda angle: _side(angle, pole), low, high, xtol=1e-12)


def _side(angle, pole):
    """Distance [m] of the free whisker's axis from the pole's edge, to the pole's left."""
    centre = np.array([-np.sin(angle), np.cos(angle)]) / CURVATURE  # of the arc's circle
    away = pole - centre
    s = (np.arctan2(away[1], away[0]) + np.pi / 2 - angle) / CURVATURE
    return np.hypot(*away) - 1 / CURVATURE - POLE_RADIUS - radius(s)


def pictures(points_px, pole_px, pixels_per_mm, light, dark=0.8, noise=2.0, blur=0.9):
    """Frames uint8 (frames, height, width).

    points_px : (frames, POINTS, 2); light : (height, width) without whisker and pole
    """
    rng = np.random.default_rng(5)
    rows, columns = np.indices(light.shape)
    width = 2e3 * pixels_per_mm * radius(np.linspace(0, LENGTH, POINTS))
    off = POLE_RADIUS * 1e3 * pixels_per_mm - np.hypot(columns - pole_px[0], rows - pole_px[1])
    pole = np.clip(off + 0.5, 0, 1)
    for points in points_px:
        image = light * (1 - dark * _covered(points, width, light.shape))
        image = image * (1 - pole) + 12 * pole
        image = cv2.GaussianBlur(image, (0, 0), blur) + rng.normal(0, noise, light.shape)
        yield np.clip(np.rint(image), 0, 255).astype(np.uint8)


def _covered(points, width, shape):
    """Share of every pixel that a strip along the points covers."""
    tangent = np.gradient(points, axis=0)
    normal = np.column_stack([-tangent[:, 1], tangent[:, 0]]) / np.hypot(*tangent.T)[:, None]
    half = 0.5 * width[:, None] * normal
    outline = SUPERSAMPLED * (np.vstack([points + half, (points - half)[::-1]]) + 0.5) - 0.5
    fine = np.zeros([SUPERSAMPLED * n for n in shape], np.uint8)
    cv2.fillPoly(fine, [np.rint(16 * outline).astype(np.int32)], 255, cv2.LINE_AA, 4)
    return cv2.resize(fine, shape[::-1], interpolation=cv2.INTER_AREA) / 255.0
