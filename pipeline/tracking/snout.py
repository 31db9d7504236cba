"""Which end of a row of whiskers is at the snout: given, or else where whiskers get thinner.

In a single video the two ends differ by little: in the next one the other end may be taken for the
snout's, and all names change. So `init` writes what it finds in most videos, and `run` uses that.
"""

import numpy as np

LEAST_CHANGE = 0.02  # of the mean thickness, from whisker to whisker: else lengths are compared
BASE_PX = 10  # of a line, where fur may thicken it


def anterior_first(templates, snout: str | None) -> list:
    """Reorder `WhiskerTemplate`s from the snout on; they come in order down or to the right.

    snout : the picture's side that the snout is nearest to; None: where whiskers are thinner
    """
    backwards = thins_out(templates) if snout is None else snout in ("bottom", "right")
    return templates[::-1] if backwards else templates


def snout_of(templates, face_side: str) -> str | None:
    """Side of the picture nearest to the snout, from templates ordered from the snout on.

    None where there are fewer than two. face_side : side of the picture with the face
    """
    if len(templates) < 2:
        return None
    along = int(face_side in ("left", "right"))  # of x and y
    before, after = (("left", "right"), ("top", "bottom"))[along]
    return before if templates[-1].base_xy[along] > templates[0].base_xy[along] else after


def thins_out(templates) -> bool:
    """Whether whiskers get thinner, or else shorter, in their order along the face.

    They do towards the snout. Thickness is more reliable than length: the border may cut lines.
    """
    lengths = np.array([template.visible_px for template in templates])
    thickness = np.array([_thickness(template.samples) for template in templates])
    for values, least in ((thickness, LEAST_CHANGE), (lengths, 0.0)):
        known = np.flatnonzero(np.isfinite(values))
        if len(known) > 1:
            slope = np.polyfit(known, values[known], 1)[0]
            if abs(slope) > least * np.mean(values[known]):
                return bool(slope < 0)
    return False


def _thickness(lines) -> float:
    """Median thickness of a whisker's lines in their proximal third [px], NaN where not known."""
    parts = [line.thickness[BASE_PX : line.n // 3] for line in lines]
    known = [np.median(part[np.isfinite(part)]) for part in parts if np.isfinite(part).any()]
    return float(np.median(known)) if known else np.nan
