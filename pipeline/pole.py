"""The pole: a round dark disc seen end on, found and measured by itself, watched over time."""

from dataclasses import dataclass

import cv2
import numpy as np
from scipy.optimize import least_squares
from scipy.special import erfc

RADIUS_RANGE = (0.7, 1.45)  # of the expected radius: the scale may be a little off
N_RAYS = 180
LEAST_ARC = 0.35  # of the circumference must be free of rod and whiskers
MOST_RESIDUAL = 0.12  # of the edge's contrast, root mean square


@dataclass(frozen=True)
class Pole:
    """A pole's disc: centre, radius and edge blur (SD) [px]; `arc`: share of its edge seen."""

    x_px: float
    y_px: float
    radius_px: float
    blur_px: float
    arc: float
    residual: float


def find_pole(transmission, radius_px: float, near_xy=None, exclude=None) -> Pole | None:
    """Find a dark disc of about the given radius, to a few hundredths of a pixel.

    Parameters
    ----------
    transmission : float32 (height, width), share of the light that passes
    radius_px : expected radius [px]
    near_xy : (x, y) or None; where a person says that the pole is
    exclude : bool (height, width) or None; where it is not (the face)

    Returns
    -------
    Pole, or None where no disc with at least a third of its edge free is seen.
    """
    smooth = cv2.GaussianBlur(np.asarray(transmission, np.float32), (0, 0), 0.8)
    poles = []
    for x, y, radius in _candidates(smooth, radius_px, near_xy, exclude):
        pole = measure_disc(transmission, x, y, radius)
        if pole is not None and _plausible(pole, radius_px, near_xy):
            poles.append(pole)
    return max(poles, key=_score, default=None)


def _plausible(pole, radius_px, near_xy):
    low, high = RADIUS_RANGE
    near = near_xy is None or np.hypot(pole.x_px - near_xy[0], pole.y_px - near_xy[1]) < radius_px
    return low * radius_px <= pole.radius_px <= high * radius_px and near


def _score(pole):
    """More of the edge, sharper and rounder is better."""
    return pole.arc * pole.radius_px / (pole.blur_px + 0.5) * (1 - pole.residual / MOST_RESIDUAL)


def _candidates(smooth, radius_px, near_xy, exclude, most=6):
    """Yield (x, y, radius) where the edges' gradients point away from a common centre."""
    gx = cv2.Sobel(smooth, cv2.CV_32F, 1, 0, scale=1 / 8)
    gy = cv2.Sobel(smooth, cv2.CV_32F, 0, 1, scale=1 / 8)
    slope = np.hypot(gx, gy)
    edge = slope > 0.04
    if exclude is not None:
        edge &= ~exclude
    if near_xy is not None:
        rows, columns = np.ogrid[: smooth.shape[0], : smooth.shape[1]]
        edge &= np.hypot(columns - near_xy[0], rows - near_xy[1]) < 2.5 * radius_px
    y, x = np.nonzero(edge)
    if not len(x):
        return
    ux, uy, strength = gx[y, x] / slope[y, x], gy[y, x] / slope[y, x], slope[y, x]
    found = []
    for radius in radius_px * np.arange(RADIUS_RANGE[0], RADIUS_RANGE[1] + 0.01, 0.1):
        votes = _votes(smooth.shape, x - radius * ux, y - radius * uy, strength, radius)
        votes *= smooth < 0.5  # a centre is dark
        for _ in range(3):
            _, peak, _, (px, py) = cv2.minMaxLoc(votes)
            found.append((peak, px, py, radius))
            cv2.circle(votes, (px, py), int(radius_px), 0.0, -1)
    found.sort(reverse=True)
    for peak, px, py, radius in found[:most]:
        if peak > 0:
            yield float(px), float(py), float(radius)


def _votes(shape, x, y, strength, radius):
    """Gradients' votes for a centre, per length of circumference."""
    columns, rows = np.rint(x).astype(int), np.rint(y).astype(int)
    inside = (columns >= 0) & (columns < shape[1]) & (rows >= 0) & (rows < shape[0])
    flat = np.bincount(
        rows[inside] * shape[1] + columns[inside], strength[inside], shape[0] * shape[1]
    )
    votes = flat.reshape(shape).astype(np.float32)
    return cv2.GaussianBlur(votes, (0, 0), max(0.12 * radius, 1.0)) / radius


def measure_disc(transmission, x: float, y: float, radius: float) -> Pole | None:
    """Fit a blurred disc to the free part of its edge, starting from (x, y, radius) [px].

    The edge of a disc of radius R blurred with SD σ has its half level σ²/2R inside R (to first
    order in σ/R), and falls off as erfc; both are in the model, so the radius is the disc's own.
    """
    for _ in range(4):
        free, angles = _free_arc(transmission, x, y, radius)
        if free.mean() < LEAST_ARC:
            return None
        fit = _fit_edge(transmission, x, y, radius, angles[free])
        if fit is None:
            return None
        moved = np.hypot(fit.x_px - x, fit.y_px - y) + abs(fit.radius_px - radius)
        x, y, radius = fit.x_px, fit.y_px, fit.radius_px
        if moved < 0.02:
            break
    arc = _free_arc(transmission, x, y, radius)[0].mean()
    good = arc >= LEAST_ARC and fit.residual < MOST_RESIDUAL
    return Pole(x, y, radius, fit.blur_px, float(arc), fit.residual) if good else None


def _ray_points(x, y, angles, distances):
    """Points at all distances along all angles, two float32 (angles, distances)."""
    px = x + np.multiply.outer(np.cos(angles), distances)
    py = y + np.multiply.outer(np.sin(angles), distances)
    return px.astype(np.float32), py.astype(np.float32)


def _profiles(image, x, y, angles, distances):
    px, py = _ray_points(x, y, angles, distances)
    values = cv2.remap(
        np.asarray(image, np.float32), px, py, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT
    )  # outside the picture: 0, dark
    return values


def _free_arc(image, x, y, radius):
    """Tell along which angles the disc ends against the light (bool), and the angles [rad]."""
    angles = np.arange(N_RAYS) * 2 * np.pi / N_RAYS
    width = max(0.25 * radius, 2.0)
    outside = _profiles(image, x, y, angles, radius + width * np.array([1.0, 1.25, 1.5, 2.0]))
    inside = _profiles(image, x, y, angles, (radius - width) * np.array([0.4, 0.7, 1.0]))
    clear = np.percentile(outside.min(1), 75)
    free = (outside.min(1) > 0.85 * clear) & (inside.max(1) < 0.5 * clear)
    # neighbours of a covered angle are half covered
    covered = np.convolve(np.r_[~free[-4:], ~free, ~free[:4]], np.ones(9), "same")[4:-4] > 0
    return ~covered, angles


def _fit_edge(image, x, y, radius, angles):
    """Least squares of a blurred edge over the annulus around the free arc."""
    width = max(0.3 * radius, 2.5)
    distances = np.arange(radius - width, radius + width + 0.25, 0.5)
    px, py = _ray_points(x, y, angles, distances)
    values = cv2.remap(np.asarray(image, np.float32), px, py, cv2.INTER_CUBIC)

    def model(p):
        return blurred_edge(np.hypot(px - p[0], py - p[1]), p[2], abs(p[3]), p[4], p[5])

    start = [x, y, radius, 1.0, float(values[:, 0].mean()), float(values[:, -1].mean())]
    try:
        fit = least_squares(lambda p: (model(p) - values).ravel(), start, x_scale="jac")
    except ValueError:
        return None
    contrast = fit.x[5] - fit.x[4]
    if contrast <= 0.1 or not np.isfinite(fit.x).all() or fit.x[2] <= 0:
        return None
    residual = float(np.sqrt(np.mean(fit.fun**2)) / contrast)
    return Pole(*fit.x[:3], abs(fit.x[3]), 1.0, residual)


def blurred_edge(distance, radius, blur, inside, outside):
    """Intensity at `distance` from the centre of a disc blurred with a Gaussian of SD `blur`."""
    half_level = radius - blur**2 / (2 * radius)
    return outside + (inside - outside) * 0.5 * erfc((distance - half_level) / (np.sqrt(2) * blur))
