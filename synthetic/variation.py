"""The same motion seen otherwise: by another camera, in other light, through another codec."""

from dataclasses import replace

import numpy as np

from synthetic.motion import Motion
from synthetic.scene import Camera, Codec, Face, Lights, Scene

PIXELS_PER_MM = 14.0, 34.0
NOISE_SD = 0.8, 5.0  # grey levels
LEVEL = 90.0, 230.0  # grey levels
BLUR_PX = 0.5, 1.3
EXPOSURES_S = 0.0, 1e-4, 3e-4
UNEVENNESS = 0.0, 0.35
FLICKERS = 0.0, 0.01, 0.03
FUR_MOVES_M = 0.0, 3e-5
HAIRS_PER_MM = 15.0, 50.0
OPACITIES = 0.95, 0.8, 0.6
MOST_LONG_HAIRS, MOST_SPECKS, MOST_STRAYS = 13, 9, 4


def varied_motion(motion: Motion, rng) -> Motion:
    """The same whiskers and pole in a picture drawn at random; `rng` is a numpy Generator."""
    return Motion(varied_scene(motion.scene, rng), motion.hairs, motion.pole_x, motion.pole_y)


def varied_scene(scene: Scene, rng) -> Scene:
    """The scene with camera, light, fur, dust, the whiskers' opacity and codec drawn at random.

    The field of view in mm stays, but for what makes width and height even, as H.264 wants them.
    """
    opacity = float(rng.choice(OPACITIES))
    level = rng.uniform(*LEVEL)
    return replace(
        scene,
        camera=_camera(scene.camera, level, rng),
        lights=_lights(scene.lights, level, rng),
        face=_face(scene.face, rng),
        hairs=tuple(replace(hair, opacity=opacity) for hair in scene.hairs),
        codec=_codec(rng),
        clutter=int(rng.integers(0, MOST_SPECKS + 1)),
        stray_hairs=int(rng.integers(0, MOST_STRAYS + 1)),
    )


def _camera(camera: Camera, level, rng) -> Camera:
    scale = _log_uniform(rng, PIXELS_PER_MM)
    grown = scale / camera.pixels_per_mm
    seen = replace(
        camera,
        width=2 * int(camera.width * grown / 2),
        height=2 * int(camera.height * grown / 2),
        pixels_per_mm=scale,
        blur_px=rng.uniform(*BLUR_PX),
        exposure_s=float(rng.choice(EXPOSURES_S)),
    )
    return seen.with_noise_sd(_log_uniform(rng, NOISE_SD), level)


def _lights(lights: Lights, level, rng) -> Lights:
    flicker = float(rng.choice(FLICKERS))
    return replace(lights, level=level, unevenness=rng.uniform(*UNEVENNESS), flicker=flicker)


def _face(face: Face, rng) -> Face:
    return replace(
        face,
        moving=float(rng.choice(FUR_MOVES_M)),
        hairs_per_mm=rng.uniform(*HAIRS_PER_MM),
        long_hairs=int(rng.integers(0, MOST_LONG_HAIRS + 1)),
    )


def _codec(rng) -> Codec:
    """Without loss, H.264 or MJPG, of ordinary quality."""
    name = str(rng.choice(["ffv1", "h264", "mjpeg"]))
    return Codec(name, crf=int(rng.integers(15, 25)), quality=int(rng.integers(2, 7)))


def _log_uniform(rng, bounds) -> float:
    return float(np.exp(rng.uniform(*np.log(bounds))))
