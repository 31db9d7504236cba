"""What all epochs of a video have together: the pole in every frame, the side of the face."""

from dataclasses import replace

import numpy as np

from pipeline.detection.static_scene import PoleTrack, StaticScene

UNTOUCHED = "a dark disc, but no whisker to touch it"


def face_side_of(scene) -> str:
    """Side of the picture with the face, of a StaticScene or of a video's epochs."""
    scenes = [scene] if isinstance(scene, StaticScene) else [e.scene for e in scene if e.scene]
    return scenes[0].face_side


def without_pole(scene: StaticScene) -> StaticScene:
    """The scene with its disc refused as a pole: no whisker is there to touch it."""
    if scene.pole is None:
        return scene
    disc = float(scene.pole.x_px[0]), float(scene.pole.y_px[0]), UNTOUCHED
    return replace(scene, pole=None, refused_poles=(*scene.refused_poles, disc))


def without_poles(epochs):
    """The epochs with their discs refused as poles, as of `without_pole`."""
    return [replace(e, scene=without_pole(e.scene)) if e.scene else e for e in epochs]


def pole_track(epochs) -> PoleTrack | None:
    """The pole from frame to frame, NaN where it is away or moving; None if never seen.

    The last entry holds to the end of the video.
    """
    n_frames = epochs[-1].start + 1
    x, y = np.full((2, n_frames), np.nan)
    radii = []
    for epoch in epochs:
        pole = epoch.scene.pole if epoch.scene else None
        if pole is not None:
            part = slice(epoch.start, epoch.stop)
            x[part], y[part] = pole.x_px[0], pole.y_px[0]
            radii.append(pole.radius_px)
    return PoleTrack(x, y, float(np.median(radii))) if radii else None
