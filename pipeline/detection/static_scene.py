"""What does not move in a video, as lines are detected before it."""

from dataclasses import dataclass

import numpy as np

OUTWARD = {"left": (1, 0), "right": (-1, 0), "top": (0, 1), "bottom": (0, -1)}  # x, y off a face


@dataclass(frozen=True)
class PoleTrack:
    """The pole's centre in every frame, NaN while it is not in view, and its radius [px].

    `x_px`, `y_px` are float64 (frames,), also of lists or of one number.
    """

    x_px: np.ndarray
    y_px: np.ndarray
    radius_px: float

    def __post_init__(self):
        for axis in ("x_px", "y_px"):
            object.__setattr__(self, axis, np.array(getattr(self, axis), float, ndmin=1))

    def at(self, frame):
        """Centre x, y [px] in frames of these numbers; the last place holds on."""
        held = np.minimum(frame, len(self.x_px) - 1)
        return self.x_px[held], self.y_px[held]

    def moved(self, shifts) -> "PoleTrack":
        """Return the track moved by the shift x, y [px] of every frame."""
        shift_x, shift_y = np.reshape(shifts, (-1, 2)).T
        x, y = self.at(np.arange(len(shift_x)))
        return PoleTrack(x + shift_x, y + shift_y, self.radius_px)


@dataclass(frozen=True)
class StaticScene:
    """What does not move in a video.

    Attributes
    ----------
    background : float32 (height, width), the image without whiskers
    noise_gain, noise_floor : pixel variance = noise_floor + noise_gain × intensity [grey²]
    face_mask : bool (height, width), the face with its fur; whiskers come out of it
    obstacle_mask : bool (height, width), pole, rod, apparatus: dark, static, no whisker
    pole : PoleTrack or None
    face_side : "left", "right", "top" or "bottom"
    noise_excess : float32 (height, width), a pixel's variance over that of `noise_gain` and
        `noise_floor`; None where it is 1 everywhere
    likelier_side : that of the whiskers' thicker ends, where no face is seen on the side that was
        given; None: there is no such doubt
    moving_fur : bool (height, width), outside of the face, where its fur comes and goes; None:
        nowhere
    refused_poles : x, y [px] of what looked like a pole, and why it is none, in words
    face_seen : whether a face is in view; else the mask is that of what stands for it
    pole_likeness : of a disc to a pole's end (`pole_search.likeness`)
    """

    background: np.ndarray
    noise_gain: float
    noise_floor: float
    face_mask: np.ndarray
    obstacle_mask: np.ndarray
    pole: PoleTrack | None
    face_side: str
    noise_excess: np.ndarray | None = None
    likelier_side: str | None = None
    refused_poles: tuple[tuple[float, float, str], ...] = ()
    moving_fur: np.ndarray | None = None
    face_seen: bool = True
    pole_likeness: float = 0.0

    @property
    def unseen_face(self) -> float:
        """Part of the picture that stands for a face which is not in view; 0 where one is."""
        return 0.0 if self.face_seen else float(self.face_mask.mean())
