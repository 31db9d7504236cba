"""Named kinds of sessions: each makes the scene and the motion of one trial from a seed.

`single` and `noisy` are the plain cases, `fig3` the paper's population of contacts; the others
each hold one difficulty against a tracker or a contact detector.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from synthetic.motion import (
    Motion,
    Touch,
    drive_touches,
    follicle_drift,
    force_table,
    grazing_angle,
    pole_visits,
    side_of_pole,
    smooth_noise,
    solve_motion,
    still_pole,
    whisking,
)
from synthetic.scene import Camera, Codec, Face, Hair, Lights, Pole, Scene
from whiskermodel.rod import free_shape
from whiskermodel.whisker import Whisker, mouse_c2

_CURVED = (12.0, 1800.0)  # 1/m, 1/m²: a C2 whisker's own bend, stronger towards the tip
_FRAMES = 1000
_NOISE = 2.5  # grey levels


@dataclass(frozen=True)
class Trial:
    """One video to be: its stem, the sub-folder of its session.toml, and the motion."""

    stem: str
    group: str
    motion: Motion

    @property
    def scene(self) -> Scene:
        """The motion's scene."""
        return self.motion.scene


@dataclass(frozen=True)
class Setting:
    """What a preset works from: its name, the session's seed, the trial and its random source."""

    preset: str
    seed: int
    trial: int
    rng: np.random.Generator
    frames: int = _FRAMES

    @property
    def stem(self) -> str:
        """File name of the video without suffix."""
        return f"{self.preset}_{self.trial:03d}"

    @property
    def side(self) -> int:
        """Side of the pole, changing from trial to trial."""
        return 1 if self.trial % 2 == 0 else -1


@dataclass(frozen=True)
class Preset:
    """A named kind of session: how to make a trial, how many show all of it, what it holds."""

    make: Callable[[Setting], Trial]
    trials: int
    meaning: str


def make_trial(preset: str, seed: int, trial: int, frames: int = _FRAMES) -> Trial:
    """Return trial number `trial` (from 0) of a preset, the same for the same arguments.

    Raises ValueError for an unknown preset, with the names of those that exist.
    """
    rng = np.random.default_rng([seed, trial, 7])
    return find_preset(preset).make(Setting(preset, seed, trial, rng, frames))


def find_preset(preset: str) -> Preset:
    """Return the preset of that name; ValueError names those that exist."""
    if preset not in PRESETS:
        raise ValueError(f"preset must be one of {', '.join(PRESETS)}, got {preset!r}")
    return PRESETS[preset]


# Parts ---------------------------------------------------------------------------------------


def pole_for_touch(hair: Hair, base_angle, arc_length, side, radius=0.25e-3):
    """Centre [m] of a pole that the free whisker at `base_angle` [rad] grazes at `arc_length`."""
    s = np.array([0.0, arc_length])
    x, y, angle = free_shape(
        hair.whisker, hair.follicle_x, hair.follicle_y, base_angle, s, hair.intrinsic_curvature
    )
    reach = side * (radius + hair.whisker.radius(arc_length))
    return x[1] - reach * np.sin(angle[1]), y[1] + reach * np.cos(angle[1])


def draw_touches(rng, frames, count, largest_force, durations=(3, 80), forces=(1.5e-6, 35e-6)):
    """Draw touches: log-uniform durations [frames] and peak forces [N], at random times.

    Brief touches are not given the largest forces, and none more than `largest_force`.
    """
    lengths = np.exp(rng.uniform(*np.log(durations), count)).round().astype(int)
    while lengths.sum() + 6 * count + 80 > frames:
        lengths = lengths[:-1]
        count -= 1
    spare = frames - 60 - lengths.sum() - 5 * count
    gaps = 5 + (rng.dirichlet(np.ones(count + 1)) * spare).astype(int)
    onsets = 25 + np.cumsum(gaps[:-1]) + np.concatenate([[0], np.cumsum(lengths[:-1])])
    touches = []
    for onset, length in zip(onsets, lengths, strict=True):
        high = min(forces[1], largest_force, forces[0] + 2e-6 + 0.8e-6 * length)
        low = min(forces[0], 0.8 * high)
        shape = rng.choice(["half_gaussian", "half_gaussian", "plateau", "skewed"])
        peak = np.exp(rng.uniform(np.log(low), np.log(high)))
        touches.append(Touch(int(onset), int(length), float(peak), str(shape)))
    return touches


def reachable_force(scene: Scene) -> float:
    """Largest force [N] a touch of the first whisker may ask for, some room left."""
    hair, pole = scene.hairs[0], scene.pole
    base = hair.follicle_x, hair.follicle_y
    side = side_of_pole(hair, *base, scene.face.axis, pole.x, pole.y)
    return 0.85 * force_table(hair, *base, pole.x, pole.y, pole.radius, side).largest_force


def c2_scene(setting, arc_length=None, angle=None, camera=None, **changes) -> Scene:
    """One C2 whisker on the left and a pole that it grazes at `arc_length` [m]; face on the left.

    `changes` replace fields of the Scene; "face", "hair" and "pole" hold changes of its parts.
    """
    rng, side = setting.rng, setting.side
    camera = camera or Camera().with_noise_sd(_NOISE)
    height = camera.height / camera.pixels_per_m
    values = {
        "whisker": mouse_c2(),
        "intrinsic_curvature": _CURVED,
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


def base_path(scene, hair: Hair, frames, rng):
    """Follicle of a whisker over time [m], two arrays (frames,)."""
    dx, dy = follicle_drift(frames, scene.camera.frames_per_second, rng)
    return hair.follicle_x + dx, hair.follicle_y + dy


def touching_trial(setting, scene, touches, group="", pole_path=None, rest=0.18) -> Trial:
    """Trial in which a scene's first whisker makes the wanted touches on a pole at rest."""
    hair, pole = scene.hairs[0], scene.pole
    base = base_path(scene, hair, setting.frames, setting.rng)
    angle = drive_touches(
        hair, *base, (pole.x, pole.y, pole.radius), setting.side, touches, setting.rng, rest
    )
    pole_path = pole_path or still_pole(scene, setting.frames)
    return driven_trial(setting, scene, [(*base, angle)], pole_path, group)


def driven_trial(setting, scene, drives, pole_path=None, group="") -> Trial:
    """Trial of whiskers whose base motions `drives` are given: (x, y, angle) for each."""
    pole_path = pole_path or still_pole(scene, setting.frames)
    moving = [_solve(scene, h, drive, pole_path) for h, drive in enumerate(drives)]
    return Trial(setting.stem, group, Motion(scene, moving, *pole_path))


def _solve(scene, h, drive, pole_path):
    """Equilibria of one driven whisker; one out of the pole's plane never meets it."""
    hair, (x, y, angle) = scene.hairs[h], drive
    if scene.pole is None or not hair.touches:
        nowhere = np.full_like(x, np.nan)
        return solve_motion(hair, x, y, angle, nowhere, nowhere, 0.0, 1)
    seen = int(np.argmax(np.isfinite(pole_path[0])))
    place = scene.pole.x, scene.pole.y
    side = side_of_pole(hair, x[seen], y[seen], angle[seen], *place)
    return solve_motion(hair, x, y, angle, *pole_path, scene.pole.radius, side)


def _scene_touches(setting, scene, count=9, **limits):
    largest = reachable_force(scene)
    return draw_touches(setting.rng, setting.frames, count, largest, **limits)


def _c2_touching(setting, count=9, **changes) -> Trial:
    scene = c2_scene(setting, **changes)
    return touching_trial(setting, scene, _scene_touches(setting, scene, count))


# Plain ---------------------------------------------------------------------------------------


def _single(setting):
    return _c2_touching(setting, camera=Camera())


def _noisy(setting):
    return _c2_touching(setting)


def _low_contrast(setting):
    return _c2_touching(setting, hair={"opacity": 0.3})


def _coarse(setting):
    camera = Camera(pixels_per_mm=18.0).with_noise_sd(_NOISE)
    return _c2_touching(setting, camera=camera)


def _h264(setting):
    return _c2_touching(setting, codec=Codec("h264", crf=21))


def _mjpeg(setting):
    return _c2_touching(setting, codec=Codec("mjpeg", quality=4))


# Touches -------------------------------------------------------------------------------------


def _faint_touch(setting):
    """Touches near the tip, of a few tenths of a µN to the little that it can bear."""
    arc_length = setting.rng.uniform(12.5e-3, 16e-3)
    scene = c2_scene(setting, arc_length)
    touches = _scene_touches(setting, scene, 8, forces=(0.15e-6, 6e-6), durations=(6, 90))
    return touching_trial(setting, scene, touches)


def _large_deflection(setting):
    """Touches close to the largest force that the whisker bears before it slips off."""
    scene = c2_scene(setting, setting.rng.uniform(7e-3, 9.5e-3), -0.25 * setting.side)
    largest = reachable_force(scene)
    touches = _scene_touches(
        setting, scene, 7, forces=(0.4 * largest, largest), durations=(25, 110)
    )
    return touching_trial(setting, scene, touches)


def _slip_off(setting):
    """The whisker is pushed past the pole and comes back against its other side."""
    arc_length = setting.rng.uniform(10.5e-3, 15e-3)
    scene = c2_scene(setting, arc_length, -0.25 * setting.side)
    hair, pole, side = scene.hairs[0], scene.pole, setting.side
    base = base_path(scene, hair, setting.frames, setting.rng)
    table = force_table(hair, hair.follicle_x, hair.follicle_y, pole.x, pole.y, pole.radius, side)
    graze = grazing_angle(hair, pole.x - base[0], pole.y - base[1], pole.radius, side)
    far = table.turn[-1] + setting.rng.uniform(0.05, 0.25)
    pace = 1 + 0.2 * smooth_noise(setting.frames, 1e3, 0.3, setting.rng)
    phase = 2 * np.pi * np.cumsum(pace) / setting.rng.uniform(160, 320)
    turn = -0.3 + (far + 0.3) * 0.5 * (1 - np.cos(phase))
    return driven_trial(setting, scene, [(*base, graze + side * turn)])


def _near_miss(setting):
    """The whisker comes within 0.02–0.3 mm of the pole, over and over, and does not touch."""
    scene = c2_scene(setting)
    hair, pole, side = scene.hairs[0], scene.pole, setting.side
    base = base_path(scene, hair, setting.frames, setting.rng)
    graze = grazing_angle(hair, pole.x - base[0], pole.y - base[1], pole.radius, side)
    lever = np.hypot(pole.x - hair.follicle_x, pole.y - hair.follicle_y)
    free = whisking(setting.frames, scene.camera.frames_per_second, setting.rng)
    least = np.exp(setting.rng.uniform(np.log(0.02e-3), np.log(0.3e-3))) / lever
    return driven_trial(setting, scene, [(*base, graze + side * (free - free.max() - least))])


def _free(setting):
    """Free whisking beside a pole that is never touched."""
    scene = c2_scene(setting, setting.rng.uniform(7e-3, 12e-3), 0.35 * setting.side)
    hair, side = scene.hairs[0], setting.side
    base = base_path(scene, hair, setting.frames, setting.rng)
    free = whisking(setting.frames, scene.camera.frames_per_second, setting.rng, -0.1 * side, 0.22)
    top = np.max(side * free)
    free -= side * max(top - 0.33, 0.0)
    return driven_trial(setting, scene, [(*base, free)])


def _moving_pole(setting):
    """The pole comes in after a while, is touched, and is withdrawn before the end."""
    way = 11e-3
    scene = c2_scene(setting)
    direction = scene.pole.rod_direction
    away = way * np.cos(direction), way * np.sin(direction)
    scene = replace(scene, pole=replace(scene.pole, away_x=away[0], away_y=away[1]))
    travel = int(0.12 * setting.frames)
    start, end = int(0.15 * setting.frames), int(0.85 * setting.frames)
    path = pole_visits(scene, setting.frames, [(start, end)], travel)
    inside = end - start - 2 * travel
    touches = draw_touches(setting.rng, inside, 6, reachable_force(scene), durations=(4, 50))
    shifted = [replace(t, onset=t.onset + start + travel) for t in touches]
    return touching_trial(setting, scene, shifted, pole_path=path)


# Surroundings --------------------------------------------------------------------------------


def _moving_fur(setting):
    """Fur that moves with the whisker, long hairs, dust and a flickering lamp."""
    return _c2_touching(
        setting,
        face={"moving": 0.15e-3, "long_hairs": 14, "hair_length": 0.6e-3},
        lights=Lights(unevenness=0.3, flicker=0.015),
        clutter=25,
        stray_hairs=4,
    )


def _orientation(setting):
    """One direction of the whisker per trial, from −90° to 90° in steps of 15°, a few twice.

    The whisker sweeps a few degrees about it; between the steps lie small odd offsets, so that
    directions along, nearly along and across the image's axes all occur.
    """
    steps = np.deg2rad(np.arange(-90, 91, 15))
    direction = steps[setting.trial % len(steps)]
    size = 640
    camera = Camera(width=size, height=size).with_noise_sd(_NOISE)
    half, scale = size / 2, camera.pixels_per_m
    follicle = (
        (half - 215 * np.cos(direction)) / scale,
        -(half + 215 * np.sin(direction)) / scale,
    )
    hair = Hair(mouse_c2(), (0.5, 100.0), *follicle)
    quarter = round(direction / (np.pi / 2))
    side = {-1: "top", 0: "left", 1: "bottom"}[quarter]
    scene = Scene(camera, Lights(), Face(side, direction), (hair,), None, seed=setting.seed)
    base = base_path(scene, hair, setting.frames, setting.rng)
    rate = camera.frames_per_second
    sweep = whisking(setting.frames, rate, setting.rng, amplitude=np.deg2rad(4.0))
    turned = np.rad2deg(direction)
    trial = driven_trial(setting, scene, [(*base, direction + sweep)], group=side)
    return replace(trial, stem=f"{setting.preset}_{setting.trial:03d}_{turned:+03.0f}deg")


_ROW = (  # length and base radius of four whiskers, posterior to anterior
    ("C1", 20.5e-3, 41e-6),
    ("C2", 18.0e-3, 37e-6),
    ("C3", 15.0e-3, 32e-6),
    ("C4", 12.0e-3, 28e-6),
    ("C5", 10.0e-3, 25e-6),
)


def row_hairs(count, spacing, x, y) -> tuple[Hair, ...]:
    """Whiskers of one row, C2 first; follicles `spacing` [m] apart around (x, y) [m].

    Posterior whiskers lie lower in the picture, protraction is upwards.
    """
    hairs = []
    for i, (name, length, radius) in enumerate(_ROW[:count]):
        whisker = Whisker(length, length / 0.95, radius, name=name)
        bend = tuple(np.array(_CURVED) * 18e-3 / length)
        offset = (i - (count - 1) / 2) * spacing
        hairs.append(Hair(whisker, bend, x - 0.06 * abs(offset), y + offset))
    hairs[0], hairs[1] = hairs[1], hairs[0]
    return tuple(hairs)


def _row(setting, count=4, spacing=1.3e-3, fan=0.2, own=0.05):
    """Four whiskers that whisk together, each a little in its own way; C2 touches the pole."""
    rng, frames = setting.rng, setting.frames
    camera = Camera(width=704).with_noise_sd(_NOISE)
    hairs = row_hairs(count, spacing, 2.0e-3, -9.8e-3)
    first = hairs[0]
    place = pole_for_touch(first, fan * -0.5 + 0.1, 8.5e-3, 1)
    rod = rng.uniform(1.1, 1.4)
    scene = Scene(
        camera,
        Lights(),
        Face("left", pad=spacing * (count - 1)),
        hairs,
        Pole(*place, rod_direction=rod),
        seed=setting.seed,
    )
    upward = replace(setting, trial=2 * setting.trial)
    touches = draw_touches(rng, frames, 7, reachable_force(scene), durations=(4, 60))
    base = base_path(scene, first, frames, rng)
    angle = drive_touches(first, *base, (*place, scene.pole.radius), 1, touches, rng, rest=0.35)
    drives = [(*base, angle)]
    common = angle - angle.mean()
    for hair in hairs[1:]:
        rank = (hair.follicle_y - first.follicle_y) / spacing
        wobble = own * smooth_noise(frames, 1e3, 0.05, rng)
        share = 0.9 if rank < 0 else 1.05
        set_point = angle.mean() + fan * rank
        drives.append((*base_path(scene, hair, frames, rng), set_point + share * common + wobble))
    return replace(driven_trial(upward, scene, drives), stem=setting.stem)


def _crossing(setting):
    """Two whiskers that cross and lie upon each other, and one beside them; no pole."""
    rng, frames = setting.rng, setting.frames
    spacing = 1.6e-3
    hairs = row_hairs(3, spacing, 2.0e-3, -9.6e-3)
    hairs = tuple(
        replace(hair, intrinsic_curvature=tuple(sign * np.array(hair.intrinsic_curvature)))
        for hair, sign in zip(hairs, (-1, 1, -0.5), strict=True)
    )
    scene = Scene(
        Camera().with_noise_sd(_NOISE),
        Lights(),
        Face("left", pad=2 * spacing),
        hairs,
        None,
        seed=setting.seed,
    )
    set_points = {"C2": 0.0, "C1": 0.02, "C3": 0.25}
    drives = []
    for hair in hairs:
        own = whisking(frames, 1e3, rng, set_points[hair.whisker.name], 0.2, rng.uniform(8, 14))
        drives.append((*base_path(scene, hair, frames, rng), own))
    return driven_trial(setting, scene, drives)


def _border(setting):
    """Whiskers that the picture's border cuts, and that leave the picture altogether."""
    rng, frames = setting.rng, setting.frames
    camera = Camera(width=400, height=320).with_noise_sd(_NOISE)
    hairs = row_hairs(2, 2.2e-3, 2.0e-3, -6.6e-3)
    scene = Scene(camera, Lights(), Face("left", pad=2.2e-3), hairs, None, seed=setting.seed)
    drives = []
    for hair, set_point in zip(hairs, (0.35, -0.75), strict=True):
        own = whisking(frames, 1e3, rng, set_point, 0.4, 7.0)
        drives.append((*base_path(scene, hair, frames, rng), own))
    return driven_trial(setting, scene, drives)


def _passing(setting):
    """A whisker that passes before or behind the pole and its rod without touching."""
    scene = c2_scene(setting, 9e-3, 0.1 * setting.side, hair={"touches": False})
    base = base_path(scene, scene.hairs[0], setting.frames, setting.rng)
    free = whisking(setting.frames, 1e3, setting.rng, 0.15 * setting.side, 0.35, 9.0)
    return driven_trial(setting, scene, [(*base, free)])


PRESETS = {
    "single": Preset(_single, 4, "one C2 whisker, little noise, touches from both sides"),
    "noisy": Preset(_noisy, 4, "the same with noise of 2.5 grey levels"),
    "low_contrast": Preset(_low_contrast, 2, "a translucent whisker"),
    "row": Preset(_row, 2, "four whiskers in a row"),
    "crossing": Preset(_crossing, 2, "whiskers that cross and lie upon each other"),
    "moving_fur": Preset(_moving_fur, 2, "moving fur, dust, stray hairs, flicker"),
    "orientation": Preset(_orientation, 13, "every orientation from -90 to 90 degrees"),
    "faint_touch": Preset(_faint_touch, 2, "faint touches near the tip"),
    "h264": Preset(_h264, 2, "H.264 at ordinary quality"),
    "mjpeg": Preset(_mjpeg, 2, "MJPG"),
    "slip_off": Preset(_slip_off, 2, "the whisker slips past the pole and comes back"),
    "large_deflection": Preset(_large_deflection, 2, "forces near the largest possible"),
    "coarse": Preset(_coarse, 2, "18 px/mm"),
    "moving_pole": Preset(_moving_pole, 2, "the pole comes late and leaves"),
    "near_miss": Preset(_near_miss, 2, "near the pole, never touching"),
    "free": Preset(_free, 2, "free whisking beside a pole"),
    "border": Preset(_border, 2, "whiskers cut by the border, out of view at times"),
    "passing": Preset(_passing, 2, "a whisker that passes before the pole and its rod"),
}
