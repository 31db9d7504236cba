"""Named kinds of sessions: each makes the scene and the motion of one trial from a seed."""

from dataclasses import dataclass, replace

import numpy as np

from synthetic.motion import (
    Motion,
    Touch,
    UnreachableForceError,
    drive_touches,
    follicle_drift,
    force_table,
    solve_motion,
    still_pole,
)
from synthetic.scene import Camera, Face, Hair, Pole, Scene
from whiskermodel.rod import free_shape
from whiskermodel.whisker import mouse_c2

_CURVED = (12.0, 1800.0)  # 1/m, 1/m²: a C2 whisker's own bend, stronger towards the tip


@dataclass(frozen=True)
class Trial:
    """One video to be: its stem, the folder of the session that it is in, scene and motion."""

    stem: str
    group: str
    motion: Motion

    @property
    def scene(self) -> Scene:
        """The motion's scene."""
        return self.motion.scene


def make_trial(preset: str, seed: int, trial: int) -> Trial:
    """Return trial number `trial` (from 0) of a preset, the same for the same seed.

    Raises ValueError for an unknown preset, with the names of those that exist.
    """
    if preset not in PRESETS:
        raise ValueError(f"preset must be one of {', '.join(PRESETS)}, got {preset!r}")
    rng = np.random.default_rng([seed, trial, 7])
    return PRESETS[preset](Setting(preset, seed, trial, rng))


def default_trials(preset: str) -> int:
    """Return how many trials show all that a preset has to show."""
    return 4


@dataclass(frozen=True)
class Setting:
    """What a preset works from: its name, the session's seed, the trial and its random source."""

    preset: str
    seed: int
    trial: int
    rng: np.random.Generator

    @property
    def stem(self) -> str:
        """File name of the video without suffix."""
        return f"{self.preset}_{self.trial:03d}"


# Places --------------------------------------------------------------------------------------


def pole_for_touch(hair: Hair, base_angle, arc_length, side, radius=0.25e-3):
    """Centre [m] of a pole that the free whisker at `base_angle` [rad] grazes at `arc_length`."""
    s = np.array([0.0, arc_length])
    x, y, angle = free_shape(
        hair.whisker, hair.follicle_x, hair.follicle_y, base_angle, s, hair.intrinsic_curvature
    )
    reach = side * (radius + hair.whisker.radius(arc_length))
    return x[1] - reach * np.sin(angle[1]), y[1] + reach * np.cos(angle[1])


def draw_touches(rng, n, largest_force, count, durations=(3, 80), forces=(1.5e-6, 35e-6)):
    """Draw touches for `n` frames: log-uniform durations [frames], forces [N], random order.

    Forces are cut at `largest_force`, and brief touches are not given the largest forces.
    """
    durations = np.exp(rng.uniform(*np.log(durations), count)).round().astype(int)
    gaps = 4 + rng.dirichlet(np.ones(count + 1)) * max(n - durations.sum() - 5 * count - 60, 0)
    gaps[0] += 20
    onset, touches = 0, []
    for gap, duration in zip(gaps, durations, strict=False):
        onset += int(gap)
        high = min(forces[1], largest_force, 3e-6 + 0.8e-6 * duration)
        peak = np.exp(rng.uniform(np.log(forces[0]), np.log(max(high, 1.05 * forces[0]))))
        if onset + duration < n - 1:
            touches.append(Touch(onset, int(duration), float(peak)))
        onset += int(duration)
    return touches


# Presets -------------------------------------------------------------------------------------


def _single(setting: Setting, camera=None, frames=1000, count=9) -> Trial:
    """One C2 whisker, touches from both sides at 7–11 mm."""
    rng, side = setting.rng, 1 if setting.trial % 2 == 0 else -1
    hair = Hair(mouse_c2(), _CURVED, 2.3e-3, -9.6e-3 - side * 1.6e-3)
    contact = np.linspace(7e-3, 11e-3, 5)[rng.permutation(5)[0]]
    pole_x, pole_y = pole_for_touch(hair, side * rng.uniform(0.0, 0.2), contact, side)
    pole = Pole(pole_x, pole_y, rod_direction=side * rng.uniform(0.9, 1.4))
    scene = Scene(
        camera=camera or Camera(), face=Face("left"), hairs=(hair,), pole=pole, seed=setting.seed
    )
    table = force_table(hair, hair.follicle_x, hair.follicle_y, pole.x, pole.y, pole.radius, side)
    touches = draw_touches(rng, frames, 0.8 * table.largest_force, count)
    return touching_trial(setting, scene, touches, side, frames)


def touching_trial(setting, scene, touches, side, frames, group="") -> Trial:
    """Trial of a scene's first whisker that makes the wanted touches on a pole at rest."""
    hair, pole, rng = scene.hairs[0], scene.pole, setting.rng
    dx, dy = follicle_drift(frames, scene.camera.frames_per_second, rng)
    base = hair.follicle_x + dx, hair.follicle_y + dy
    place = (pole.x, pole.y, pole.radius)
    angle = drive_touches(hair, *base, place, side, touches, rng)
    pole_x, pole_y = still_pole(scene, frames)
    moving = solve_motion(hair, *base, angle, pole_x, pole_y, pole.radius, side)
    return Trial(setting.stem, group, Motion(scene, [moving], pole_x, pole_y))


def _noisy(setting: Setting) -> Trial:
    """Like `single`, with noise of 2.5 grey levels."""
    return _single(setting, camera=Camera().with_noise_sd(2.5))


PRESETS = {"single": _single, "noisy": _noisy}
