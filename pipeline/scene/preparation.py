"""Preparation of a video: part of the picture, steadied, in even light, as a negative.

All of that is decided from some frames of the whole video, which are read once; the scene of a
short video is found in the same frames.
"""

from dataclasses import dataclass

import numpy as np

from pipeline.errors import VideoError
from pipeline.numerics.runs import evenly
from pipeline.scene.changing_light import usual_light
from pipeline.scene.picture_part import LEAST_PX, PicturePart, part_of, within_margins
from pipeline.scene.polarity import whiskers_are_bright
from pipeline.scene.scale import FIELD_MM, scale_of
from pipeline.scene.shake import still_of
from pipeline.session.image import ImageSettings
from pipeline.video.base import Video
from pipeline.video.changed import Changed, Negative, Steadied
from pipeline.video.frame_faults import is_black

N_FRAMES = 32  # that are read; …
FEW = 16  # … of them, that show margins, a shaking camera, changing light; …
FEWEST = 8  # … whether whiskers are bright: more frames show it no better


@dataclass(frozen=True)
class PreparedVideo:
    """A video as prepared for the analysis, and some of its frames.

    Attributes
    ----------
    video : the recorded one, steadied if the camera shakes, in its usual light if that changes
        across the picture; its negative if whiskers are bright
    part : `PicturePart` that is looked at; None: all of the picture
    indices : int (k,), ascending
    frames : uint8 (k, height, width), of `video`
    """

    video: Video
    part: PicturePart | None
    indices: np.ndarray
    frames: np.ndarray


def prepare_video(video, image: ImageSettings | None = None) -> PreparedVideo:
    """Prepare a video for the analysis, by some frames of all of it.

    Parameters
    ----------
    video : pipeline.video.open.Video
    image : the settings in [image]; what is not given there is found

    Raises
    ------
    VideoError
        If not even one frame can be read, or the picture, or what `image` leaves of it, is too
        small.
    """
    if min(video.shape) < LEAST_PX:
        raise VideoError(
            video.path,
            f"has frames of {video.width}×{video.height} px: expected at least {LEAST_PX} px "
            "either way, or no whisker can be seen; export it larger",
            0,
        )
    image = image or ImageSettings()
    indices, frames = map(np.array, zip(*without_black(video.sampled(N_FRAMES)), strict=True))
    part = part_of(image, video) or within_margins(_few(frames))
    still = still_of(_shown(part, _few(frames)))
    if still is not None:
        video = Steadied(video, still.steady)
        frames = np.stack([still.steady(frame)[0] for frame in frames])
    light = usual_light(_few(frames), None if part is None else part.used)
    if light is not None:
        video = Changed(video, light.evened)
        frames = np.stack([light.evened(frame) for frame in frames])
    bright = image.polarity == "bright"
    if image.polarity is None:
        few = _shown(part, frames[evenly(len(frames), FEWEST)])
        scale = scale_of(video.shape, FIELD_MM)
        bright = whiskers_are_bright(few if part is None else part.cut(few), scale)
    if bright:
        video, frames = Negative(video), np.invert(frames)
    return PreparedVideo(video, part, indices, frames)


def without_black(sampled):
    """Yield (index, frame) without black frames, as with the lamp off; if all are, the last."""
    seen = False
    for index, frame in sampled:
        if not is_black(frame):
            seen = True
            yield index, frame
    if not seen:
        yield index, frame


def _few(frames):
    """FEW of the frames, evenly chosen."""
    return frames[evenly(len(frames), FEW)]


def _shown(part, frames):
    """The frames with only the part to be seen."""
    return frames if part is None else np.stack([part.shown(frame) for frame in frames])
