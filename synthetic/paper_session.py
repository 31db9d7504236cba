"""A session as the paper's: five mice, five places of the pole, its population of contacts."""

from dataclasses import replace
from functools import lru_cache

import numpy as np

from synthetic.population import PUBLISHED_CONTACTS, draw_contacts, share_out
from synthetic.scene import Camera, Codec, Scene
from synthetic.staging import (
    CURVED,
    Setting,
    c2_scene,
    follicle_to_pole,
    table_of,
    touch_shape,
    touching_motion,
)
from synthetic.touches import Touch
from whiskermodel.whisker import Whisker

_MICE = 5
_POLES = np.array([7e-3, 8e-3, 9e-3, 10e-3, 11e-3])  # m from the follicle
_TOUCHES = 12  # per trial
_BLOCK = len(_POLES)  # trials that share out their touches among all poles


def mouse_whisker(mouse: int, seed: int) -> Whisker:
    """C2 whisker of one of the five mice: 18.26 ± 0.44 mm, 37.3 ± 1.0 µm (mean ± SD over mice)."""
    rng = np.random.default_rng([seed, 17])
    length, radius = (_spread(rng) for _ in range(2))
    length, radius = 18.26e-3 + 0.44e-3 * length[mouse], 37.3e-6 + 1.0e-6 * radius[mouse]
    tip_radius = 2.8e-6
    return Whisker(length, length * radius / (radius - tip_radius), radius, name="C2")


def _spread(rng):
    """Deviates of the five mice: in random order, mean 0, SD 1."""
    values = rng.normal(size=_MICE)
    return (values - values.mean()) / values.std(ddof=1)


def _scene(setting, mouse, pole_index) -> Scene:
    whisker = mouse_whisker(mouse, setting.seed)
    rng = np.random.default_rng([setting.seed, mouse, 23])
    bend = tuple(np.array(CURVED) * rng.uniform(0.3, 1.2))
    return c2_scene(
        replace(setting, trial=0, seed=100 * setting.seed + mouse, rng=rng),
        _POLES[pole_index],
        rng.uniform(-0.05, 0.1),
        Camera().with_noise_sd(1.5),
        hair={"whisker": whisker, "intrinsic_curvature": bend},
        face={"hidden_length": rng.uniform(1.0e-3, 1.6e-3)},
        codec=Codec("h264", crf=20, speed="ultrafast"),
    )


@lru_cache(maxsize=32)
def _block(seed, block):
    """Scenes of a block's trials, and the touches (forces [N], durations [ms]) of each."""
    rng = np.random.default_rng([seed, block, 29])
    scenes = []
    for k in range(_BLOCK):
        setting = Setting("fig3", seed, block * _BLOCK + k, rng)
        scenes.append(_scene(setting, k % _MICE, (k + block) % len(_POLES)))
    numbers = np.arange(block * _BLOCK * _TOUCHES, (block + 1) * _BLOCK * _TOUCHES)
    numbers = numbers[numbers < max(PUBLISHED_CONTACTS, numbers[0] + 1)]
    force, duration = draw_contacts(numbers, seed)
    able = np.column_stack([_bearable(scene, force, duration) for scene in scenes])
    able[~able.any(1), np.argmin([follicle_to_pole(scene) for scene in scenes])] = True
    chosen = share_out(force, able, rng)
    return scenes, [(force[chosen == k], duration[chosen == k]) for k in range(_BLOCK)]


def _bearable(scene, force, duration):
    """Touches that a scene's whisker bears without slipping or too fast a turn of its base.

    The strong and brief ones are for near poles only, where a small turn makes a large force.
    """
    return force <= table_of(scene).bearable_force(duration)


def paper_trial(setting):
    """One trial of a mouse and a pole: repeated touches, drawn from the paper's population."""
    scenes, wanted = _block(setting.seed, setting.trial // _BLOCK)
    k, rng = setting.trial % _BLOCK, setting.rng
    touches, frames = lay_out(*wanted[k], rng)
    protracting = replace(setting, trial=0, frames=frames)
    return touching_motion(protracting, scenes[k], touches)


def paper_place(setting):
    """Place of a trial's video: (sub-folder, stem), a sub-folder per mouse."""
    mouse = f"mouse{setting.trial % _BLOCK % _MICE + 1}"
    return mouse, f"{mouse}_{setting.trial:04d}"


def lay_out(forces, durations, rng):
    """Put touches one after the other: bouts with short pauses, longer ones between.

    Returns the list of Touch and the number of frames that they take.
    """
    order = rng.permutation(len(forces))
    bout = rng.uniform(size=len(forces)) < 0.2
    pauses = np.where(
        bout, rng.integers(4, 12, len(forces)), np.exp(rng.normal(3.5, 0.5, len(forces)))
    )
    onset, touches = 30, []
    for i, pause in zip(order, np.rint(pauses).astype(int), strict=True):
        shape = touch_shape(durations[i], rng)
        touches.append(Touch(onset, int(durations[i]), float(forces[i]), shape))
        onset += int(durations[i]) + max(int(pause), 4)
    return touches, onset + 40
