"""The part of the picture that is looked at: a region, a mask, or both."""

from dataclasses import dataclass, replace

import cv2
import numpy as np

from pipeline.detection.static_scene import StaticScene
from pipeline.errors import VideoError
from pipeline.session.image import ImageSettings
from pipeline.video.image_file import read_image

LIGHT_RANK = 90  # percentile of a frame that stands for light
EVERY = 7  # pixel, for that
EVEN = 6  # grey, range of a margin after compression
BLURRED_PX = 3  # between margin and picture
ALL = 0.98  # of a margin's pixels are even
STEP = 0.5  # of a margin's length, along which the picture differs from it
LEAST_LEFT = 0.25  # of the picture's height and width, within margins
LEAST_PX = 16  # height and width of what is analysed: less shows no whisker


@dataclass(frozen=True)
class PicturePart:
    """The part that is analysed: `used`, bool (height, width), and the `box` about it, two slices.

    The rest of the picture is replaced by even light. Coordinates stay those of the whole picture.
    """

    used: np.ndarray
    box: tuple[slice, slice]

    @property
    def corner(self) -> tuple[int, int]:
        """x, y of the box's first pixel."""
        return self.box[1].start, self.box[0].start

    def place(self, xy) -> tuple[float, float]:
        """Return a place (x, y) of the whole picture as one in the box."""
        return xy[0] - self.corner[0], xy[1] - self.corner[1]

    def shown(self, frame: np.ndarray) -> np.ndarray:
        """Return a frame with even light in place of all but the part."""
        light = np.percentile(frame[self.used][::EVERY], LIGHT_RANK)
        return np.where(self.used, frame, np.uint8(light))

    def cut(self, frames: np.ndarray) -> np.ndarray:
        """Return the frames' boxes, (k, height, width)."""
        return np.ascontiguousarray(frames[:, *self.box])

    def whole(self, scene: StaticScene) -> StaticScene:
        """Return a scene of the box as one of the whole picture, dark outside of the part."""
        used, (x, y) = self.used[self.box], self.corner
        pole, excess, fur = scene.pole, scene.noise_excess, scene.moving_fur
        return replace(
            scene,
            background=self._set(np.where(used, scene.background, 0), 0),
            face_mask=self._set(scene.face_mask & used, False),
            obstacle_mask=self._set(scene.obstacle_mask | ~used, True),
            noise_excess=excess if excess is None else self._set(excess, 1),
            moving_fur=fur if fur is None else self._set(fur, False),
            pole=pole and replace(pole, x_px=pole.x_px + x, y_px=pole.y_px + y),
            refused_poles=tuple((px + x, py + y, why) for px, py, why in scene.refused_poles),
        )

    def _set(self, values, elsewhere):
        """Put values of the box into the whole picture."""
        out = np.full(self.used.shape, elsewhere, values.dtype)
        out[self.box] = values
        return out


def part_of(image: ImageSettings, video) -> PicturePart | None:
    """Return the part of a video's picture that the settings select; None: all of it.

    Raises
    ------
    VideoError
        If nothing or too little of the picture is left, or the mask is of another size.
    """
    if image.region_px is None and image.mask is None:
        return None
    inside = _inside(image.region_px, video.shape)
    if not inside.any():
        raise VideoError(
            video.path,
            f"its picture is {video.width}×{video.height} px, and {_region(image)} lies beyond "
            f"it; {_limits(video)}, or leave it out",
        )
    used = inside & _white(image.mask, video)
    rows, columns = (np.flatnonzero(used.any(axis)) for axis in (1, 0))
    height, width = (int(np.ptp(each)) + 1 if len(each) else 0 for each in (rows, columns))
    if min(height, width) < LEAST_PX:
        left = f"only {width}×{height} px" if width else "nothing"
        raise VideoError(
            video.path,
            f"its picture is {video.width}×{video.height} px, and [image] region_px and mask "
            f"leave {left} of it: expected at least {LEAST_PX} px either way; correct them, or "
            "leave them out",
        )
    return PicturePart(used, (slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)))


def region_doubt(image: ImageSettings, video) -> str | None:
    """Message about a region that reaches beyond a video's picture; None: it does not."""
    if image.region_px is None:
        return None
    _, _, right, bottom = image.region_px
    if right <= video.width and bottom <= video.height:
        return None
    return (
        f"{_region(image)} reaches beyond the picture, which is {video.width}×{video.height} px: "
        f"what is inside is looked at; if that is not what was meant, {_limits(video)}"
    )


def _region(image) -> str:
    return f"[image] region_px = [{', '.join(f'{each:g}' for each in image.region_px)}]"


def _limits(video) -> str:
    return f"give x from 0 to {video.width} and y from 0 to {video.height}"


def within_margins(frames: np.ndarray) -> PicturePart | None:
    """Return what lies within even margins around the picture; None: there are none.

    `frames`: uint8 (k, height, width). Conversion and montage put black bars, or a frame of any
    grey, around a picture. An even part of the picture itself does not end in a straight step: the
    edge of a face is softer.
    """
    rows, columns = (_between_margins(each) for each in (frames, frames.transpose(0, 2, 1)))
    used = np.zeros(frames.shape[1:], bool)
    used[rows, columns] = True
    if used.all() or min(used.any(1).mean(), used.any(0).mean()) < LEAST_LEFT:
        return None
    return PicturePart(used, (rows, columns))


def _between_margins(frames) -> slice:
    """Rows without the margins above and below."""
    above, below = (_margin(each) for each in (frames, frames[:, ::-1]))
    return slice(above, max(frames.shape[1] - below, above))


def _margin(frames) -> int:
    """Rows of the margin at the top, and of its blurred edge."""
    grey = np.int16(np.median(frames[:, 0]))
    if np.mean(np.abs(frames[:, 0] - grey) <= EVEN / 2) <= ALL:
        return 0  # as in most videos, at a small part of the cost of all rows
    even = np.mean(np.abs(frames - grey) <= EVEN / 2, axis=(0, 2)) > ALL
    n = int(np.argmin(even))
    first = n + BLURRED_PX
    if n == 0 or first + BLURRED_PX >= len(even):
        return 0
    typical, beyond = (np.median(frames[:, k], axis=0) for k in (first, first + BLURRED_PX))
    differs, settled = np.abs(typical - grey) > EVEN, np.abs(beyond - typical) <= EVEN
    return first if np.mean(differs & settled) > STEP else 0


def _inside(region, shape):
    """Pixels of the picture that are in a region [x0, y0, x1, y1), bool (height, width)."""
    if region is None:
        return np.ones(shape, bool)
    rows, columns = np.ogrid[: shape[0], : shape[1]]
    x0, y0, x1, y1 = region
    return (columns >= x0) & (columns < x1) & (rows >= y0) & (rows < y1)


def _white(mask, video):
    """Pixels that are not black in the mask's file, bool (height, width)."""
    if mask is None:
        return np.ones(video.shape, bool)
    picture = read_image(mask, cv2.IMREAD_GRAYSCALE)
    if picture is None or picture.shape != video.shape:
        size = "no picture" if picture is None else f"{picture.shape[1]}×{picture.shape[0]} px"
        raise VideoError(
            video.path,
            f"its picture is {video.width}×{video.height} px, but [image] mask {mask} is {size}: "
            "expected the same size; draw it on a frame of this video, or leave it out",
        )
    return picture > 0
