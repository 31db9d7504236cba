"""How two views at right angles fit together, from points visible in both.

Both are taken as parallel projections: cameras far away compared with the motion. The first looks
down on the whisker, the second along the horizon. They share one horizontal axis: the position of
a point along it is visible in both. So matched points give the direction of that axis in either
picture and the second view's scale; the height is the remaining coordinate of the second view.
That the views are at right angles must be given: it does not follow from matched points, however
many.
"""

from dataclasses import dataclass

import numpy as np

from pipeline.errors import why
from pipeline.tables.calibration_columns import POINT_COLUMNS
from pipeline.tables.files import read_numbered_csv

COLUMNS = f"the columns {', '.join(column.name for column in POINT_COLUMNS)}"
FEWEST = 6
WORST_PX = 4.0  # RMS distance between matched points
LEAST_SPREAD_PX = 5.0  # SD of the points in each of the three directions


class ViewsError(ValueError):
    """Views that cannot be combined; the message says why."""


@dataclass(frozen=True)
class TwoViews:
    """Two views combined.

    Attributes
    ----------
    first_scale, second_scale : px per mm; second_se : standard error of the second
    shared : direction of the shared axis in the first picture (x right, y up)
    second_shared : likewise in the second; height is at right angles to it, upwards
    offset_mm : along the shared axis, of the second picture's origin
    angle_se : standard error of either direction [rad]
    rms_px : RMS disagreement of matched points
    """

    first_scale: float
    second_scale: float
    second_se: float
    shared: np.ndarray
    second_shared: np.ndarray
    offset_mm: float
    angle_se: float
    rms_px: float

    def along_first(self, points_px) -> np.ndarray:
        """Place along the shared axis [mm] of points (n, 2) of the first picture."""
        return upright(points_px) @ self.shared / self.first_scale

    def in_second(self, points_px) -> tuple[np.ndarray, np.ndarray]:
        """Place along the shared axis and height [mm] of points (n, 2) of the second picture."""
        up = np.array([-self.second_shared[1], self.second_shared[0]])
        up = up if up[1] > 0 else -up
        points = upright(points_px)
        along = points @ self.second_shared / self.second_scale + self.offset_mm
        return along, points @ up / self.second_scale


def upright(points_px) -> np.ndarray:
    """Points (n, 2) of a picture with y up."""
    return np.asarray(points_px, float) * (1, -1)


def read_points(path) -> np.ndarray:
    """Matched points (n, 4) of a CSV file of POINT_COLUMNS; ViewsError where it is another."""
    try:
        table, lines = read_numbered_csv(path, POINT_COLUMNS, advice="")
    except OSError as error:
        raise ViewsError(f"--points {why(error)}; give a CSV file with {COLUMNS}") from None
    except ValueError as error:
        raise ViewsError(f"--points {error}; save a table with {COLUMNS} as CSV") from None
    values = table.to_numpy(float)
    for row in np.flatnonzero(~np.isfinite(values).all(axis=1)):
        raise ViewsError(f"--points {path}: line {lines[row]}: expected four numbers")
    return values


def fit_views(points, first_scale) -> TwoViews:
    """Combine two views.

    Parameters
    ----------
    points : (n, 4) x, y in the first and in the second picture [px]
    first_scale : px per mm

    Raises
    ------
    ViewsError
        Where the points are no such table, or too few, do not spread in all directions, or do not
        match.
    """
    points = np.asarray(points, float)
    if points.shape[1:] != (4,) or not np.isfinite(points).all():
        shape = points.shape
        raise ViewsError(f"matched points: expected finite numbers (n, 4), got the shape {shape}")
    if len(points) < FEWEST:
        raise ViewsError(f"{len(points)} matched points; expected at least {FEWEST}")
    normal, spread = _plane(points)
    rms = spread[3] * np.sqrt(len(points) / (len(points) - 4))
    if rms > WORST_PX:
        without = [_plane(np.delete(points, k, axis=0))[1][3] for k in range(len(points))]
        raise ViewsError(
            f"the matched points do not match: {rms:.1f} px apart (RMS), the most in row "
            f"{np.argmin(without) + 2}; expected at most {WORST_PX:g} px. Is each row one "
            "point, seen in both views?"
        )
    if spread[2] < max(LEAST_SPREAD_PX, 4 * rms):
        raise ViewsError(
            "the matched points lie in a plane or on a line; give points at different heights and "
            "distances"
        )
    scale, angles, offset = _parts(normal, points, first_scale)
    deviations = _jackknife(points, first_scale, scale, angles)
    return TwoViews(
        first_scale, scale, deviations[0], *(np.array([np.cos(a), np.sin(a)]) for a in angles),
        offset, max(deviations[1:]), rms,
    )  # fmt: skip


def _plane(points):
    """Normal (4,) of the plane that all matched points lie in, and their SD along all axes."""
    centred = (points - points.mean(axis=0)) * (1, -1, 1, -1)
    _, size, axes = np.linalg.svd(centred, full_matrices=False)
    return axes[3], size / np.sqrt(len(points))


def _parts(normal, points, first_scale):
    """Second scale [px/mm], angle of the shared axis in both pictures [rad], offset [mm]."""
    first, second = normal[:2], -normal[2:]
    lengths = np.hypot(*first), np.hypot(*second)
    if min(lengths) < 1e-3 * max(lengths):
        raise ViewsError(
            "one view does not show where the points lie in the other; do they match?"
        )
    sign = 1 if first[np.abs(first).argmax()] > 0 else -1
    shared, second_shared = sign * first / lengths[0], sign * second / lengths[1]
    scale = first_scale * lengths[0] / lengths[1]
    middle = points.mean(axis=0)
    offset = (
        upright(middle[:2]) @ shared / first_scale - upright(middle[2:]) @ second_shared / scale
    )
    return scale, [np.arctan2(each[1], each[0]) for each in (shared, second_shared)], offset


def _jackknife(points, first_scale, scale, angles):
    """Standard errors of scale and angles, by leaving out each point in turn."""
    n, parts = len(points), []
    for k in range(n):
        kept = np.delete(points, k, axis=0)
        other, turned, _ = _parts(_plane(kept)[0], kept, first_scale)
        off = [np.angle(np.exp(1j * (a - b))) for a, b in zip(turned, angles, strict=True)]
        parts.append([other - scale, *off])
    return np.sqrt((n - 1) / n * np.sum(np.square(parts), axis=0))
