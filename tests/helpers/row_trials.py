"""Short trials of three whiskers in a row, in which C2 touches a pole, or there is none."""

import numpy as np

from synthetic.motion import Motion
from synthetic.render import Renderer
from synthetic.scene import Camera, Face, Pole, Scene
from synthetic.staging import driven_motion, pole_for_touch, row_hairs

NAMES = ("C3", "C2", "C1")  # anterior → posterior: from the top on
SCALE = 20.0  # px/mm
CAMERA = Camera(560, 400, SCALE).with_noise_sd(1.5)
FRAMES = 60
SPACING = 1.3e-3  # m between follicles
FAN = 0.2  # rad from whisker to whisker
REACH, PUSH, PERIOD = 0.25, 0.06, 30  # rad back from the pole, rad into it, frames of a whisk


def row_motion(touch_at=None, seed=0, frames=FRAMES, camera=CAMERA) -> Motion:
    """Whisking against a pole that C2 grazes at this arc length [m]; None: there is no pole."""
    hairs = row_hairs(3, SPACING, 2.0e-3, -9.8e-3)
    graze = 0.0
    place = pole_for_touch(hairs[1], graze, touch_at, 1) if touch_at else None
    scene = Scene(
        camera,
        face=Face("left", pad=2 * SPACING),
        hairs=hairs,
        pole=Pole(*place, rod_direction=1.2) if place else None,
        seed=seed,
    )
    whisk = 0.5 + 0.5 * np.sin(2 * np.pi * np.arange(frames) / PERIOD)
    drives = []
    for rank, hair in zip((1, 0, -1), hairs, strict=True):
        base = [np.full(frames, at) for at in (hair.follicle_x, hair.follicle_y)]
        drives.append((*base, graze + FAN * rank - REACH + (REACH + PUSH) * whisk))
    return driven_motion(scene, drives)


def pole_px(motion) -> np.ndarray:
    """(x, y) of a trial's pole [px]."""
    return np.array(motion.scene.to_pixels(motion.scene.pole.x, motion.scene.pole.y))


def frames_of(motion, mirrored=False) -> np.ndarray:
    """Its frames, uint8 (frames, height, width); `mirrored`: with the face at the right."""
    renderer = Renderer(motion.scene, motion)
    frames = np.array([renderer.frame(i) for i in range(len(motion))])
    return np.ascontiguousarray(frames[:, :, ::-1]) if mirrored else frames


def whisker_under(motion, frame, points) -> str:
    """Name of the true whisker on which the middle of a line (n, 2) [px] lies in a frame."""
    middle = points[len(points) // 2]
    away = []
    for h in range(len(motion.scene.hairs)):
        x, y = motion.centrelines(h)
        away.append(np.hypot(x[frame] - middle[0], y[frame] - middle[1]).min())
    return motion.scene.names[int(np.argmin(away))]
