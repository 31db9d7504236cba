"""A whisker in space from its lines in two views: elevation, path lengths, and its own plane.

Each point of the first view's line gets the height that the second view's line has at the same
place along the shared axis. Unrolled along the horizontal normal, so that its rise counts as
length, the whisker lies in its own plane, in which the force of an upright pole bends it.
"""

from dataclasses import dataclass

import numpy as np

from pipeline.calibrate.two_views import TwoViews, upright
from pipeline.numerics.polyline import arc_along

DEGREE = 3  # of the height along the shared axis
LEAST_RANGE_MM = 2.0  # along the shared axis, that both lines show
CORRELATED_PX = 8.0  # along a line, of its errors
BASE_MM = 2.0  # from whose slope it is continued towards the follicle
CAMERA_SE = np.deg2rad(0.5)  # of the right angle between the views


@dataclass(frozen=True)
class SpaceLine:
    """A whisker in one frame.

    Attributes
    ----------
    first : (n, 2) its line in the first picture [px], with the follicle before it
    height : (n,) [mm] above the follicle
    slope_se : standard error of a slope of the height [rad]
    """

    first: np.ndarray
    height: np.ndarray
    slope_se: float


def space_line(views: TwoViews, first, second, follicle) -> SpaceLine | None:
    """Combine a whisker's lines of one frame; None where they share too little of the whisker.

    Parameters
    ----------
    first, second : (n, 2), (m, 2) lines in the two pictures [px], follicle side → tip
    follicle : x, y in the first picture [px]
    """
    along = views.along_first(first)
    other, height = views.in_second(second)
    low, high = other.min(), other.max()
    common = min(along.max(), high) - max(along.min(), low)
    if common < LEAST_RANGE_MM or len(second) <= DEGREE + 2:
        return None
    half = (high - low) / 2
    curve = np.polynomial.Polynomial.fit(other, height, DEGREE, domain=[low, high])
    left = height - curve(other)
    freedom = max(len(other) / CORRELATED_PX - DEGREE - 1, 1.0)
    noise = np.sqrt(np.mean(left**2) * (1 + (DEGREE + 1) / freedom))
    slope_se = 2 * noise * np.sqrt(3) / (half * np.sqrt(freedom))  # 2: continued to the follicle
    joined = np.vstack([follicle, first])
    place = views.along_first(joined)
    heights = _continued(curve, place, low, high)
    return SpaceLine(joined, heights - heights[0], float(np.hypot(slope_se, views.angle_se)))


def _continued(curve, place, low, high):
    """A curve within its range, extended straight beyond it, with its slope over BASE_MM."""
    inside = np.clip(place, low, high)
    value = curve(inside)
    for end, inner in ((low, low + BASE_MM), (high, high - BASE_MM)):
        slope = (curve(inner) - curve(end)) / (inner - end)
        beyond = place < low if end == low else place > high
        value = np.where(beyond, curve(end) + slope * (place - end), value)
    return value


def path_row(line: SpaceLine, apparent_px, scale) -> dict:
    """The path to a contact `apparent_px` from the follicle along the first view's line.

    The columns that VIEW_FRAME_COLUMNS and VIEW_CONTACT_COLUMNS share, by name.
    """
    arc = arc_along(line.first)
    at = np.append(arc[arc < apparent_px], min(apparent_px, arc[-1]))
    x, y = (np.interp(at, arc, part) / scale for part in upright(line.first).T)
    z = np.interp(at, arc, line.height)
    flat = np.hypot(np.diff(x), np.diff(y))
    apparent, true = flat.sum(), np.hypot(flat, np.diff(z)).sum()
    elevation = np.arctan2(z[-1] - z[0], np.hypot(x[-1] - x[0], y[-1] - y[0]))
    slope_se = np.hypot(line.slope_se, CAMERA_SE)
    error, by_elevation = 1 - apparent / true, 1 - np.cos(elevation)  # as of a straight whisker
    error_se = np.hypot(np.sin(abs(elevation)) * slope_se, slope_se**2 / 2)
    return {
        "elevation_deg": np.rad2deg(elevation),
        "elevation_deg_se": np.rad2deg(slope_se),
        "azimuth_deg": np.rad2deg(np.arctan2(y[-1] - y[0], x[-1] - x[0])),
        "apparent_path_mm": apparent,
        "true_path_mm": true,
        "projection_error_percent": 100 * error,
        "projection_error_percent_se": 100 * error_se,
        "elevation_part_percent": 100 * by_elevation,
        "droop_part_percent": 100 * (error - by_elevation),
    }


def unroll(line: SpaceLine, pole, scale):
    """The line (n − 1, 2) [px] in the whisker's own plane, without the follicle, and the pole.

    The axis runs from follicle to pole in the first picture (without a pole, to the tip); along it
    the line is as long as in space, across it as in the picture.
    """
    origin = line.first[0]
    ahead = (line.first[-1] if pole is None else np.asarray(pole)) - origin
    ahead = ahead / np.hypot(*ahead)
    aside = np.array([-ahead[1], ahead[0]])
    along, across = (line.first - origin) @ ahead, (line.first - origin) @ aside
    step, climb = np.diff(along), np.diff(line.height) * scale
    longer = np.concatenate([[0.0], np.cumsum(np.sign(step) * np.hypot(step, climb))])
    unrolled = origin + np.outer(longer, ahead) + np.outer(across, aside)
    if pole is None:
        return unrolled[1:], None
    order, reach = np.argsort(along), (np.asarray(pole) - origin) @ ahead
    far = np.interp(reach, along[order], longer[order]) + max(reach - along.max(), 0.0)
    return unrolled[1:], origin + far * ahead
