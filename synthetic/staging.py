"""What presets are put together from: scenes of C2 whiskers, touches drawn at random, motions."""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from synthetic.motion import Motion, follicle_drift, side_of_pole, solve_motion, still_pole
from synthetic.scene import Camera, Face, Hair, Pole, Scene
from synthetic.touches import Touch, UnreachableForceError, drive_touches, force_table
from whiskermodel.rod import free_shape
from whiskermodel.whisker import Whisker, mouse_c2

CURVED = (12.0, 1800.0)  # 1/m, 1/m²: a C2 whisker's own bend, stronger towards the tip
FRAMES = 1000
MARGIN = 15  # frames without touches at a video's start and end
NOISE = 2.5  # grey levels
_ROW = (  # name, length and base radius of a row of whiskers, posterior to anterior
    ("C1", 20.5e-3, 41e-6),
    ("C2", 18.0e-3, 37e-6),
    ("C3", 15.0e-3, 32e-6),
    ("C4", 12.0e-3, 28e-6),
    ("C5", 10.0e-3, 25e-6),
)


@dataclass(frozen=True)
class Setting:
    """What a preset works from: its name, the session's seed, the trial and its random source."""

    preset: str
    seed: int
    trial: int
    rng: np.random.Generator | None = None
    frames: int = FRAMES

    @property
    def side(self) -> int:
        """Side of the pole, changing from trial to trial."""
        return 1 if self.trial % 2 == 0 else -1


def pole_for_touch(hair: Hair, base_angle, arc_length, side, radius=0.25e-3):
    """Centre [m] of a pole that the free whisker at `base_angle` [rad] grazes at `arc_length`."""
    s = np.array([0.0, arc_length])
    x, y, angle = free_shape(
        hair.whisker, hair.follicle_x, hair.follicle_y, base_angle, s, hair.intrinsic_curvature
    )
    reach = side * (radius + hair.whisker.radius(arc_length))
    return x[1] - reach * np.sin(angle[1]), y[1] + reach * np.cos(angle[1])


def draw_touches(rng, frames, count, table, durations=(3, 80), forces=(1.5e-6, 35e-6)):
    """Draw touches: log-uniform durations [frames] and peak forces [N], at random times.

    `table` is the ForceTable of the whisker and pole; no touch needs more than it bears.
    """
    lengths = np.exp(rng.uniform(*np.log(durations), count)).round().astype(int)
    lengths = lengths[: np.searchsorted(np.cumsum(lengths + 6), frames - 2 * MARGIN)]
    count = len(lengths)
    if count == 0:
        return []
    spare = frames - 2 * MARGIN - lengths.sum() - 5 * count
    gaps = 5 + (rng.dirichlet(np.ones(count + 1)) * spare).astype(int)
    onsets = MARGIN + np.cumsum(gaps[:-1]) + np.concatenate([[0], np.cumsum(lengths[:-1])])
    high = np.minimum(forces[1], table.bearable_force(lengths))
    low = np.minimum(forces[0], 0.8 * high)
    peaks = np.exp(rng.uniform(np.log(low), np.log(high)))
    return [
        Touch(int(onset), int(length), float(peak), touch_shape(length, rng))
        for onset, length, peak in zip(onsets, lengths, peaks, strict=True)
    ]


def touch_shape(duration, rng):
    """Time course of a touch; brief ones are all alike, others would be too abrupt."""
    shapes = ["half_gaussian", "skewed", "plateau"]
    return str(rng.choice(shapes, p=[0.7, 0.15, 0.15])) if duration >= 20 else shapes[0]


def table_of(scene: Scene, hair: Hair | None = None):
    """ForceTable of `hair` (the first) at rest and the scene's pole."""
    return _table(hair or scene.hairs[0], scene.pole, scene.face.axis)


@lru_cache(maxsize=64)
def _table(hair, pole, axis):
    base = hair.follicle_x, hair.follicle_y
    side = side_of_pole(hair, *base, axis, pole.x, pole.y)
    return force_table(hair, *base, pole.x, pole.y, pole.radius, side)


def c2_scene(setting, arc_length=None, angle=None, camera=None, **changes) -> Scene:
    """One C2 whisker on the left and a pole that it grazes at `arc_length` [m]; face on the left.

    `changes` replace fields of the Scene; "face", "hair" and "pole" hold changes of its parts.
    """
    rng, side = setting.rng, setting.side
    camera = camera or Camera().with_noise_sd(NOISE)
    height = camera.height / camera.pixels_per_m
    values = {
        "whisker": mouse_c2(),
        "intrinsic_curvature": CURVED,
        "follicle_x": 2.3e-3,
        "follicle_y": -height / 2 - side * 1.6e-3,
    }
    hair = Hair(**{**values, **changes.pop("hair", {})})
    if arc_length is None:
        arc_length = np.linspace(7e-3, 11e-3, 5)[rng.integers(5)]
    angle = side * rng.uniform(0.0, 0.2) if angle is None else angle
    place = pole_for_touch(hair, angle, arc_length, side)
    pole = Pole(*place, rod_direction=side * rng.uniform(0.9, 1.4))
    pole = replace(pole, **changes.pop("pole", {}))
    face = Face("left", **changes.pop("face", {}))
    values = {"camera": camera, "face": face, "hairs": (hair,), "pole": pole}
    return Scene(**{**values, "seed": setting.seed, **changes})


def follicle_to_pole(scene) -> float:
    """Distance of the first whisker's follicle from the pole's centre [m]."""
    hair, pole = scene.hairs[0], scene.pole
    return np.hypot(pole.x - hair.follicle_x, pole.y - hair.follicle_y)


def base_path(scene, hair: Hair, frames, rng):
    """Follicle of a whisker over time [m], two arrays (frames,)."""
    dx, dy = follicle_drift(frames, scene.camera.frames_per_second, rng)
    return hair.follicle_x + dx, hair.follicle_y + dy


def touching_motion(setting, scene, touches, pole_path=None, rest=0.18) -> Motion:
    """Motion in which a scene's first whisker makes the wanted touches on a pole at rest."""
    hair, pole = scene.hairs[0], scene.pole
    base = base_path(scene, hair, setting.frames, setting.rng)
    place = pole.x, pole.y, pole.radius
    angle, guess = drive_touches(
        hair, base, place, setting.side, touches, setting.rng, rest, table_of(scene)
    )
    pole_path = pole_path or still_pole(scene, setting.frames)
    motion = driven_motion(scene, [(*base, angle)], pole_path, [guess])
    if motion.hairs[0].slips:
        raise UnreachableForceError(
            f"{setting.preset}, trial {setting.trial}: the whisker slips off in frame "
            f"{motion.hairs[0].slips[0]}; ask for less force or a nearer pole"
        )
    return motion


def driven_motion(scene, drives, pole_path=None, guesses=None) -> Motion:
    """Motion of whiskers whose base motions `drives` are given: (x, y, angle) for each.

    `guesses` may hold for each what `solve_motion` takes as its start, or None.
    """
    pole_path = pole_path or still_pole(scene, len(drives[0][0]))
    guesses = guesses or [None] * len(drives)
    moving = [
        _solve(scene, h, drive, pole_path, guess)
        for h, (drive, guess) in enumerate(zip(drives, guesses, strict=True))
    ]
    return Motion(scene, moving, *pole_path)


def _solve(scene, h, drive, pole_path, guess=None):
    """Equilibria of one driven whisker; one out of the pole's plane never meets it."""
    hair, (x, y, angle) = scene.hairs[h], drive
    if scene.pole is None or not hair.touches:
        nowhere = np.full_like(x, np.nan)
        return solve_motion(hair, drive, (nowhere, nowhere, 0.0), 1)
    seen = int(np.argmax(np.isfinite(pole_path[0])))
    place = scene.pole.x, scene.pole.y
    side = side_of_pole(hair, x[seen], y[seen], angle[seen], *place)
    return solve_motion(hair, drive, (*pole_path, scene.pole.radius), side, guess)


def scene_touches(setting, scene, count=9, **limits):
    """Touches of a scene's first whisker, drawn as in `draw_touches`."""
    return draw_touches(setting.rng, setting.frames, count, table_of(scene), **limits)


def row_hairs(count, spacing, x, y) -> tuple[Hair, ...]:
    """Whiskers of one row, anterior to posterior; follicles `spacing` [m] apart around (x, y) [m].

    Anterior whiskers lie higher in the picture; protraction is upwards.
    """
    hairs = []
    for i, (name, length, radius) in enumerate(_ROW[:count]):
        whisker = Whisker(length, length / 0.95, radius, name=name)
        bend = tuple(np.array(CURVED) * 18e-3 / length)
        offset = (i - (count - 1) / 2) * spacing
        hairs.append(Hair(whisker, bend, x, y + offset))
    return tuple(reversed(hairs))
