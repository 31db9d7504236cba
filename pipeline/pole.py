"""The pole: a round dark disc seen end on, found and measured by itself, watched over time."""

from dataclasses import dataclass

import cv2
import numpy as np
from scipy.optimize import least_squares
from scipy.special import erfc

from pipeline.records import PoleTrack

RADIUS_RANGE = (0.7, 1.45)  # of the expected radius: the scale may be a little off
RADIUS_TRUST = 0.05  # SD of the expected radius, relative: counts only where little edge is free
PRIOR_WEIGHT = 0.3  # of one SD, beside pixels' misfits as shares of the light
N_RAYS = 180
LEAST_ARC = 0.33  # of the circumference must be free of rod and whiskers; a corner has 0.25
MOST_RESIDUAL = 0.06  # of the edge's contrast, root mean square
LEAST_CONTRAST = 0.4  # share of the light that the disc takes
EDGE_SLOPE = 0.04  # of the light per pixel: less is no edge of a thing in focus
INTERPOLATION = 0.003  # error of interpolated pixels, share of the light


@dataclass(frozen=True)
class Pole:
    """A pole's disc: centre, radius and edge blur (SD) [px]; `arc`: share of its edge seen.

    `residual` is the root mean square misfit of the edge, as a share of its contrast.
    """

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
    Pole, or None where no disc with a third of its edge free is seen.
    """
    if not radius_px > 0:
        raise ValueError(f"radius_px must be > 0, got {radius_px!r}")
    image = np.asarray(transmission, np.float32)
    rough = []
    for x, y in _candidates(image, radius_px, near_xy, exclude):
        circle = _rough_circle(image, x, y, radius_px)
        if circle is not None and _plausible(circle[:3], radius_px, near_xy):
            rough.append(circle)
    rough.sort(key=lambda circle: -circle[3])
    measured = (measure_disc(image, *circle[:3], radius_px) for circle in rough)
    return next((pole for pole in measured if pole is not None), None)


def _plausible(circle, radius_px, near_xy):
    x, y, radius = circle
    low, high = RADIUS_RANGE
    near = near_xy is None or np.hypot(x - near_xy[0], y - near_xy[1]) < radius_px
    return low * radius_px <= radius <= high * radius_px and near


# ---- roughly ------------------------------------------------------------------------------


def _candidates(image, radius_px, near_xy, exclude, most=6):
    """Yield (x, y) where the edges' gradients point away from a common dark centre."""
    smooth = cv2.GaussianBlur(image, (0, 0), 0.8)
    gx = cv2.Sobel(smooth, cv2.CV_32F, 1, 0, scale=1 / 8)
    gy = cv2.Sobel(smooth, cv2.CV_32F, 0, 1, scale=1 / 8)
    slope = cv2.magnitude(gx, gy)
    edge = slope > EDGE_SLOPE
    if exclude is not None:
        edge &= ~exclude
    if near_xy is not None:
        rows, columns = np.ogrid[: image.shape[0], : image.shape[1]]
        edge &= np.hypot(columns - near_xy[0], rows - near_xy[1]) < 2.5 * radius_px
    y, x = np.nonzero(edge)
    strength = slope[y, x]
    votes = _votes(
        image.shape, x, y, gx[y, x] / strength, gy[y, x] / strength, strength, radius_px
    )
    votes *= smooth < 0.5  # a centre is dark
    for _ in range(most):
        _, peak, _, (px, py) = cv2.minMaxLoc(votes)
        if peak <= 0:
            return
        yield float(px), float(py)
        cv2.circle(votes, (px, py), max(int(0.7 * radius_px), 1), 0.0, -1)


def _votes(shape, x, y, ux, uy, strength, radius_px):
    """Votes of the gradients for the centres of discs of all allowed radii."""
    radii = np.arange(RADIUS_RANGE[0], RADIUS_RANGE[1], 0.1)[:, None] * radius_px
    columns = np.rint(x - radii * ux).astype(np.int64)
    rows = np.rint(y - radii * uy).astype(np.int64)
    inside = (columns >= 0) & (columns < shape[1]) & (rows >= 0) & (rows < shape[0])
    weight = np.broadcast_to(strength, inside.shape)[inside]
    flat = np.bincount(rows[inside] * shape[1] + columns[inside], weight, shape[0] * shape[1])
    votes = flat.reshape(shape).astype(np.float32)
    return cv2.GaussianBlur(votes, (0, 0), max(0.12 * radius_px, 1.0))


def _rough_circle(image, x, y, radius_px):
    """Circle (x, y, radius, score) through the half levels along rays from (x, y), or None."""
    angles, distances = _rays(), np.arange(0.0, 1.9 * radius_px + 3, 0.5)
    for _ in range(4):
        px, py = _ray_points(x, y, angles, distances)
        values = cv2.remap(image, px, py, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT)
        half = 0.5 * (values[:, 0].mean() + min(np.percentile(values[:, -1], 90), 1.0))
        above = values > half
        first = np.argmax(above, axis=1)
        edge = np.where(above.any(1), distances[first], np.inf)
        near = (edge > 0.4 * radius_px) & (edge < RADIUS_RANGE[1] * radius_px)
        if near.mean() < LEAST_ARC:
            return None
        # the disc is round where most rays agree; the rod and whiskers only add distance
        radius = np.percentile(edge[near], 40)
        near &= np.abs(edge - radius) < 0.2 * radius_px + 0.5
        if near.mean() < LEAST_ARC:
            return None
        design = np.column_stack([np.cos(angles), np.sin(angles), np.ones(N_RAYS)])[near]
        (dx, dy, radius), *_ = np.linalg.lstsq(design, edge[near], rcond=None)
        x, y = x + dx, y + dy
    spread = np.std(edge[near] - design @ (dx, dy, radius)) / radius
    inner = np.mean(image[_disc(image.shape, x, y, 0.6 * radius)])
    score = near.mean() * (1 - 4 * spread) * (1 - 2 * inner)
    return float(x), float(y), float(radius), float(score)


def _disc(shape, x, y, radius):
    rows, columns = np.ogrid[: shape[0], : shape[1]]
    return (columns - x) ** 2 + (rows - y) ** 2 <= max(radius, 0.8) ** 2


# ---- exactly ------------------------------------------------------------------------------


def measure_disc(image, x: float, y: float, radius: float, expected: float) -> Pole | None:
    """Fit a blurred disc to the free part of its edge, starting from (x, y, radius) [px].

    The edge of a disc of radius R blurred with SD σ has its half level σ²/2R inside R (to first
    order in σ/R), and falls off as erfc; both are in the model, so the radius is the disc's own.
    Rays that turn out darker than the model (rod, whiskers) are left out in the next round;
    `expected` [px] counts where the free arc is too short to tell the radius.
    """
    angles = _rays()
    kept = np.ones(N_RAYS, bool)
    for _ in range(8):
        free = _free_rays(image, x, y, radius, angles) & kept
        if free.mean() < LEAST_ARC:
            return None
        fit = _fit_edge(image, x, y, radius, angles[free], expected)
        if fit is None or not _plausible(fit[:3], expected, None):
            return None
        x, y, radius = fit[:3]
        before, kept = kept, _as_light_as(fit, image, angles, free)
        if np.array_equal(before, kept):
            break
    contrast = fit[5] - fit[4]
    residual = _misfit(fit, image, angles[free]) / max(contrast, 1e-6)
    if contrast < LEAST_CONTRAST or residual > MOST_RESIDUAL:
        return None
    return Pole(*map(float, (x, y, radius, abs(fit[3]), free.mean(), residual)))


def _rays():
    return np.arange(N_RAYS) * 2 * np.pi / N_RAYS


def _ray_points(x, y, angles, distances):
    """Points at all distances along all angles, two float32 (angles, distances)."""
    px = x + np.multiply.outer(np.cos(angles), distances)
    py = y + np.multiply.outer(np.sin(angles), distances)
    return px.astype(np.float32), py.astype(np.float32)


def _free_rays(image, x, y, radius, angles):
    """Tell along which angles the disc ends against the light, bool (angles,)."""
    width = max(0.25 * radius, 2.0)
    px, py = _ray_points(x, y, angles, radius + width * np.array([1.0, 1.25, 1.5, 2.0]))
    outside = cv2.remap(image, px, py, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT).min(1)
    free = outside > 0.85 * min(np.percentile(outside, 90), 1.0)
    return ~_widened(~free, 3)


def _widened(flags, steps):
    """Set the neighbours of True on a ring as well."""
    return np.any([np.roll(flags, k) for k in range(-steps, steps + 1)], axis=0)


def _annulus(image, x, y, radius, angles):
    """Pixel values around the edge: points px, py and values, each (angles, distances)."""
    width = max(0.3 * radius, 2.5)
    px, py = _ray_points(x, y, angles, np.arange(-width, width + 0.25, 0.5) + radius)
    return px, py, cv2.remap(image, px, py, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)


def _model(p, px, py):
    """Blurred disc: p = x, y, radius, blur, inside, outside."""
    distance = np.hypot(px - p[0], py - p[1])
    return blurred_edge(distance, p[2], abs(p[3]) + 1e-3, p[4], p[5])


def _fit_edge(image, x, y, radius, angles, expected):
    """Least squares of the model over the annulus around the free arc; parameters or None."""
    px, py, values = _annulus(image, x, y, radius, angles)

    def residuals(p):
        prior = PRIOR_WEIGHT * (p[2] - expected) / (RADIUS_TRUST * expected)
        return np.append((_model(p, px, py) - values).ravel(), prior)

    start = [x, y, radius, 1.0, values[:, 0].mean(), values[:, -1].mean()]
    fit = least_squares(residuals, start, x_scale="jac", method="lm", max_nfev=200)
    return fit.x if np.isfinite(fit.x).all() and fit.x[2] > 0 else None


def _as_light_as(p, image, angles, free):
    """Rays that are not darker than the model, by more than the free ones' scatter."""
    px, py, values = _annulus(image, *p[:3], angles)
    excess = (values - _model(p, px, py))[:, values.shape[1] // 3 :].mean(1)
    scatter = 1.4826 * np.median(np.abs(excess[free]))
    return ~_widened(excess < -2.5 * max(scatter, 0.5 * INTERPOLATION), 1)


def _misfit(p, image, angles):
    px, py, values = _annulus(image, *p[:3], angles)
    return float(np.sqrt(np.mean((values - _model(p, px, py)) ** 2)))


def blurred_edge(distance, radius, blur, inside, outside):
    """Intensity at `distance` from the centre of a disc blurred with a Gaussian of SD `blur`."""
    half_level = radius - blur**2 / (2 * radius)
    return outside + (inside - outside) * 0.5 * erfc((distance - half_level) / (np.sqrt(2) * blur))


# ---- over time ----------------------------------------------------------------------------


class PoleFollower:
    """Tells frame by frame whether a pole is in its place, while a video streams by.

    Parameters
    ----------
    x_px, y_px, radius_px : the pole's disc [px]
    background : float32 (height, width), with the pole in its place
    """

    PART = 0.9  # of the disc's core must be dark

    def __init__(self, x_px: float, y_px: float, radius_px: float, background: np.ndarray):
        self.x_px, self.y_px, self.radius_px = x_px, y_px, radius_px
        core = _disc(background.shape, x_px, y_px, 0.75 * radius_px)
        around = _disc(background.shape, x_px, y_px, 2.5 * radius_px + 2)
        around &= ~_disc(background.shape, x_px, y_px, 1.3 * radius_px + 1)
        self._core = np.flatnonzero(core)
        dark = float(np.median(background[core]))
        light = float(np.percentile(background[around], 80)) if around.any() else 255.0
        self._limit = dark + 0.5 * (light - dark)
        self._seen = []

    def look(self, frame: np.ndarray) -> bool:
        """Look at the next frame, uint8 (height, width); True if the pole is in its place."""
        dark = np.count_nonzero(frame.ravel()[self._core] < self._limit)
        self._seen.append(dark >= self.PART * len(self._core))
        return self._seen[-1]

    def track(self) -> PoleTrack:
        """Return where the pole was in all frames looked at so far; NaN: not in its place."""
        seen = np.array(self._seen, bool)
        return PoleTrack(
            np.where(seen, self.x_px, np.nan), np.where(seen, self.y_px, np.nan), self.radius_px
        )
