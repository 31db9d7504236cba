"""Polygons in the picture: how far its points are from one, and what lies along its edge."""

import numpy as np
from numba import njit
from scipy.special import ndtr

from synthetic.scene import Scene, Shape


def distance_from_outline(scene: Scene, corners) -> np.ndarray:
    """Distance of every pixel from a polygon's edge [px], (height, width), negative inside.

    `corners` are ((x, y), …) [m], in either order.
    """
    x, y = scene.to_pixels(*np.transpose(corners))
    rows, columns = scene.camera.height, scene.camera.width
    distance = np.empty((rows, columns))
    _signed_distance(distance, x, y)
    return distance


@njit(cache=True)
def _signed_distance(distance, x, y):
    """Fill `distance` (rows, columns) with that from the polygon with corners `x`, `y` [px]."""
    for j in range(distance.shape[0]):
        for i in range(distance.shape[1]):
            least, inside = np.inf, False
            for k in range(len(x)):
                ax, ay, bx, by = x[k - 1], y[k - 1], x[k], y[k]
                dx, dy = bx - ax, by - ay
                way = ((i - ax) * dx + (j - ay) * dy) / max(dx * dx + dy * dy, 1e-12)
                way = min(max(way, 0.0), 1.0)
                least = min(least, (ax + way * dx - i) ** 2 + (ay + way * dy - j) ** 2)
                if (ay > j) != (by > j) and i < ax + (j - ay) / dy * dx:
                    inside = not inside
            distance[j, i] = -np.sqrt(least) if inside else np.sqrt(least)


def rounded(corners, times: int = 2):
    """A polygon with its corners cut `times` times, each cut a quarter of the sides (Chaikin)."""
    points = np.asarray(corners, float)
    for _ in range(times):
        after = np.roll(points, -1, axis=0)
        points = np.stack([0.75 * points + 0.25 * after, 0.25 * points + 0.75 * after], 1)
        points = points.reshape(-1, 2)
    return tuple(map(tuple, points.tolist()))


def along_outline(scene: Scene, corners):
    """Points 0.5 px apart along a polygon: x, y [px], outward normals [rad], and length [px]."""
    px, py = scene.to_pixels(*np.transpose(corners))
    px, py = np.append(px, px[0]), np.append(py, py[0])
    along = np.concatenate([[0], np.cumsum(np.hypot(np.diff(px), np.diff(py)))])
    place = np.arange(0, along[-1], 0.5)
    edge = np.searchsorted(along, place, "right") - 1
    turning = np.sum(px[:-1] * py[1:] - px[1:] * py[:-1])  # > 0: clockwise on the screen
    dx, dy = np.sign(turning) * np.diff(px)[edge], np.sign(turning) * np.diff(py)[edge]
    normal = np.arctan2(dx, dy)  # counter-clockwise on the screen, where y runs down
    return np.interp(place, along, px), np.interp(place, along, py), normal, along[-1]


def shape_transmission(scene: Scene, shape: Shape) -> np.ndarray:
    """Light that passes a shape, float32 (height, width), 0–1."""
    clear = ndtr(distance_from_outline(scene, shape.corners) / shape.blur_px)
    return (shape.transmission + (1 - shape.transmission) * clear).astype(np.float32)
