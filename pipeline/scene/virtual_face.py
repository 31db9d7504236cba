"""Pictures without a face: its edge is replaced by the places where whiskers begin to be seen.

Some labs film only the whiskers. The first visible points of a whisker, in frames from the whole
video, lie on the curve that they sweep as it turns about its follicle. All behind this curve is
taken for the face, and the curve for its edge.
"""

import cv2
import numpy as np

from pipeline.detection import ridges
from pipeline.detection.curves import Curves, join, length
from pipeline.scene.background import thin_dark_lines
from pipeline.scene.face import SIDES
from pipeline.scene.illumination import light_without_objects
from pipeline.scene.noise_model import spatial_noise
from pipeline.session.parameters import SceneParams

SHORTEST_MM = 4.0  # shorter lines are no whiskers
BIN_MM = 0.25  # along the face, in which starts are put together
INSIDE_PX = (4, 24)  # nodes from its end, between which a line's darkness is measured
BEYOND_PX = 12  # how far behind its end a line may begin in truth
MOVED = 0.8  # of the most light that a line's places ever get: what is lighter may be a rod
GAP_MM = 1.0  # between the parts of a whisker that something hides, e.g. the pole
HIDDEN_MM = 0.75  # from where a part turns towards the middle of what hides it
LEAST_WIDTH_PX = 1  # of what stands for the face where whiskers come over the border


def mask_behind_whiskers(frames, side: str | None, pixels_per_mm: float, params: SceneParams):
    """Stand-in for the face where none is in view.

    Parameters
    ----------
    frames : uint8 (k, height, width)
    side : of the face; None: where the whiskers' thicker ends are
    params : the room's parameters

    Returns
    -------
    side : str; "left" where neither given nor found
    mask : bool (height, width), what is nearer to that side than the whiskers' first visible
        points; all False where no whisker is seen
    thick_side : where the thicker ends of whiskers that move are; None where none is seen

    Lines that stand still are taken for whiskers only where none moves: they may be the pole's
    rod.
    """
    shape = frames.shape[1:]
    lightest = frames.max(axis=0)
    seen, moving = [], []
    for image in frames:
        found = _whiskers(image, pixels_per_mm, params)
        seen += found
        moving += [pair for pair in found if _has_moved(pair[0], image, lightest)]
    if not seen:
        return side or "left", np.zeros(shape, bool), None
    thick_side = _thick_side(moving, shape) if moving else None
    seen = moving or seen
    side = side or _thick_side(seen, shape)
    starts = [_start(curve, dark, side, shape) for curve, dark in seen]
    depth, along = np.transpose([_depth_and_place(x, y, side, shape) for x, y in starts])
    return side, _mask(depth, along, side, shape, BIN_MM * pixels_per_mm), thick_side


def _whiskers(image, pixels_per_mm, params):
    """All whiskers of a frame: points (n, 2) of x, y, and the absorbance image, of each."""
    image = image.astype(np.float32)
    noise = spatial_noise(image)
    (thin,) = thin_dark_lines(image, pixels_per_mm, noise, params)
    black, light = light_without_objects(image, pixels_per_mm, thin, params)
    dark = np.clip(1 - (image - black) / np.maximum(light - black, 1.0), -0.3, 1.0)
    sd = np.sqrt(noise[0] + noise[1] * np.maximum(image, 0)) / np.maximum(light - black, 1.0)
    curves = ridges.curves_of(np.where(thin, dark, 0).astype(np.float32), sd.astype(np.float32))
    least = SHORTEST_MM * pixels_per_mm
    long = Curves.of([each for each in curves.each() if length(each) > least])
    hidden = round(HIDDEN_MM * pixels_per_mm)
    return [(curve, dark) for curve in join(long, GAP_MM * pixels_per_mm, hidden).each()]


def _has_moved(curve, image, lightest) -> bool:
    """Whether most of a line's places are lighter in some other frame."""
    now, ever = (values_along(each, curve).astype(float) for each in (image, lightest))
    return np.median(now / np.maximum(ever, 1.0)) < MOVED


def _thick_side(seen, shape) -> str:
    """The side at which most of the whiskers have their darker ends."""
    sides = []
    for curve, dark in seen:
        low, high = INSIDE_PX
        ends = curve[low:high], curve[::-1][low:high]
        darker = max(ends, key=lambda end: np.median(values_along(dark, end)))
        depths = [_depth_and_place(*darker[0], side, shape)[0] for side in SIDES]
        sides.append(SIDES[int(np.argmin(depths))])
    return max(SIDES, key=sides.count)


def _start(curve, dark, side, shape):
    """Point where a line begins on the face's side: where it is half as dark as further on."""
    first, last = (_depth_and_place(*end, side, shape)[0] for end in curve[[0, -1]])
    if last < first:
        curve = curve[::-1]
    low, high = INSIDE_PX
    inside = curve[low:high]
    steps = np.arange(-BEYOND_PX, low + 1.0)
    back = inside[0] - inside[-1]
    back /= np.hypot(*back)
    line = curve[low] - (steps - low)[:, None] * back
    values = values_along(dark, line)
    level = 0.5 * np.median(values_along(dark, inside))
    faint = np.flatnonzero(values < level)
    if not len(faint):
        return line[0]
    last = min(faint[-1], len(line) - 2)
    part = (level - values[last]) / max(values[last + 1] - values[last], 1e-6)
    return line[last] + np.clip(part, 0, 1) * (line[last + 1] - line[last])


def values_along(image, points):
    """Values of an image at points (n, 2), bilinear; 0 outside of it."""
    x, y = np.asarray(points, np.float32).T
    return cv2.remap(image, x[None], y[None], cv2.INTER_LINEAR)[0]


def _depth_and_place(x, y, side, shape):
    """Distance from the side's border, and place along it [px]."""
    height, width = shape
    return {
        "left": (x, y),
        "right": (width - 1 - x, y),
        "top": (y, x),
        "bottom": (height - 1 - y, x),
    }[side]


def _mask(depth, along, side, shape, width_px):
    """What is less deep than the starts' median in bins along the side."""
    bins = np.rint(along / width_px).astype(int)
    found = np.unique(bins)
    at = np.array([np.median(along[bins == b]) for b in found])
    edge = np.array([np.median(depth[bins == b]) for b in found])
    rows, columns = np.indices(shape)
    deep, place = _depth_and_place(columns, rows, side, shape)
    return deep + 0.5 < np.maximum(np.interp(place, at, edge) + 0.5, LEAST_WIDTH_PX)
