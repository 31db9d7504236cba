"""Whether the face is where a person says: whiskers are thickest where they come out of it.

A line that is followed from the wrong end has its base where the tip is, and every force that is
told of it is nonsense.
"""

import numpy as np

from pipeline.face import SIDES, border, find_face

OPPOSITE = {"left": "right", "right": "left", "top": "bottom", "bottom": "top"}
INWARD = {"left": (1, 0), "right": (-1, 0), "top": (0, 1), "bottom": (0, -1)}  # x, y
FEWEST_NODES = 45  # of a line that tells its taper
LEAST_WIDTH = 0.2  # of the picture's side: a face is wider than apparatus
THICKER = 1.2  # the far third's thickness over the near one's: of a whisker it is 0.2 to 0.6


def likelier_side(transmission, side: str, thick_side: str | None, pixels_per_mm) -> str | None:
    """Side on which the face rather is, where none is seen on the given `side`; None: no doubt.

    Parameters
    ----------
    transmission : share of the light that passes, (height, width)
    thick_side : where the whiskers' thicker ends are (`faceless.mask_behind_whiskers`)

    The whiskers of a picture without a face may come from beside a corner: without a face on the
    side of their thicker ends, only the opposite side is in doubt.
    """
    if thick_side in (None, side):
        return None
    face = find_face(transmission, thick_side, pixels_per_mm)
    wide = np.mean(border(face, thick_side)) > LEAST_WIDTH
    return thick_side if wide or thick_side == OPPOSITE[side] else None


def thickening_towards(roster) -> str | None:
    """Side towards which most whiskers of a roster (`Slot`s) get thicker; None: they taper."""
    towards = [side for slot in roster if (side := _thickens(slot.samples)) is not None]
    if 2 * len(towards) <= len(roster):
        return None
    return max(SIDES, key=towards.count)


def _thickens(lines) -> str | None:
    """Side towards which most `lines` of one whisker run if they get thicker, else None."""
    lines = [line for line in lines if line.n >= FEWEST_NODES]
    ratios = np.array([_far_over_near(line.thickness[: line.n]) for line in lines])
    if not np.isfinite(ratios).any() or np.nanmedian(ratios) < THICKER:
        return None
    x, y = np.sum([line.points[-1] - line.points[0] for line in lines], axis=0)
    return min(SIDES, key=lambda side: np.dot(INWARD[side], (x, y)))


def _far_over_near(thickness):
    """Median thickness of a line's last third over that of its first, NaN where unknown."""
    third = len(thickness) // 3
    near, far = thickness[:third], thickness[-third:]
    known = np.isfinite(near).any() and np.isfinite(far).any()
    return np.nanmedian(far) / np.nanmedian(near) if known else np.nan


def face_message(scenes, roster, side: str) -> str | None:
    """What to tell of the face's given `side` where video and whiskers speak against it, or None.

    Parameters
    ----------
    scenes : the video's `StaticScene`s
    roster : its whiskers, `Slot`s
    """
    other = thickening_towards(roster) or next(
        (scene.likelier_side for scene in scenes if scene.likelier_side), None
    )
    if other in (None, side):
        return None
    return (
        f'[recording] face = "{side}", but the whiskers are thicker towards the {other}: if the '
        f'face is there, write face = "{other}" and run again; forces are wrong else'
    )
