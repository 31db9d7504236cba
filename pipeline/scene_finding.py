"""A video's static scene: background, face, pole, obstacles."""

import cv2
import numpy as np

from pipeline.background import estimate_background, without_whiskers
from pipeline.face import face_side, find_face
from pipeline.pole import find_pole
from pipeline.records import PoleTrack, Recording, StaticScene

N_SAMPLES = 32
OPAQUE = 0.7  # share of the light below which something static hides whiskers


def find_scene(video, recording: Recording, pole_diameter_m=0.5e-3, pole_xy=None) -> StaticScene:
    """Find what does not move in a video.

    Parameters
    ----------
    video : pipeline.video.Video
    recording : frame rate, scale, side of the face (None: find it)
    pole_diameter_m : [m]; None: there is no pole
    pole_xy : (x, y) [px] of the pole where a person gave it
    """
    _, frames = video.sample(N_SAMPLES)
    return scene_from_frames(frames, recording, pole_diameter_m, pole_xy, video.n_frames or 1)


def scene_from_frames(
    frames, recording: Recording, pole_diameter_m=0.5e-3, pole_xy=None, n_frames: int = 1
) -> StaticScene:
    """As `find_scene`, from a few frames uint8 (k, height, width) of a scene that stays."""
    scale = recording.pixels_per_mm
    background = estimate_background(frames, scale)
    transmission = background.transmission
    side = recording.face or face_side(transmission)
    face = find_face(transmission, side, scale)
    image = without_whiskers(background, face, scale)
    pole = None
    if pole_diameter_m is not None:
        radius_px = 0.5e3 * pole_diameter_m * scale
        pole = find_pole(transmission, radius_px, pole_xy, face)
    return StaticScene(
        background=image,
        noise_gain=background.noise_gain,
        noise_floor=background.noise_floor,
        face_mask=face,
        obstacle_mask=find_obstacles(transmission, face, pole, scale),
        pole=_constant_track(pole, n_frames),
        face_side=side,
    )


def find_obstacles(transmission, face, pole, pixels_per_mm) -> np.ndarray:
    """Pixels of dark static things that are neither face nor thin, bool (height, width)."""
    size = 2 * round(0.15 * pixels_per_mm) + 1
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))
    dark = cv2.morphologyEx((transmission < OPAQUE).astype(np.uint8), cv2.MORPH_OPEN, disc)
    dark[face] = 0
    fringe = cv2.dilate(face.astype(np.uint8), disc) > 0
    _, labels, stats, _ = cv2.connectedComponentsWithStats(dark)
    area = stats[:, cv2.CC_STAT_AREA] / pixels_per_mm**2
    at_face = np.isin(np.arange(len(stats)), np.unique(labels[fringe]))
    keep = np.where(at_face, area > 2.0, area > 0.05)
    keep[0] = False
    mask = np.isin(labels, np.flatnonzero(keep))
    if pole is not None:
        rows, columns = np.ogrid[: mask.shape[0], : mask.shape[1]]
        mask |= np.hypot(columns - pole.x_px, rows - pole.y_px) < pole.radius_px
    return mask & ~face


def _constant_track(pole, n_frames):
    if pole is None:
        return None
    return PoleTrack(np.full(n_frames, pole.x_px), np.full(n_frames, pole.y_px), pole.radius_px)
