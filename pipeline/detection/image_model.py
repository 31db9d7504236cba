"""The static scene in front of which lines are measured: background, noise, what hides them."""

from contextlib import contextmanager
from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np
from numba import njit

from pipeline.detection import line_profile
from pipeline.detection.line import Line
from pipeline.detection.static_scene import OUTWARD, StaticScene
from pipeline.numerics.rectangles import WHOLE, bounds
from pipeline.session.parameters import DetectionParams

LEAST_HALF, MOST_HALF = 7, 20  # px to both sides of a node that its absorbance is measured over
INTO_FACE_PX = 1.5  # so far within its edge lines are still measured
BESIDE_PX = 2  # so far off a part of a picture points may lie that were found in it
COPIED_AT_ONCE = 8  # pixels that are copied in a row in the time of one by itself
TRANSLUCENT = 0.25  # of the light that passes beside it: a whisker is seen through such a thing


class Picture(NamedTuple):
    """A frame, what it would be without whiskers, and how much brighter it is, for compiled code.

    Attributes
    ----------
    image : uint8 (height, width)
    background, weight, outside, off_edges : as in `ImageModel`
    gain : brightness over the background's
    """

    image: np.ndarray
    background: np.ndarray
    weight: np.ndarray
    outside: np.ndarray
    off_edges: np.ndarray
    gain: float


@dataclass
class ImageModel:
    """The static scene as the tracker uses it: arrays of float32 (height, width).

    `off_edges` is how much farther than `edge_px` it is to face, obstacles and moving fur [px],
    also to the rims of obstacles that let light through, but for the pole, along which whiskers
    do lie; the picture's outermost pixels are an edge;
    `faintest` is the light that a line takes, below which nothing of it is seen, measured over
    `half` px to both sides of every node;
    `gain_points` are those of line_profile.frame_gain, on pixels that are free of all things;
    `outward` is the direction off the face's side, (x, y);
    `held` are the lines that are in the background for a while (`lines_in_background`).
    """

    background: np.ndarray
    weight: np.ndarray
    outside: np.ndarray
    noise: np.ndarray
    usable: np.ndarray
    off_edges: np.ndarray
    faintest: float
    half: int
    gain_points: tuple[np.ndarray, np.ndarray]
    outward: tuple[int, int]

    def __post_init__(self):
        self.held = HeldLines(self.background)

    @classmethod
    def from_scene(
        cls, scene: StaticScene, params: DetectionParams, absorbed=np.inf
    ) -> "ImageModel":
        """Face and opaque things get no weight; `outside` is signed, from the fur's edge [px].

        Nothing is looked for in front of obstacles (`usable`), but a whisker is followed across
        those that let light through.
        """
        background = np.ascontiguousarray(scene.background, np.float32)
        variance = np.maximum(scene.noise_floor + scene.noise_gain * background, 0.25)
        if scene.noise_excess is not None:
            variance *= scene.noise_excess
        outside = signed_distance(scene.face_mask)
        bright = ~scene.face_mask & (background > 12) & (outside > -INTO_FACE_PX)
        usable = bright & ~scene.obstacle_mask
        trembling = (params.trembling_px * gradient(background)) ** 2
        through = translucent(background, variance, trembling, scene.obstacle_mask, params)
        seen = usable | bright & through
        weight = np.where(seen, 1 / variance, 0).astype(np.float32)
        noise = np.sqrt(variance + trembling) / np.maximum(background, 12)
        kernel = np.ones((9, 9), np.uint8)
        free = cv2.erode(usable.astype(np.uint8), kernel).astype(bool)
        free_of_rims = (seen & ~rim(scene.obstacle_mask)).astype(np.uint8)
        off_edges = cv2.distanceTransform(free_of_rims, cv2.DIST_L2, 5) - params.edge_px
        if scene.moving_fur is not None:
            off_edges[scene.moving_fur] = -params.edge_px
        _clear_of_pole(off_edges, scene.pole, params.edge_px)
        for border in (off_edges[0], off_edges[-1], off_edges[:, 0], off_edges[:, -1]):
            np.minimum(border, 0, out=border)  # what runs along it is mostly not in the picture
        usual = float(np.median(noise[usable])) if usable.any() else np.inf
        least = max(params.faintest_sd * usual, params.faintest_share * absorbed)
        half = LEAST_HALF * np.clip((usual / params.quiet) ** 2, 1, MOST_HALF / LEAST_HALF)
        points = line_profile.gain_points(background, free)
        return cls(
            background, weight, outside, noise.astype(np.float32), usable, off_edges,
            min(least, params.faintest), round(half), points, OUTWARD[scene.face_side],
        )  # fmt: skip

    def picture(self, image, gain) -> Picture:
        """Return a frame of this scene for compiled code."""
        return Picture(image, self.background, self.weight, self.outside, self.off_edges, gain)

    def gain(self, image) -> float:
        """Brightness of a frame over the background's."""
        return line_profile.frame_gain(image, *self.gain_points)


def _clear_of_pole(off_edges, pole, edge_px) -> None:
    """Raise `off_edges` to `edge_px` about the pole, wherever it stands; in place."""
    if pole is None:
        return
    places = np.rint(np.column_stack([pole.x_px, pole.y_px]))
    for x, y in np.unique(places[np.isfinite(places).all(axis=1)], axis=0).astype(int):
        about = round(pole.radius_px + edge_px) + 1
        cv2.circle(off_edges, (int(x), int(y)), about, float(edge_px), cv2.FILLED)


def translucent(background, variance, trembling, obstacles, params) -> np.ndarray:
    """Pixels of obstacles that let light through: out-of-focus rods, not the rims of others.

    There it is bright, and so far from edges that their `trembling`, a variance, too, does not
    outdo the noise.
    """
    few = background[::4, ::4]
    few = few[few > 0]  # not what is outside of [image] region_px and mask
    bright = background > TRANSLUCENT * (np.percentile(few, 90) if len(few) else 0)
    through = obstacles & bright & (trembling < variance)
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, 2 * [max(round(params.rim_px), 1)])
    return cv2.morphologyEx(through.astype(np.uint8), cv2.MORPH_OPEN, disc).astype(bool)


def rim(mask) -> np.ndarray:
    """The outermost pixels of a mask, bool (height, width)."""
    return mask & ~cv2.erode(mask.astype(np.uint8), np.ones((3, 3), np.uint8)).astype(bool)


def gradient(background) -> np.ndarray:
    """By how much the light changes from pixel to pixel, noise left out [grey/px]."""
    return np.hypot(*np.gradient(cv2.GaussianBlur(background, (0, 0), 1.0)))


def signed_distance(mask) -> np.ndarray:
    """Distance [px] from the edge of a mask, float32, positive outside and smooth at the edge."""
    if not mask.any():
        return np.full(mask.shape, 1e3, np.float32)
    beyond = 8  # what the picture's border cuts goes on there
    inside = cv2.copyMakeBorder(mask.astype(np.uint8), *[beyond] * 4, cv2.BORDER_REPLICATE)
    far = cv2.distanceTransform(1 - inside, cv2.DIST_L2, 5)
    near = cv2.distanceTransform(inside, cv2.DIST_L2, 5)
    distance = np.where(inside > 0, 0.5 - near, far - 0.5).astype(np.float32)
    return cv2.GaussianBlur(distance, (0, 0), 1.5)[beyond:-beyond, beyond:-beyond].copy()


def absorbance_image(image, model: ImageModel, gain: float, part=WHOLE) -> np.ndarray:
    """1 − I/(gain B), zero where the scene blocks the view, float32 (height, width).

    part : slices of rows and columns; farther than BESIDE_PX off them, values mean nothing
    """
    within = bounds(part, image.shape, BESIDE_PX)
    return _absorbance(image, model.background, model.usable, np.float32(gain), within)


@njit(cache=True, error_model="numpy")
def _absorbance(image, background, usable, gain, within):
    out = np.empty(image.shape, np.float32)
    one, low, none = np.float32(1.0), np.float32(-0.3), np.float32(0.0)
    top, bottom, left, right = within
    for row in range(top, bottom):
        pixels, lights = image[row, left:right], background[row, left:right]
        free, absorbed = usable[row, left:right], out[row, left:right]
        for column in range(len(pixels)):
            expected = gain * lights[column]
            value = one - np.float32(pixels[column]) / (expected if expected > one else one)
            value = value if value > low else low
            absorbed[column] = value if free[column] else none
    return out


@contextmanager
def lines_in_background(model: ImageModel, lines=()):
    """Hold whiskers in the background of a with block, as `HeldLines`; afterwards it is as before.

    lines : those that are held from the start, beside those of blocks around this one
    """
    held = model.held
    before = dict(held.shadows)
    try:
        for line in lines:
            held.put_in(line)
        yield
    finally:
        held.go_back(before)


class HeldLines:
    """Lines whose transmission is multiplied into a background.

    `shadows` are, by the line's id, the line, its pixels and the transmission there as it was
    when it was put in.
    """

    def __init__(self, background):
        self.background, self.free = background, background.copy()
        self.shadows, self.touched = {}, []

    def hold(self, lines) -> None:
        """Hold these lines and no others; those held before as they were put in."""
        wanted = {id(line) for line in lines}
        self.go_back({key: each for key, each in self.shadows.items() if key in wanted})
        for line in lines:
            self.put_in(line)

    def put_in(self, line: Line) -> None:
        """Hold a line, too, if it is not held yet."""
        if id(line) not in self.shadows:
            nodes = line.x, line.y, line.n, line.amplitude, line.sigma
            self.keep(line, line_profile.shade(self.background, *nodes))

    def keep(self, line: Line, shade) -> None:
        """Note that the background holds a line: pixels and transmission as it was put in."""
        self.shadows[id(line)] = (line, *shade)
        self.touched.append(shade[0])

    def take_out(self, line: Line) -> None:
        """Hold a line no longer, as it was when it was put in."""
        line_profile.lighten(self.background, *self.forget(line))

    def forget(self, line: Line):
        """Undo `keep`, not the background; return pixels and transmission as it was put in."""
        return self.shadows.pop(id(line))[1:]

    def go_back(self, shadows) -> None:
        """Hold the lines of these shadows, no others; of none, the very background is there."""
        if not shadows:
            if COPIED_AT_ONCE * sum(map(len, self.touched)) > self.free.size:
                np.copyto(self.background, self.free)
            else:
                for pixels in self.touched:
                    line_profile.restore(self.background, pixels, self.free)
            self.touched = []
        else:
            for key, each in self.shadows.items():
                if shadows.get(key) is not each:
                    line_profile.lighten(self.background, *each[1:])
            for key, each in shadows.items():
                if self.shadows.get(key) is not each:
                    line_profile.darken(self.background, *each[1:])
        self.shadows = dict(shadows)
