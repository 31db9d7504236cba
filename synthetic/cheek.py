"""A dust particle on the whisker, and a cheek that carries the follicle in and out.

As in the paper's Fig. 1a. In every second trial the follicle also gives way to axial force.
"""

from dataclasses import replace

import numpy as np

from synthetic.motion import Motion, smooth_noise
from synthetic.scene import Particle
from synthetic.staging import Setting, base_path, c2_scene, driven_motion, scene_touches, table_of
from synthetic.touches import drive_touches

EXTENT, PACE = 0.25e-3, 0.15  # of the cheek's motion: about half its range [m], time [s]
GIVES_WAY = 30.0  # m per N of axial force, in every second trial: 0.15 mm at 5 µN
PLACES, RADII = (3.5e-3, 5.0e-3), (60e-6, 110e-6)  # of particles, arc length and radius [m]


def dusty_motion(setting: Setting, falls_off: int | None = None) -> Motion:
    """Touches of a whisker with a particle on it, which may fall off before a frame."""
    rng = setting.rng
    particle = Particle(rng.uniform(*PLACES), rng.uniform(*RADII), 0.5, falls_off)
    scene = c2_scene(setting, hair={"particle": particle})
    x, y = _follicle(setting, scene)
    motion = _touching(setting, scene, x, y)
    if setting.trial % 2:
        push = GIVES_WAY * motion.hairs[0].contact.axial_force
        x, y = x + push * np.cos(scene.face.axis), y + push * np.sin(scene.face.axis)
        angle = motion.hairs[0].contact.base_angle
        motion = driven_motion(scene, [(x, y, angle)])
    return motion


def _follicle(setting, scene):
    """The follicle's path: small drift all ways, and the cheek's along the whisker [m]."""
    x, y = base_path(scene, scene.hairs[0], setting.frames, setting.rng)
    rate = scene.camera.frames_per_second
    way = EXTENT * np.tanh(smooth_noise(setting.frames, rate, PACE, setting.rng))
    return x + way * np.cos(scene.face.axis), y + way * np.sin(scene.face.axis)


def _touching(setting, scene, x, y):
    """Motion with touches drawn at random, the follicle on a given path."""
    place = scene.pole.x, scene.pole.y, scene.pole.radius
    touches = [
        replace(touch, peak_force=min(touch.peak_force, 15e-6))
        for touch in scene_touches(setting, scene, 12, durations=(8, 60))
    ]
    angle, guess = drive_touches(
        scene.hairs[0], (x, y), place, setting.side, touches, setting.rng, 0.18, table_of(scene)
    )
    return driven_motion(scene, [(x, y, angle)], guesses=[guess])
