"""Scenes of several trimmed whiskers in a row, and how they whisk.

A function takes the `Setting` of a trial and returns its `Motion`; `presets` names them.
"""

from dataclasses import replace

import numpy as np

from synthetic.motion import smooth_noise, whisking
from synthetic.scene import Camera, Face, Hair, Lights, Pole, Scene
from synthetic.staging import (
    CURVED,
    NOISE,
    base_path,
    draw_touches,
    driven_motion,
    pole_for_touch,
    row_hairs,
    table_of,
)
from synthetic.touches import drive_touches
from whiskermodel.whisker import Whisker


def row(setting):
    """Four whiskers that whisk together, each a little in its own way; C2 touches the pole."""
    rng, frames = setting.rng, setting.frames
    count, spacing = 4, 1.3e-3  # m between follicles
    fan, own = 0.2, 0.05  # rad from whisker to whisker, and of each one's own motion
    hairs = row_hairs(count, spacing, 2.0e-3, -9.8e-3)
    c2 = hairs[-2]
    place = pole_for_touch(c2, 0.1 - 0.5 * fan, rng.uniform(7.5e-3, 10e-3), 1)
    scene = Scene(
        Camera(width=704).with_noise_sd(NOISE),
        face=Face("left", pad=spacing * (count - 1)),
        hairs=hairs,
        pole=Pole(*place, rod_direction=rng.uniform(1.1, 1.4)),
        seed=setting.seed,
    )
    touches = draw_touches(rng, frames, 7, table_of(scene, c2), durations=(4, 60))
    base = base_path(scene, c2, frames, rng)
    angle, _ = drive_touches(c2, base, (*place, scene.pole.radius), 1, touches, rng, rest=0.35)
    drives = []
    for hair in hairs:
        if hair is c2:
            drives.append((*base, angle))
            continue
        rank = (hair.follicle_y - c2.follicle_y) / spacing
        wobble = own * smooth_noise(frames, scene.camera.frames_per_second, 0.05, rng)
        share = 0.9 if rank < 0 else 1.05
        swing = share * (angle - angle.mean()) + wobble
        drives.append((*base_path(scene, hair, frames, rng), angle.mean() + fan * rank + swing))
    return driven_motion(scene, drives)


def crossing(setting):
    """Two whiskers that cross and lie upon each other, and one beside them; no pole."""
    rng, frames = setting.rng, setting.frames
    spacing = 1.6e-3
    hairs = row_hairs(3, spacing, 2.0e-3, -9.6e-3)
    hairs = tuple(
        replace(hair, intrinsic_curvature=tuple(sign * np.array(hair.intrinsic_curvature)))
        for hair, sign in zip(hairs, (-0.5, -1, 1), strict=True)  # C3, C2, C1
    )
    scene = Scene(
        Camera().with_noise_sd(NOISE),
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
    return driven_motion(scene, drives)


_DENSE = (  # length, base radius, place along the face from its middle [m], set point [degrees]
    (8e-3, 22e-6, 2.1e-3, 38),
    (9e-3, 23e-6, 1.7e-3, 30),
    (10e-3, 25e-6, 1.45e-3, 25),
    (12e-3, 28e-6, 1.0e-3, 19),
    (13e-3, 30e-6, 0.55e-3, 10),
    (15e-3, 32e-6, 0.3e-3, 6),
    (16e-3, 34e-6, -0.25e-3, -2),
    (18e-3, 37e-6, -0.6e-3, -7),
    (20e-3, 40e-6, -1.1e-3, -16),
    (21e-3, 41e-6, -1.35e-3, -20),
    (22e-3, 43e-6, -2.0e-3, -30),
)


def dense_row(setting):
    """Eleven whiskers of several rows seen from above, coarsely, in fast whisking; no pole.

    8 px/mm and 500 frames/s: some lie upon each other for a while, all move by up to 5 degrees
    from frame to frame, and the picture's border cuts some.
    """
    rng, frames, rate = setting.rng, setting.frames, 500.0
    camera = Camera(320, 240, 8.0, rate, 0.8, 5e-4).with_noise_sd(1.5)
    hairs = tuple(
        Hair(
            Whisker(length, length / 0.95, radius, name=f"W{i + 1}"),
            tuple(rng.uniform(-0.6, 0.9) * np.array(CURVED) * 18e-3 / length),
            4.0e-3,
            place - 15e-3,
        )
        for i, (length, radius, place, _) in enumerate(_DENSE)
    )
    face = Face("left", pad=4.5e-3)
    scene = Scene(camera, Lights(), face, hairs, None, seed=setting.seed)
    together = whisking(frames, rate, rng, 0.0, np.deg2rad(22), 15.0)
    drives = []
    for hair, (*_, degrees) in zip(hairs, _DENSE, strict=True):
        own = np.deg2rad(1.5) * smooth_noise(frames, rate, 0.04, rng)
        angle = np.deg2rad(degrees) + rng.uniform(0.85, 1.1) * together + own
        drives.append((*base_path(scene, hair, frames, rng), angle))
    return driven_motion(scene, drives)


def border(setting):
    """Whiskers that the picture's border cuts, and that leave the picture altogether."""
    rng, frames = setting.rng, setting.frames
    camera = Camera(width=400, height=320).with_noise_sd(NOISE)
    hairs = row_hairs(2, 2.2e-3, 2.0e-3, -6.6e-3)
    scene = Scene(camera, Lights(), Face("left", pad=2.2e-3), hairs, None, seed=setting.seed)
    drives = []
    for hair, set_point in zip(hairs, (0.35, -0.75), strict=True):  # C2, C1
        own = whisking(frames, 1e3, rng, set_point, 0.4, 7.0)
        drives.append((*base_path(scene, hair, frames, rng), own))
    return driven_motion(scene, drives)
