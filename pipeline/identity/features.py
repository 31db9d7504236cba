"""What distinguishes the lines of different whiskers: a few numbers per traced line.

A direction is that from a centre behind the fur to the line, at a fixed distance from the centre.
There the line is measured well, while fur shifts its first millimetre.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit

NEAR_BEND, ANGLE, THICKNESS, LENGTH, BEND, FAR_BEND = range(6)
N_FEATURES = 6
PIECE = 6  # nodes, the least that give a direction


@dataclass(frozen=True)
class Dial:
    """How directions are measured: centre [px], directions of the face, distances (4,) [px]."""

    centre: np.ndarray
    along: np.ndarray
    outward: np.ndarray
    distances: np.ndarray

    @classmethod
    def of(cls, bases, along, outward, pixels_per_m, params) -> "Dial":
        """Behind the whiskers' bases (whiskers, 2) [px], in the directions of the face."""
        middle = np.median(np.asarray(bases, float).reshape(-1, 2), axis=0)
        along, outward = np.asarray(along, float), np.asarray(outward, float)
        behind = 1e-3 * params.centre_mm * pixels_per_m
        at = np.array([params.near_mm, params.angle_mm, params.far_mm, params.farthest_mm])
        return cls(middle - behind * outward, along, outward, 1e-3 * at * pixels_per_m)


def line_features(lines, dial: Dial) -> np.ndarray:
    """Features of every row of `Centrelines`, float64 (rows, 6), NaN where not seen.

    ANGLE is the direction [rad, 0 outward, positive along the face] of the line at the second
    distance from the dial's centre; NEAR_BEND that at the first less that, BEND and FAR_BEND the
    changes to the third and from there to the fourth; THICKNESS and LENGTH are logarithms [px].
    """
    out, thickness = np.full((len(lines), N_FEATURES), np.nan), lines.thickness_px
    if thickness is None:
        thickness = np.full_like(lines.x_px, np.nan)
    _fill(
        lines.offsets, lines.x_px, lines.y_px, thickness,
        dial.centre, dial.along, dial.outward, dial.distances, out,
    )  # fmt: skip
    return out


@njit(cache=True)
def _fill(offsets, xs, ys, thickness, centre, along, outward, distances, out):
    for row in range(len(out)):
        first, last = offsets[row], offsets[row + 1]
        n = last - first
        if n < 2 * PIECE:
            continue
        near, angle, far, farthest = _directions(
            xs[first:last], ys[first:last], centre, along, outward, distances
        )
        out[row, NEAR_BEND] = near - angle
        out[row, ANGLE] = angle
        out[row, BEND] = far - angle
        out[row, FAR_BEND] = farthest - far
        t = thickness[first + min(10, n // 2) : first + max(n // 2, min(n - 1, 30))]
        t = t[~np.isnan(t)]
        if len(t):
            out[row, THICKNESS] = np.log(max(np.median(t), 0.02))
        out[row, LENGTH] = np.log(n)


@njit(cache=True)
def _directions(x, y, centre, along, outward, distances):
    """Directions (4,) [rad] of a line at distances from the centre.

    Where the line does not reach the first two, it is extended beyond its end; the others are NaN.
    """
    out = np.full(len(distances), np.nan)
    n = len(x)
    k = 0
    before, last = 0.0, 0.0
    for i in range(n):
        u = (x[i] - centre[0]) * along[0] + (y[i] - centre[1]) * along[1]
        v = (x[i] - centre[0]) * outward[0] + (y[i] - centre[1]) * outward[1]
        r, angle = np.hypot(u, v), np.arctan2(u, v)
        while k < len(distances) and r >= distances[k]:
            if i == 0:
                out[k] = _carried_on(x, y, 0, PIECE, centre, along, outward, distances[k])
            else:
                part = (distances[k] - before) / max(r - before, 1e-9)
                out[k] = last + part * (angle - last)
            k += 1
        last, before = angle, r
    for j in range(k, 2):
        out[j] = _carried_on(x, y, n - 1, n - 1 - PIECE, centre, along, outward, distances[j])
    return out


@njit(cache=True)
def _carried_on(x, y, i, j, centre, along, outward, distance):
    """Direction at a distance before or beyond node i, on the straight line through node j."""
    ax = (x[i] - centre[0]) * along[0] + (y[i] - centre[1]) * along[1]
    ay = (x[i] - centre[0]) * outward[0] + (y[i] - centre[1]) * outward[1]
    bx = (x[j] - centre[0]) * along[0] + (y[j] - centre[1]) * along[1]
    by = (x[j] - centre[0]) * outward[0] + (y[j] - centre[1]) * outward[1]
    dx, dy = ax - bx, ay - by
    norm = max(np.hypot(dx, dy), 1e-9)
    dx, dy = dx / norm, dy / norm
    middle = ax * dx + ay * dy
    rest = ax * ax + ay * ay - middle * middle
    reach = np.sqrt(max(distance * distance - rest, 0.0))
    t = reach - middle if abs(reach - middle) < abs(-reach - middle) else -reach - middle
    return np.arctan2(ax + t * dx, ay + t * dy)
