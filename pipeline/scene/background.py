"""The picture without whiskers, its noise and its illumination.

Lengths that decide what is thin (a whisker) and what is not are those of `SceneParams`.
"""

from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np

from pipeline.scene.illumination import fill, frame_gains, light_without_objects, smooth_flat_parts
from pipeline.scene.masks import distance_from, opened
from pipeline.scene.noise_model import (
    WINDOW_SD,
    WINDOWED_VARIANCE,
    fit_noise,
    noise_from_ranks,
    spatial_noise,
    windowed_moments,
)
from pipeline.session.parameters import SceneParams
from pipeline.session.quantities import pixels_in

SHORTEST_BASE_MM = 0.3  # without fur: a base that stays where it is while the rest moves
AT_THING_MM = 0.25  # so near to a thing, a line is taken to end on it
BRIGHT_RANK = 0.85  # of the samples of a pixel: free of whiskers that rest there up to this share
# by so much darker is a whisker, and by so much of the light, which codecs change by less; its
# flanks, which are not, reach FLANK_PX farther
DARK_SD, DARK_SHARE = 4.0, 0.04
FLANK_PX = 1
ENOUGH_CLEAR = 3  # samples without a whisker near, to know a pixel's light
FRINGE_MM, FRINGE_PX = 0.5, 12  # of fur along the face: the larger one
FAINTER = 0.5  # of a clear line's darkness joins its parts
MOVIE_FRAMES = 3  # with fewer, nothing can be learnt from motion


@dataclass(frozen=True)
class Background:
    """What is left when the whiskers are removed.

    Attributes
    ----------
    image : float32 (height, width) [grey]
    noise_floor, noise_gain : a pixel's variance = floor + gain × intensity [grey²], [grey]
    illumination : float32 (height, width), the light without any objects [grey]
    black : grey level of opaque things
    n_frames : number of frames it was made from; if fewer than MOVIE_FRAMES, it still has whiskers
    covered : bool (height, width), pixels that whiskers seldom or never uncover
    """

    image: np.ndarray
    noise_floor: float
    noise_gain: float
    illumination: np.ndarray
    black: float
    n_frames: int
    covered: np.ndarray

    @property
    def transmission(self) -> np.ndarray:
        """Share of the light that passes, float32 (height, width), about 0 (dark) to 1."""
        return (self.image - self.black) / np.maximum(self.illumination - self.black, 1.0)


def estimate_background(
    frames: np.ndarray, pixels_per_mm: float, params: SceneParams
) -> Background:
    """Estimate the background from a few frames of a scene in which only whiskers move.

    A pixel's background is the mean of its bright mode over time. Where whiskers pass, it is the
    mean of the frames in which none is near, or else is filled in from beside. What never moves,
    and everything in one or two frames, is left for `without_whiskers`.

    Parameters
    ----------
    frames : uint8 (k, height, width), not too close in time
    pixels_per_mm : scale of the image
    params : the room's parameters

    Raises
    ------
    ValueError
        If `frames` is not a stack of at least one grey image.
    """
    if frames.ndim != 3 or not frames.size:
        raise ValueError(f"frames must be (k, height, width) with k >= 1, got {frames.shape}")
    if len(frames) < MOVIE_FRAMES:
        image = frames.mean(0, dtype=np.float32)
        noise, covered = spatial_noise(image, len(frames)), np.zeros(image.shape, bool)
    else:
        image, noise, covered = temporal_background(frames, pixels_per_mm, params)
    (thin,) = thin_dark_lines(image, pixels_per_mm, noise, params)
    black, illumination = light_without_objects(image, pixels_per_mm, thin, params)
    return Background(image, *noise, illumination, black, len(frames), covered)


# ---- over time ----------------------------------------------------------------------------


def temporal_background(frames: np.ndarray, pixels_per_mm: float, params: SceneParams):
    """Mean of every pixel's bright mode (height, width), (noise floor, gain), `covered` pixels."""
    gains = frame_gains(frames)
    ordered = sort_over_time(_equalised(frames, gains))
    start = ordered[round(BRIGHT_RANK * (len(frames) - 1))]
    noise = noise_from_ranks(ordered)
    image, variance = start.astype(np.float32), None
    for _ in range(2):
        window = WINDOW_SD * np.sqrt(noise[0] + noise[1] * image)
        image, variance = windowed_moments(ordered, image, window.astype(np.float32))
        noise = fit_noise(image, variance / WINDOWED_VARIANCE, len(frames) - 1)
    broad = 0.5 * pixels_in(params.fur_breadth_mm, 1e3 * pixels_per_mm)
    image, covered = _uncovered(image, frames, gains, noise, ordered[0], broad)
    return image, noise, covered


def _equalised(frames, gains):
    """A copy of the frames without flicker."""
    out = np.empty_like(frames)
    for frame, gain, into in zip(frames, gains, out, strict=True):
        if abs(gain - 1) < 2e-3 or gain < 0.05:
            into[:] = frame
        else:
            cv2.convertScaleAbs(frame, into, 1 / gain)
    return out


def _uncovered(image, frames, gains, noise, darkest, broad_px):
    """The background where whiskers pass, from the samples with nothing dark nearby only.

    A pixel's bright mode includes the shade of a whisker that seldom leaves it, and of the flanks
    of passing ones, which are too faint to be distinguished from noise. Where few samples are
    clear, their mean is noisy, so that the surroundings count as well; they alone where no sample
    is clear. Where that is so over `broad_px` either way, fur moves: there the background stays as
    it is.
    """
    sd = np.sqrt(noise[0] + noise[1] * np.maximum(image, 0))
    dark = image - np.maximum(DARK_SD * sd, DARK_SHARE * np.percentile(image[::4, ::4], 95))
    passed, seldom = darkest < dark, np.zeros(image.shape, bool)
    if not passed.any():
        return image, seldom
    x, y, width, height = cv2.boundingRect(passed.astype(np.uint8))
    rows = slice(max(y - FLANK_PX, 0), y + height + FLANK_PX)
    part = rows, slice(max(x - FLANK_PX, 0), x + width + FLANK_PX)
    frames = _equalised(frames[:, *part], gains)
    count, mean = _clear_mean(frames, dark[part])
    few = count < ENOUGH_CLEAR
    passed = (count < len(frames)) & ~opened(few, broad_px)
    seldom[part] = few & passed
    beside = fill(image, seldom, FLANK_PX)[part]
    share = np.minimum(count / ENOUGH_CLEAR, 1)
    image = image.copy()
    image[part] = np.where(passed, share * mean + (1 - share) * beside, image[part])
    return image, seldom


def _clear_mean(frames, dark):
    """Per pixel, number and mean of the samples with no `dark` pixel nearby."""
    dark = np.clip(np.rint(dark), 0, 255).astype(np.uint8)
    total, count = np.zeros((2, *dark.shape), np.float32)
    for frame in frames:
        near = cv2.dilate(cv2.compare(frame, dark, cv2.CMP_LT), _square(FLANK_PX))
        cv2.accumulate(frame, total, ~near)
        count += near == 0
    return count, total / np.maximum(count, 1)


def sort_over_time(frames: np.ndarray) -> np.ndarray:
    """Sort every pixel's values over time, in place: a sorting network of whole-image steps."""
    steps = _sorting_network(len(frames))
    for top in range(0, frames.shape[1], 32):  # strips that stay in the cache
        strip = frames[:, top : top + 32].copy()
        lower = np.empty_like(strip[0])
        for a, b in steps:
            np.minimum(strip[a], strip[b], out=lower)
            np.maximum(strip[a], strip[b], out=strip[b])
            strip[a] = lower
        frames[:, top : top + 32] = strip
    return frames


def median_over_time(frames: np.ndarray) -> np.ndarray:
    """As `np.median` along the first axis, of (k, height, width), many times as fast."""
    middle = [(len(frames) - 1) // 2, len(frames) // 2]
    return sort_over_time(frames.copy())[middle].mean(axis=0)


@lru_cache
def _sorting_network(n):
    """Comparators of Batcher's merge exchange sort (Knuth, vol. 3, 5.2.2, algorithm M)."""
    steps = []
    top = 1 << max((n - 1).bit_length() - 1, 0)
    p = top
    while p > 0:
        q, r, d = top, 0, p
        while d > 0:
            steps += [(i, i + d) for i in range(n - d) if i & p == r]
            d, q, r = q - p, q >> 1, p
        p >>= 1
    return tuple(steps)


# ---- over space ---------------------------------------------------------------------------


def thin_dark_lines(
    image, pixels_per_mm, noise, params: SceneParams, face=None, darkness=(1.0,)
) -> list[np.ndarray]:
    """Pixels of thin dark lines, bool (height, width): darker than what lies on both sides.

    `noise`: (floor, gain) of the variance of `image`. Lines at the edges of large dark things
    are left out: they are creases of those; but whiskers do come out of the `face` (bool mask).
    `darkness`: for each mask, share of what is wanted of a line that is clear.
    """
    smooth = cv2.GaussianBlur(image, (0, 0), 1.0)
    size = max(3, 2 * round(params.thickest_whisker_mm * pixels_per_mm / 2) + 1)
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))
    around = cv2.morphologyEx(smooth, cv2.MORPH_CLOSE, disc)
    # of the noise's SD, 1/(2√π) = 0.28 is left after a blur of SD 1
    limit = 5 * 0.28 * np.sqrt(noise[0] + noise[1] * around) + 0.02 * around + 0.5
    large = around < 0.3 * np.percentile(around[::4, ::4], 95)
    large = cv2.morphologyEx(large.astype(np.uint8), cv2.MORPH_OPEN, disc)
    if face is not None:
        large[face] = 0
    apart = cv2.dilate(large, disc) == 0
    lines = [(around - smooth > share * limit) & apart for share in darkness]
    return [cv2.dilate(each.astype(np.uint8), _square(1)).astype(bool) for each in lines]


def _square(half_width):
    """Square for dilation by `half_width` pixels on all sides."""
    size = 2 * round(half_width) + 1
    return np.ones((size, size), np.uint8)


def _long_parts(thin, shortest_px, at=None):
    """Connected parts of a mask, at least `shortest_px` long, that reach `at` (a mask, if any)."""
    _, labels, stats, _ = cv2.connectedComponentsWithStats(thin.astype(np.uint8))
    keep = np.hypot(stats[:, cv2.CC_STAT_WIDTH], stats[:, cv2.CC_STAT_HEIGHT]) > shortest_px
    if at is not None:
        keep &= np.isin(np.arange(len(stats)), labels[at])
    keep[0] = False
    return keep[labels]


def without_whiskers(
    background: Background,
    face: np.ndarray,
    pixels_per_mm,
    params: SceneParams,
    fur=True,
    pole=None,
    things=None,
):
    """Return the image with whiskers that never moved filled from their surroundings.

    They are the long thin dark lines that come out of the face (bool mask); shorter lines are
    fur, and lines elsewhere scratches and wires: these stay, as they should in a background.
    Where there is no `fur`, shorter ones are the whiskers' bases, about which they turn. What
    leaves the `pole` (bool mask) on which such a line ends is the same whisker's other part.
    Lines that never move and end on other `things` (bool mask) are parts of them: they stay; but
    the fringe of fur along the face is where whiskers begin.
    """
    movie = background.n_frames >= MOVIE_FRAMES
    share = 1 / background.n_frames if movie else 1.0  # of the variance left in the average
    noise = share * background.noise_floor, share * background.noise_gain
    at = background.image, pixels_per_mm, noise, params, face
    clear, faint = thin_dark_lines(*at, (1.0, FAINTER))
    clear &= ~face
    away = distance_from(face)
    reach = fringe_px(pixels_per_mm)
    fringe = away <= reach
    thin = _long_parts(clear | faint & ~fringe, 0, clear)
    shortest = params.shortest_still_mm if movie else params.shortest_whisker_mm
    shortest = shortest if fur else SHORTEST_BASE_MM
    lines = thin | background.covered
    if pole is not None:
        # so near to the pole, thin lines are not seen
        lines |= _around(pole, params.thickest_whisker_mm * pixels_per_mm)
    whiskers = thin & _long_parts(lines, shortest * pixels_per_mm, _around(face, reach))
    if movie and things is not None:
        near = _around(things & ~fringe, AT_THING_MM * pixels_per_mm)
        whiskers &= ~_long_parts(whiskers, 0, whiskers & near)
    whiskers |= _long_parts(background.covered & ~fringe | whiskers, 0, whiskers)
    image = background.image
    if whiskers.any():
        image = _filled_beside(away, image, whiskers, reach)
    return image if movie else smooth_flat_parts(image, pixels_per_mm, noise)


def _filled_beside(away, image, holes, shade_px):
    """Fill holes with what lies around them, in proportion to what is usual as far from the face.

    `away` from the face [px]: up to `shade_px` the light grows with it.
    """
    rings = np.minimum(away, shade_px + 1).astype(int)
    clear = ~holes & (away > 0) & (away <= shade_px)
    seen = np.unique(rings[clear])
    usual = [np.median(image[clear & (rings == ring)]) for ring in seen]
    light = np.interp(away, seen + 0.5, usual) if len(usual) else np.ones(image.shape)
    light = np.maximum(np.where(away > 0, light, image), 1).astype(np.float32)
    return fill(image / light, holes) * light


def _around(mask, near_px):
    """A mask and the pixels within `near_px` of it in both directions, bool mask."""
    return cv2.dilate(mask.astype(np.uint8), _square(near_px)) > 0


def fringe_px(pixels_per_mm) -> float:
    """How far from the face a whisker may begin to be seen [px]."""
    return max(FRINGE_MM * pixels_per_mm, FRINGE_PX)
