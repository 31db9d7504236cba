"""The light behind the whiskers: per frame, and across a picture with objects."""

import cv2
import numpy as np

EDGE_RATIO = 1.4  # of light within three cells: more is the edge of something
OPAQUE = 0.6  # of the light: the darkest thing is opaque up to so much, which haze adds to it
HAZIEST = 0.85  # of the light: what is lighter is no thing, whatever its edge
SHARP = 0.35  # of the step from light to dark lies within three cells: 0.55 and more in recordings
NOTHING_DARK = 0.25  # of the light, taken for black where all things are lighter
LIT = 0.7  # of the brightest light somewhere in a region: with less, it may be pale fur
CELL_MM = 0.3  # side of the cells in which light and coarse changes are looked at
LEAST_CELL_PX = 8  # in which noise averages out


def frame_gains(frames: np.ndarray) -> np.ndarray:
    """Brightness of each frame relative to the typical one, float64 (k,), from a few pixels."""
    few = frames[:, 4::9, 4::9].reshape(len(frames), -1).astype(np.float32)
    typical = np.median(few, axis=0)
    bright = typical >= 0.5 * np.percentile(typical, 95)
    return np.median(few[:, bright] / np.maximum(typical[bright], 1), axis=1).astype(float)


def fill(image: np.ndarray, holes: np.ndarray, reach_px: float = 4.0) -> np.ndarray:
    """Fill the pixels `holes` of an image with the weighted mean of what lies around them."""
    out = image.copy()
    weight = 1 - holes.astype(np.float32)
    left = holes.copy()
    while left.any():
        total = cv2.GaussianBlur(weight, (0, 0), reach_px)
        mean = cv2.GaussianBlur(image * weight, (0, 0), reach_px)
        good = left & (total > 1e-3)
        out[good] = mean[good] / total[good]
        left &= ~good
        reach_px *= 2
        if reach_px > 4 * max(image.shape):
            out[left] = np.mean(image)
            break
    return out


def smooth_flat_parts(image, pixels_per_mm, noise) -> np.ndarray:
    """Average a single frame's noise away where nothing but light changes."""
    fine = cv2.GaussianBlur(image, (0, 0), 1.0)
    coarse = cv2.GaussianBlur(image, (0, 0), max(0.25 * pixels_per_mm, 2.0))
    limit = 2.0 * 0.28 * np.sqrt(noise[0] + noise[1] * fine) + 0.5
    changes = cv2.blur((np.abs(fine - coarse) > limit).astype(np.float32), (7, 7))
    share = np.clip(2.5 * changes - 0.5, 0, 1)  # 0: flat, 1: something is there
    return (share * image + (1 - share) * coarse).astype(np.float32)


def light_without_objects(image, pixels_per_mm, thin, params) -> tuple[float, np.ndarray]:
    """Black level, and the light as it would be without face, pole and rod, float32 (h, w).

    Pixels of `thin` lines (bool (h, w) or None) are left out.

    Light fades smoothly, even into a dark corner; objects end at an edge. So the light is
    measured wherever a path from bright places crosses no edge. A path is at least three cells
    wide: an edge that is soft in one place is still an edge.
    """
    height, width = image.shape
    cell = max(round(CELL_MM * pixels_per_mm), LEAST_CELL_PX)
    cells = _cells(image, thin, cell)
    bright = np.percentile(cells, 95)
    darkest = float(np.percentile(image[::2, ::2], 0.5))
    opaque = darkest < OPAQUE * bright or _ends_sharply(cells, darkest, bright)
    black = darkest if opaque else NOTHING_DARK * bright
    reach = max(params.illumination_mm * pixels_per_mm / cell, 1.5)
    labels, seeds = _edgeless_regions(cells - black, LIT * (bright - black))
    known = _any_of(labels, seeds)
    light = spread(cells, known, reach)
    # places cut off by a rod: they have the light of the other side
    similar = (labels > 0) & (cells > black + 0.6 * (light - black))
    light = spread(cells, known | similar, reach)
    return black, cv2.resize(light, (width, height), interpolation=cv2.INTER_LINEAR)


def _cells(image, thin, side):
    """Mean of every side × side pixels, of those that are not thin lines."""
    height, width = image.shape
    size = (max(width // side, 1), max(height // side, 1))
    if thin is None or not thin.any():
        return cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    weight = 1 - thin.astype(np.float32)
    share = cv2.resize(weight, size, interpolation=cv2.INTER_AREA)
    cells = cv2.resize(image * weight, size, interpolation=cv2.INTER_AREA)
    covered = share < 0.1
    return fill(cells / np.where(covered, 1, share), covered, reach_px=1.0)


def _ends_sharply(cells, dark, bright) -> bool:
    """Whether the dark part has an edge, as objects have even in haze, but shade has not."""
    if dark > HAZIEST * bright:
        return False
    square = np.ones((3, 3), np.uint8)
    step = cv2.dilate(cells, square) - cv2.erode(cells, square)
    within = (cells < 0.5 * (dark + bright)).astype(np.uint8)
    edge = cv2.morphologyEx(within, cv2.MORPH_GRADIENT, square) > 0
    return bool(edge.any() and np.median(step[edge]) > SHARP * (bright - dark))


def _edgeless_regions(cells, seed_level):
    """Label regions without edges between neighbours; and which labels hold seeds."""
    cross = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))
    steep = cv2.dilate(cells, cross) > EDGE_RATIO * np.maximum(cv2.erode(cells, cross), 1.0)
    square = np.ones((3, 3), np.uint8)
    even = cv2.morphologyEx((~steep).astype(np.uint8), cv2.MORPH_OPEN, square)
    _, labels = cv2.connectedComponents(even, connectivity=4)
    return labels, np.setdiff1d(labels[cells > seed_level], 0)


def _any_of(labels, chosen):
    """Mask of the pixels with one of the chosen labels; faster than np.isin."""
    keep = np.zeros(labels.max() + 1, bool)
    keep[chosen] = True
    return keep[labels]


def spread(cells, known, reach):
    """Smooth known cells and carry their values on into the unknown ones.

    `reach` (SD, in cells): where there are known cells so near, farther ones hardly count.
    """
    weight = known.astype(np.float32)
    out, trust = np.zeros_like(cells), np.zeros_like(cells)
    for scale in (1.0, 3.0, 9.0, 27.0):
        total = cv2.GaussianBlur(weight, (0, 0), reach * scale) + 1e-12
        mean = cv2.GaussianBlur(cells * weight, (0, 0), reach * scale) / total
        share = (1 - trust) * np.minimum(total / 0.1, 1)
        out, trust = out + share * mean, trust + share
    return (out / np.maximum(trust, 1e-6)).astype(np.float32)
