"""The face: the dark mass on one side of the picture, with its dense fur.

Whiskers come out of the mask's edge, where their hidden length ends. So it is the edge of the fur
as a whole, averaged over `fur_average_mm`, not that of single hairs.
"""

import cv2
import numpy as np

from pipeline.detection.static_scene import OUTWARD
from pipeline.scene.masks import opened_beyond_border, regions

SIDES = ("left", "right", "top", "bottom")
OPPOSITE = {"left": "right", "right": "left", "top": "bottom", "bottom": "top"}
LEAST_BORDER = 0.25  # of the longest contact with the border: what touches it less is apparatus
FEWEST_NODES = 45  # of a line whose taper can be measured
LEAST_WIDTH = 0.2  # of the picture's side: a face is wider than apparatus
THICKER = 1.2  # the far third's thickness over the near one's: of a whisker it is 0.2 to 0.6


def border(image: np.ndarray, side: str) -> np.ndarray:
    """Return the row or column of `image` along `side`."""
    if side not in SIDES:
        raise ValueError(f"side must be one of {SIDES}, got {side!r}")
    at = {"left": np.s_[:, 0], "right": np.s_[:, -1], "top": np.s_[0], "bottom": np.s_[-1]}
    return image[at[side]]


def darkest_sides(transmission: np.ndarray, params) -> list[str]:
    """Return the sides of the picture by how dark their borders are, the darkest first.

    `transmission`: share of the light that passes, (height, width), as in `Background`.
    """
    dark = {side: np.mean(border(transmission, side) < params.face_edge) for side in SIDES}
    return sorted(SIDES, key=lambda side: -dark[side])


def find_face(transmission: np.ndarray, side: str, pixels_per_mm: float, params) -> np.ndarray:
    """Return the face's mask, bool (height, width); all False where no face is in view."""
    sd = params.fur_average_mm * pixels_per_mm
    smooth = cv2.GaussianBlur(transmission, (0, 0), sd, borderType=cv2.BORDER_REPLICATE)
    dark = opened_beyond_border(smooth < params.face_edge, params.tuft_mm * pixels_per_mm)
    labels = regions(dark)
    on_border = np.bincount(border(labels, side), minlength=labels.max() + 1)
    on_border[0] = 0
    if not on_border.any():
        return np.zeros(dark.shape, bool)
    mask = (on_border >= LEAST_BORDER * on_border.max())[labels]
    return _without_holes(mask, side)


def _without_holes(mask, side):
    """Fill bright pixels that the face encloses, together with its side of the picture."""
    labels = regions(~mask)
    enclosed = np.ones(labels.max() + 1, bool)
    for other in SIDES:
        if other != side:
            enclosed[border(labels, other)] = False
    enclosed[0] = False
    return mask | enclosed[labels]


def likelier_side(
    transmission, side: str, thick_side: str | None, pixels_per_mm, params
) -> str | None:
    """Side that is likelier to have the face, if none is seen on the given `side`; None: no doubt.

    Parameters
    ----------
    transmission : share of the light that passes, (height, width)
    thick_side : where the whiskers' thicker ends are (`virtual_face.mask_behind_whiskers`)

    The whiskers of a picture without a face may come from beside a corner: without a face on the
    side of their thicker ends, only the opposite side is in doubt.
    """
    if thick_side in (None, side):
        return None
    face = find_face(transmission, thick_side, pixels_per_mm, params)
    wide = np.mean(border(face, thick_side)) > LEAST_WIDTH
    return thick_side if wide or thick_side == OPPOSITE[side] else None


def thickening_towards(templates) -> str | None:
    """Side towards which most `WhiskerTemplate`s get thicker; None: they taper."""
    towards = [side for template in templates if (side := _thickens(template.samples)) is not None]
    if 2 * len(towards) <= len(templates):
        return None
    return max(SIDES, key=towards.count)


def _thickens(lines) -> str | None:
    """Side towards which most `lines` of one whisker run if they get thicker, else None."""
    lines = [line for line in lines if line.n >= FEWEST_NODES]
    ratios = np.array([far_over_near(line.thickness[: line.n]) for line in lines])
    if not np.isfinite(ratios).any() or np.nanmedian(ratios) < THICKER:
        return None
    x, y = np.sum([line.points[-1] - line.points[0] for line in lines], axis=0)
    return min(SIDES, key=lambda side: np.dot(OUTWARD[side], (x, y)))


def far_over_near(thickness):
    """Median thickness of a line's last third over that of its first, NaN where unknown.

    NaN where the first third is no darker than what is beside it, as in fur.
    """
    third = len(thickness) // 3
    near, far = thickness[:third], thickness[-third:]
    if not (np.isfinite(near).any() and np.isfinite(far).any()):
        return np.nan
    near, far = np.nanmedian(near), np.nanmedian(far)
    return far / near if near > 0 else np.nan
