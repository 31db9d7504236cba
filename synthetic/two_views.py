"""A whisker in space, seen from above and, by a second camera or mirror, from the side.

The whisker bends as in `motion` in a plane of its own that runs up or down from the follicle
(elevation) and curves out of the horizontal on its way (droop); the pole stands upright, so that
its force lies in the horizontal. Unrolled, that surface is the plane in which the rod is solved.
The second view looks along the horizon, some 20° off the axis of the animal (Fig. 4 of the paper);
there the pole is a bar from top to bottom.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.special import ndtr

from synthetic.motion import Motion, smooth_noise
from synthetic.render import Renderer
from synthetic.scene import Camera, Face, Scene
from synthetic.staging import NOISE, base_path, c2_scene, driven_motion, scene_touches, table_of
from synthetic.strips import Strip
from synthetic.touches import drive_touches
from whiskermodel.rod import contact_shape

BAR_SHARE = 0.985  # of the light that the pole takes in the second view
_STEP_PX = 1.4  # between the nodes that are drawn
_FINE = 400  # arc lengths at which a whisker is worked out in space


@dataclass(frozen=True)
class SecondView:
    """The camera that looks along the horizon.

    Parameters
    ----------
    camera : Camera
    azimuth : of its horizontal axis in the first view, counter-clockwise from x [rad]
    roll : of its picture [rad], counter-clockwise
    origin_px : where the first view's origin, at the height 0, lies in its picture
    mirrored : the whisker points to the left
    """

    camera: Camera
    azimuth: float = np.deg2rad(20.0)
    roll: float = np.deg2rad(2.0)
    origin_px: tuple[float, float] = (10.0, 150.0)
    mirrored: bool = False

    def project(self, x, y, z):
        """Pixel coordinates (x right, y down) of points in space [m]."""
        along = x * np.cos(self.azimuth) + y * np.sin(self.azimuth)
        along = -along if self.mirrored else along
        scale = self.camera.pixels_per_m
        c, s = np.cos(self.roll), np.sin(self.roll)
        right, up = along * c - z * s, along * s + z * c
        return self.origin_px[0] + right * scale, self.origin_px[1] - up * scale


@dataclass(frozen=True)
class Tilt:
    """How the surface of a whisker's motion lies in space, in each frame.

    Attributes
    ----------
    x, y : (frames,) follicle [m], at the height 0
    azimuth : (frames,) of the surface, from follicle to pole [rad]
    elevation : (frames,) at the follicle [rad]
    droop : change of elevation along the whisker [rad/m]
    """

    x: np.ndarray
    y: np.ndarray
    azimuth: np.ndarray
    elevation: np.ndarray
    droop: float

    def unrolled(self, along):
        """Length on the surface up to a horizontal distance (frames,) [m]."""
        sine = self.droop * along + np.sin(self.elevation)
        return (np.arcsin(sine) - self.elevation) / self.droop

    def in_space(self, frames, x, y, base_x, base_y):
        """x, y, z [m] of points (frames, points) that lie at x, y on the unrolled surface."""
        e, a = self.elevation[frames][:, None], self.azimuth[frames][:, None]
        dx, dy = x - base_x[:, None], y - base_y[:, None]
        along, aside = dx * np.cos(a) + dy * np.sin(a), dy * np.cos(a) - dx * np.sin(a)
        end = e + self.droop * along
        ahead, z = (np.sin(end) - np.sin(e)) / self.droop, (np.cos(e) - np.cos(end)) / self.droop
        px = self.x[frames][:, None] + ahead * np.cos(a) - aside * np.sin(a)
        return px, self.y[frames][:, None] + ahead * np.sin(a) + aside * np.cos(a), z


class WhiskerInSpace:
    """One whisker's motion in space.

    Parameters
    ----------
    motion : synthetic.motion.Motion on the unrolled surface, with the pole at rest
    tilt : Tilt
    second : SecondView
    """

    def __init__(self, motion: Motion, tilt: Tilt, second: SecondView):
        self.motion, self.tilt, self.second = motion, tilt, second
        self.contact = motion.hairs[0].contact
        self.whisker = motion.scene.hairs[0].whisker
        self.arc_length = np.linspace(0, self.whisker.length, _FINE)
        self.places = self._at(self.arc_length)

    def __len__(self):
        return len(self.motion)

    def _at(self, s):
        """x, y, z [m], (frames, points), at arc lengths `s` (points,)."""
        x, y, _ = contact_shape(self.whisker, self.contact, s)
        rows = np.arange(len(self.motion))
        return self.tilt.in_space(rows, x, y, self.contact.base_x, self.contact.base_y)

    def contact_places(self):
        """Rows x, y, z of the contact, horizontal and true path to it [m]; NaN where free."""
        out = np.full((5, len(self)), np.nan)
        for row in np.flatnonzero(self.contact.touching):
            s = self.contact.contact_arc_length[row]
            place = np.stack([part[row] for part in self.places])
            there = [np.interp(s, self.arc_length, part) for part in place]
            flat = np.hypot(*np.diff(place[:2], axis=1))
            path = np.interp(s, self.arc_length, np.concatenate([[0], np.cumsum(flat)]))
            out[:, row] = *there, path, s
        return out


class View:
    """A whisker in space as `Renderer` draws it, in one of the two views.

    Attributes are those of `Motion` that drawing and truth tables use.
    """

    def __init__(self, space: WhiskerInSpace, scene: Scene, second: bool):
        self.scene, self.hairs = scene, space.motion.hairs
        self.fur_phase, self._space = space.motion.fur_phase, space
        project = space.second.project if second else lambda x, y, z: scene.to_pixels(x, y)
        self._x, self._y = project(*space.places)
        away = np.full(len(space), np.nan)
        self.pole_x = away if second else space.motion.pole_x
        self.pole_y = away if second else space.motion.pole_y
        self.pole_is_still = True

    def __len__(self):
        return len(self._space)

    def instants(self, frame: int) -> int:
        """Instants of the exposure that a frame's light is the mean of."""
        return 1

    def centrelines(self, hair: int, frames=None):
        """True centrelines [px], follicle → tip: x, y (frames, points), even in arc length."""
        return (self._x, self._y) if frames is None else (self._x[frames], self._y[frames])

    def strip(self, hair: int, frame: int, instant: int = 0) -> Strip:
        """Nodes of the whisker's picture."""
        x, y = self._x[frame], self._y[frame]
        arc = np.concatenate([[0], np.cumsum(np.hypot(np.diff(x), np.diff(y)))])
        at = np.linspace(0, arc[-1], int(np.ceil(arc[-1] / _STEP_PX)) + 1)
        course = CubicSpline(arc, np.column_stack([x, -y]))
        (px, py), (dx, dy), (ddx, ddy) = (course(at, k).T for k in range(3))
        s = np.interp(at, arc, self._space.arc_length)
        radius = self._space.whisker.radius(s) * self.scene.camera.pixels_per_m
        bend = (dx * ddy - dy * ddx) / np.hypot(dx, dy) ** 3
        return Strip(px, -py, np.arctan2(dy, dx), bend, radius, np.zeros(len(at)))


class SecondRenderer(Renderer):
    """Draws the second view: the whisker, and the pole as a bar."""

    def __init__(self, view: View, pole, second: SecondView, seed: int):
        super().__init__(view.scene, view, seed)
        x, y = second.project(np.full(2, pole.x), np.full(2, pole.y), np.array([0, 1e-3]))
        row, column = np.mgrid[: view.scene.camera.height, : view.scene.camera.width]
        across = np.hypot(x[1] - x[0], y[1] - y[0])
        off = ((column - x[0]) * (y[1] - y[0]) - (row - y[0]) * (x[1] - x[0])) / across
        edge = (pole.radius * second.camera.pixels_per_m - np.abs(off)) / second.camera.blur_px
        bar = 1 - BAR_SHARE * ndtr(edge)
        self._open = self._open * bar.astype(np.float32)
        self._still_pole = self._open, self._open


def whisker_in_space(setting, second: SecondView | None = None) -> WhiskerInSpace:
    """Touches drawn at random of a whisker with an elevation of its own that drifts and droops."""
    rng, side = setting.rng, setting.side
    camera = replace(Camera(exposure_s=0.0).with_noise_sd(NOISE), height=360)
    scene = c2_scene(setting, camera=camera)
    hair, n, rate = scene.hairs[0], setting.frames, camera.frames_per_second
    x, y = base_path(scene, hair, n, rng)
    elevation = np.deg2rad(rng.uniform(-11, 11) + 2.0 * smooth_noise(n, rate, 0.1, rng))
    droop = rng.choice([-1, 1]) * rng.uniform(4.0, 10.0)
    dx, dy = scene.pole.x - x, scene.pole.y - y
    tilt = Tilt(x, y, np.arctan2(dy, dx), elevation, droop)
    longer = tilt.unrolled(np.hypot(dx, dy)) / np.hypot(dx, dy)
    base = scene.pole.x - longer * dx, scene.pole.y - longer * dy
    touches = scene_touches(setting, scene, max(n // 110, 2), durations=(8, 50))
    place = scene.pole.x, scene.pole.y, scene.pole.radius
    angle, guess = drive_touches(hair, base, place, side, touches, rng, 0.18, table_of(scene))
    motion = driven_motion(scene, [(*base, angle)], guesses=[guess])
    second = second or _second_view(rng)
    return WhiskerInSpace(motion, tilt, second)


def _second_view(rng) -> SecondView:
    """A camera about 20° off the animal's axis that does not stand quite straight."""
    return SecondView(
        Camera(640, 300, rng.uniform(21, 26), exposure_s=0.0).with_noise_sd(NOISE),
        azimuth=np.deg2rad(20.0) + rng.normal(scale=0.02),
        roll=np.deg2rad(rng.uniform(-3, 3)),
        origin_px=(rng.uniform(5, 25), rng.uniform(140, 160)),
    )


def second_scene(space: WhiskerInSpace) -> Scene:
    """What the second view shows besides the pole."""
    scene, second = space.motion.scene, space.second
    x, y = second.project(space.tilt.x.mean(), space.tilt.y.mean(), 0.0)
    scale = second.camera.pixels_per_m
    hair = replace(scene.hairs[0], follicle_x=x / scale, follicle_y=-y / scale)
    return Scene(second.camera, scene.lights, Face("left"), (hair,), None, seed=scene.seed + 1)


def renderers(space: WhiskerInSpace, seed: int):
    """The renderers of the first and the second view."""
    scene, second = space.motion.scene, space.second
    first = Renderer(scene, View(space, scene, False), seed)
    view = View(space, second_scene(space), True)
    return first, SecondRenderer(view, scene.pole, second, seed + 1)
