"""A plucked whisker in a micrograph: its picture, and a centreline to about a pixel.

Threshold, take the largest long thin region and the longest path through its skeleton, and follow
the whisker beyond that path until it can no longer be distinguished from the background.
"""

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import tifffile
from scipy.interpolate import make_lsq_spline
from scipy.ndimage import gaussian_filter, map_coordinates
from skimage.filters import apply_hysteresis_threshold
from skimage.graph import MCP_Geometric
from skimage.measure import label, regionprops
from skimage.morphology import skeletonize

from pipeline.errors import VideoError
from pipeline.numerics.polyline import arc_along, places_along
from pipeline.numerics.robust import robust_sd
from pipeline.video.image_file import decoded
from pipeline.video.image_stacks import is_stack

REDUCED = 8  # the ground is found in a picture reduced so many times
GROUND_REDUCED_PX = 31  # over which the ground's median is taken there
CLEAR, FAINT = 0.5, 0.15  # of the whisker's contrast: surely it, perhaps it
FAINT_SDS = 5.0  # of the noise
LEAST_CONTRAST = 0.05  # of the ground's brightness
LEAST_SLENDER = 15.0  # length over width
BOX = 0.85  # share of its bounding box that a scale bar fills
STEP_PX, LOOK_PX = 8, 4  # ahead, and to both sides, on the way to the whisker's end
BEHIND_PX = 80  # that give the direction
LOST_STEPS = 4  # without a whisker, after which it has ended
LINE_SDS = 3.5
EXPECTED = "one grey or RGB picture of a whisker; export it so"
MOST_CUT_OFF = 0.5  # of the pixels at one end of the grey scale


class NoWhiskerError(ValueError):
    """The picture shows no whisker that can be measured; the message says what to do."""


@dataclass(frozen=True)
class Trace:
    """A whisker in a micrograph.

    Attributes
    ----------
    image : (height, width) grey levels, the whisker dark
    points : (points, 2) x, y [px] about 1 px apart, from one end to the other
    half_width : largest half-width [px], roughly
    bright : whether the whisker was brighter than the ground
    """

    image: np.ndarray
    points: np.ndarray
    half_width: float
    bright: bool


def read_micrograph(path) -> np.ndarray:
    """Read a micrograph as grey levels, float32 (height, width), also of floats from 0 to 1.

    Raises
    ------
    VideoError
        If the file is no picture, or some of its pixels have no value.
    """
    try:
        data = np.fromfile(path, np.uint8)
    except OSError as error:
        raise VideoError(path, f"cannot be opened ({error.strerror}); give a picture") from None
    if not len(data):
        raise VideoError(path, "cannot be read as a picture: the file is empty; export it again")
    if is_stack(Path(path)):
        raise VideoError(path, f"has more than one page: expected {EXPECTED}")
    image = decoded(data)
    if image is None:
        try:
            image = tifffile.imread(path)
        except Exception as error:  # tifffile raises many kinds on a broken file
            raise VideoError(
                path,
                "cannot be read as a picture: damaged or not an image; export it as PNG or TIFF",
            ) from error
    if image.ndim == 3 and image.shape[2] in (3, 4):
        image = cv2.cvtColor(np.ascontiguousarray(image[..., :3]), cv2.COLOR_BGR2GRAY)
    if image.ndim != 2 or min(image.shape) < 4 * REDUCED:
        raise VideoError(path, f"has the shape {image.shape}: expected {EXPECTED}")
    if not np.isfinite(image).all():
        raise VideoError(
            path,
            "has pixels without a value (NaN): expected grey levels everywhere; export it again",
        )
    scale = 255 if image.dtype.kind == "f" and image.max() <= 1 else 1  # of floats from 0 to 1
    return scale * image.astype(np.float32)


def find_whisker(image) -> Trace:
    """Find the one whisker in a micrograph; it may be darker or brighter than the background.

    Raises
    ------
    NoWhiskerError
        Where there is none.
    """
    ground = _ground(image)
    for turned in _likelier_first(image, ground):
        contrast = turned * (ground - image) / np.maximum(ground, 1.0)
        region = _slender_region(gaussian_filter(contrast, 1.0))
        if region is not None:
            break
    else:
        raise NoWhiskerError(
            "shows no whisker: expected one long thin object, clearly darker or brighter than the "
            "ground; photograph one whisker, whole, on an even ground"
        )
    _need_exposure(image, turned)
    path = _longest_way(region)
    half_width = region.area / len(path)  # of a cone, half the mean width at its base
    line = smooth_line(_trimmed(path, half_width), 60.0)
    line = _to_its_end(line, contrast)
    line = _to_its_end(line[::-1], contrast)[::-1]
    grey = image if turned > 0 else 2 * ground - image
    return Trace(grey, line, half_width, turned < 0)


def _ground(image):
    """Brightness of the background, (height, width)."""
    height, width = image.shape
    size = max(width // REDUCED, 4), max(height // REDUCED, 4)
    small = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    low, span = small.min(), max(np.ptp(small), 1e-6)
    levels = np.round(255 * (small - low) / span).astype(np.uint8)
    median = cv2.medianBlur(levels, GROUND_REDUCED_PX).astype(np.float32)
    return cv2.resize(low + span * median / 255, (width, height), interpolation=cv2.INTER_LINEAR)


def _need_exposure(image, turned):
    """NoWhiskerError where the ground lies beyond the grey scale, and the edges with it."""
    end, word = (image.max(), "white") if turned > 0 else (image.min(), "black")
    share = np.mean(image == end)
    if share > MOST_CUT_OFF:
        raise NoWhiskerError(
            f"has {100 * share:.0f} % of its pixels purely {word} ({end:g}): expected a ground "
            "within the grey scale, as edges and thin ends are lost beyond it; photograph it "
            f"with {'less' if turned > 0 else 'more'} light"
        )


def _likelier_first(image, ground):
    """+1 for a dark whisker and −1 for a bright one, the likelier first."""
    low, high = np.quantile((ground - image) / np.maximum(ground, 1.0), [0.0005, 0.9995])
    return (1, -1) if high > -low else (-1, 1)


def _slender_region(contrast):
    """The largest long thin region, of skimage.measure.regionprops; None where there is none."""
    noise = robust_sd(contrast)
    peak = np.quantile(contrast, 0.9995)
    if peak < max(LEAST_CONTRAST, 2 * FAINT_SDS * noise):
        return None
    mask = apply_hysteresis_threshold(contrast, max(FAINT * peak, FAINT_SDS * noise), CLEAR * peak)
    regions = sorted(regionprops(label(mask, connectivity=2)), key=lambda r: -r.area)
    for region in regions[:8]:
        if region.extent < BOX and _slenderness(region) > LEAST_SLENDER:
            return region
    return None


def _slenderness(region):
    """Length over mean width of a region, from its area and perimeter."""
    half = region.perimeter / 2
    return half**2 / max(region.area, 1)


def _longest_way(region):
    """Pixels of the longest path through a region's skeleton, (points, 2) x, y."""
    skeleton = skeletonize(np.pad(region.image, 1))
    costs = np.where(skeleton, 1.0, -1.0)  # −1: no way
    start = tuple(np.argwhere(skeleton)[0])
    for _ in range(2):
        ways = MCP_Geometric(costs)
        distance, _ = ways.find_costs([start])
        distance[~np.isfinite(distance)] = -1
        last = start = tuple(np.unravel_index(np.argmax(distance), distance.shape))
    row, column = np.array(ways.traceback(last)).T
    top, left = region.bbox[:2]
    return np.column_stack([column + left - 1, row + top - 1]).astype(float)


def _trimmed(path, half_width):
    """The path without its ends, which a skeleton bends into corners."""
    cut = min(int(2 * half_width) + 2, len(path) // 8)
    return path[cut : len(path) - cut]


def smooth_line(points, knot_px):
    """Points 1 px apart on a cubic spline through `points` (n, 2), its knots `knot_px` apart."""
    along = arc_along(points)
    pieces = max(int(along[-1] / knot_px), 1)
    inner = np.linspace(0, along[-1], pieces + 1)[1:-1]
    knots = np.concatenate([np.zeros(4), inner, np.full(4, along[-1])])
    spline = make_lsq_spline(along, points, knots)
    fine = spline(np.linspace(0, along[-1], 4 * int(along[-1]) + 5))
    return places_along(fine, np.arange(0, arc_along(fine)[-1], 1.0))


def _to_its_end(line, contrast):
    """The line, extended beyond its last point for as long as there is a whisker."""
    noise = robust_sd(contrast, about=0.0) / np.sqrt(STEP_PX)
    lost, known = 0, len(line)
    while lost < LOST_STEPS:
        ahead, normal = _ahead(line, known)
        offsets = np.arange(-LOOK_PX - 6, LOOK_PX + 7)
        if not _inside(contrast, ahead):
            break
        x, y = (ahead[:, [k]] + offsets * normal[k] for k in (0, 1))
        profile = map_coordinates(contrast, [y, x], order=1, mode="nearest").mean(axis=0)
        offset, height = _peak(profile, offsets)
        found = height > LINE_SDS * noise / 1.5
        line = np.concatenate([line, ahead + (0.5 * offset * normal if found else 0.0)])
        lost, known = (0, len(line)) if found else (lost + 1, known)
    return line[:known]


def _ahead(line, known):
    """The next points of a line, extrapolated from its last ones, and the normal there."""
    behind = line[max(known - BEHIND_PX, 0) : known]
    t = np.arange(len(behind)) - len(behind) + 1.0
    degree = 2 if len(behind) >= BEHIND_PX else 1
    next_ = len(line) - known + np.arange(1.0, STEP_PX + 1)
    fits = [np.polynomial.Polynomial.fit(t, part, degree) for part in behind.T]
    ahead = np.column_stack([fit(next_) for fit in fits])
    along = np.array([fit.deriv()(next_[STEP_PX // 2]) for fit in fits])
    along /= np.hypot(*along)
    return ahead, np.array([-along[1], along[0]])


def _peak(profile, offsets):
    """Offset of a line in a profile across it, and its height above both sides."""
    smooth = gaussian_filter(profile, 1.0)
    middle = np.abs(offsets) <= LOOK_PX
    at = np.argmax(np.where(middle, smooth, -np.inf))
    return offsets[at], smooth[at] - np.median(profile)


def _inside(image, points):
    height, width = image.shape
    x, y = points.T
    return bool(
        (x > 1).all() and (y > 1).all() and (x < width - 2).all() and (y < height - 2).all()
    )
