"""Epochs: periods in which nothing large moves, with what stands still in each of them."""

from collections import Counter
from dataclasses import dataclass, replace

import numpy as np

from pipeline.detection.static_scene import PoleTrack, StaticScene

UNTOUCHED = "a dark disc, but no whisker to touch it"


@dataclass(frozen=True)
class Epoch:
    """Frames [start, stop) with what stood still in them; stop None: to the video's end.

    `scene` is None while something large moved: nothing is certain there.
    """

    start: int
    stop: int | None
    scene: StaticScene | None


def as_epochs(scene):
    """The epochs of a video; one for all of it where `scene` is a StaticScene."""
    return [Epoch(0, None, scene)] if isinstance(scene, StaticScene) else scene


def numbers_at(indices, epochs) -> np.ndarray:
    """Number of the epoch to which each of the frames `indices` belongs."""
    return np.searchsorted([epoch.start for epoch in epochs], indices, side="right") - 1


def face_side_of(scene) -> str:
    """Side of the picture with the face, of a StaticScene or of a video's epochs."""
    return next(epoch.scene.face_side for epoch in as_epochs(scene) if epoch.scene)


def typical_epoch(epochs, n_frames=None) -> Epoch:
    """The longest epoch of the scene that holds longest, if possible of one with a pole.

    `n_frames` of the video, where they are known: else the last epoch counts as one frame.
    """
    still = [(epoch, _lasts(epoch, n_frames)) for epoch in epochs if epoch.scene]
    held = Counter()
    for epoch, lasts in still:
        held[id(epoch.scene)] += lasts

    def rank(item):
        epoch, lasts = item
        return epoch.scene.pole is not None, held[id(epoch.scene)], lasts

    return max(still, key=rank)[0]


def _lasts(epoch, n_frames) -> int:
    """Frames of an epoch, one at least."""
    stop = n_frames if epoch.stop is None else epoch.stop
    return max((stop or 0) - epoch.start, 1)


def without_pole(scene: StaticScene) -> StaticScene:
    """The scene with its disc refused as a pole: no whisker is there to touch it."""
    if scene.pole is None:
        return scene
    disc = float(scene.pole.x_px[0]), float(scene.pole.y_px[0]), UNTOUCHED
    return replace(scene, pole=None, refused_poles=(*scene.refused_poles, disc))


def without_poles(epochs):
    """The epochs with their discs refused as poles, as in `without_pole`."""
    bare = {id(e.scene): without_pole(e.scene) for e in epochs if e.scene}
    return [replace(e, scene=bare[id(e.scene)]) if e.scene else e for e in epochs]


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
