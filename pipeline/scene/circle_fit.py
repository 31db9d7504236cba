"""Subpixel measurement of a disc that whiskers and a rod partly shade."""

from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np
from scipy.optimize import least_squares
from scipy.special import erfc

from pipeline.numerics.robust import robust_sd
from pipeline.numerics.runs import runs_around

RADIUS_SD = 0.05  # of the expected radius, relative: counts only where little edge is free
PIXEL_SD = 0.015  # of a pixel's misfit, share of the light: weighs the expected radius
N_RAYS = 180
LEAST_FITTED_ARC = 0.15  # of the circumference must be free of any shade
COMFORTABLE_ARC = 0.38  # this much is enough to measure a circle well
MARGIN_RAYS = 14  # of 2°, left out beside rays that are shaded
# that a whisker shades on either side of where it touches, or that lie between; a rod shades more
SHADE_RAYS, WIDEST_RAYS = 3, 45
EDGE_SLOPE = 0.04  # of the light per pixel: less is no edge of a thing in focus
INTERPOLATION = 0.003  # error of interpolated pixels, share of the light
RADIUS_RANGE = (0.7, 1.45)  # of the expected radius: the scale may be a little off
LEAST_ARC = 0.55  # of the circumference must be seen as edge: a corner has 0.5, a rod's end 0.65
MOST_RESIDUAL = 0.05  # of the edge's contrast, root mean square
LEAST_BLUR = 1e-3  # px
MISFITS = 0.1  # of the edge's pixels
LEAST_CONTRAST = 0.2  # share of the light that the disc takes
OPAQUE, GREY_ARC = 0.8, 0.3  # what takes less light must show so much of its edge: fur does not


@dataclass(frozen=True)
class Pole:
    """A pole's disc: centre, radius and edge blur (SD) [px]; `arc`: share of its edge seen.

    `residual` is the root mean square misfit of the edge without its worst pixels, as a share of
    its contrast; `opacity` the share of the light that it takes.
    """

    x_px: float
    y_px: float
    radius_px: float
    blur_px: float
    arc: float
    residual: float
    opacity: float


def measure_disc(image, x: float, y: float, radius: float, expected: float) -> Pole | None:
    """Fit a blurred disc to the free part of its edge, starting from (x, y, radius) [px].

    The edge of a disc of radius R blurred with SD σ has its half level σ²/2R inside R (to first
    order in σ/R), and falls off as erfc; both are in the model, so the radius is the disc's own.
    Rays that are shaded by the rod or by a whisker are left out in the next round. Where the
    visible arc is too short to measure the radius, it is held near `expected` [px]. Where no disc
    fits, a whisker may rest on it: what lies between two narrow shades is left out, too.
    """
    for touched in (False, True):
        fit, used, rests = _fit_free(image, x, y, radius, expected, touched)
        pole = None if fit is None else _pole(fit, image, used)
        if pole or not rests:
            break
    return pole


def _fit_free(image, x, y, radius, expected, touched):
    """The `Disc` of the free part of an edge, or None; the rays used; may a whisker rest on it?

    `touched`: also without what lies between two narrow shades.
    """
    angles, rests = rays(), False
    used = _free_rays(image, x, y, radius, angles)
    for _ in range(8):
        fit = _fit_edge(image, x, y, radius, used, expected)
        if fit is None or not plausible((fit.x, fit.y, fit.radius), expected, None):
            return None, used, rests
        x, y, radius = fit.x, fit.y, fit.radius
        unshaded, untouched = _unshaded(fit, image, angles, used)
        rests |= not np.array_equal(unshaded, untouched)
        before, used = used, untouched if touched else unshaded
        if np.array_equal(before, used):
            break
    return fit, before, rests


def _pole(fit, image, used) -> Pole | None:
    """A `Disc` that was fitted on the rays `used` as a pole; None where it is hardly one."""
    arc = at_edge(half_levels(image, fit.x, fit.y, fit.radius), fit.radius).mean()
    contrast = fit.outside - fit.inside
    residual = _misfit(fit, image, used) / max(contrast, 1e-6)
    if arc < LEAST_ARC or contrast < LEAST_CONTRAST or residual > MOST_RESIDUAL:
        return None
    if contrast < OPAQUE and used.mean() < GREY_ARC:
        return None
    return Pole(*map(float, (fit.x, fit.y, fit.radius, fit.blur, arc, residual, _opacity(fit))))


def _opacity(disc):
    """Share of the light that a fitted disc takes as far inside as it was fitted.

    A small and much blurred disc nowhere reaches its true darkness.
    """
    inmost = max(disc.radius - _edge_width(disc.radius), 0.0)
    return 1 - max(disc.light(disc.x + inmost, disc.y) / disc.outside, 0.0)


def rays():
    """Angles [rad] of the rays along which a disc's edge is looked for, (N_RAYS,)."""
    return np.arange(N_RAYS) * 2 * np.pi / N_RAYS


def ray_points(x, y, angles, distances):
    """Points at all distances along all angles, two float32 (angles, distances)."""
    px = x + np.multiply.outer(np.cos(angles), distances)
    py = y + np.multiply.outer(np.sin(angles), distances)
    return px.astype(np.float32), py.astype(np.float32)


def _free_rays(image, x, y, radius, angles):
    """Angles along which the disc ends against the light, bool (angles,)."""
    width = max(0.25 * radius, 2.0)
    px, py = ray_points(x, y, angles, radius + width * np.array([1.0, 1.25, 1.5]))
    outside = cv2.remap(image, px, py, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT).min(1)
    free = outside > 0.85 * min(np.percentile(outside, 90), 1.0)
    return ~_widened(~free, 3)


def _widened(flags, steps):
    """Set the neighbours of True on a ring as well."""
    ring = np.concatenate([flags[-steps:], flags, flags[:steps]])
    return np.convolve(ring, np.ones(2 * steps + 1), "valid") > 0


def _edge_width(radius):
    """How far on both sides of a disc's edge its pixels are compared with the model [px]."""
    return max(0.3 * radius, 2.5)


def _annulus(image, x, y, radius, angles):
    """Pixel values around the edge: points px, py and values, each (angles, distances)."""
    width = _edge_width(radius)
    px, py = ray_points(x, y, angles, np.arange(-width, width + 0.25, 0.5) + radius)
    return px, py, cv2.remap(image, px, py, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)


class Disc(NamedTuple):
    """A blurred disc: centre, radius and blur [px], the light inside and outside."""

    x: float
    y: float
    radius: float
    blur: float
    inside: float
    outside: float

    @classmethod
    def of(cls, parameters) -> "Disc":
        """The disc of a fit's parameters, in which the blur's sign means nothing."""
        x, y, radius, blur, inside, outside = parameters
        return cls(x, y, radius, abs(blur), inside, outside)

    def light(self, px, py):
        """The light at pixels."""
        distance = np.hypot(px - self.x, py - self.y)
        return blurred_edge(
            distance, self.radius, self.blur + LEAST_BLUR, self.inside, self.outside
        )

    def slopes(self, px, py):
        """Derivatives of the light at pixels by x, y, radius, blur, inside, outside, (n, 6)."""
        dx, dy, blur = px - self.x, py - self.y, self.blur + LEAST_BLUR
        distance = np.hypot(dx, dy)
        width = np.sqrt(2) * blur
        off = (distance - _half_level(self.radius, blur)) / width
        dark = 0.5 * erfc(off)
        steep = (self.outside - self.inside) / np.sqrt(np.pi) * np.exp(-(off**2))
        outward = steep / width / np.maximum(distance, 1e-9)
        by_radius = -steep / width * (1 + blur**2 / (2 * self.radius**2))
        by_blur = steep * (1 / (np.sqrt(2) * self.radius) - off / blur)
        each = -outward * dx, -outward * dy, by_radius, by_blur, dark, 1 - dark
        return np.column_stack(each)


def _edge_pixels(image, x, y, radius, used):
    """Pixels of the annulus around the edge that lie on used rays: x, y, values, each (n,)."""
    width = _edge_width(radius)
    reach = int(radius + width) + 2
    rows = np.arange(max(int(y) - reach, 0), min(int(y) + reach + 1, image.shape[0]))
    columns = np.arange(max(int(x) - reach, 0), min(int(x) + reach + 1, image.shape[1]))
    py, px = (grid.ravel() for grid in np.meshgrid(rows, columns, indexing="ij"))
    ray = np.rint(np.arctan2(py - y, px - x) * N_RAYS / (2 * np.pi)).astype(int) % N_RAYS
    inside = (np.abs(np.hypot(px - x, py - y) - radius) <= width) & used[ray]
    px, py = px[inside], py[inside]
    return px, py, image[py, px]


def _fit_edge(image, x, y, radius, used, expected):
    """Least squares over the pixels around the used arc: the `Disc`, or None.

    None where the arc is too short. An edge that is more blurred than the disc is large is no
    disc's.
    """
    px, py, values = _edge_pixels(image, x, y, radius, used)
    weight = PIXEL_SD / (RADIUS_SD * expected)

    def residuals(p):
        disc = Disc.of(p)
        return np.append(disc.light(px, py) - values, weight * (disc.radius - expected))

    def slopes(p):
        by = np.vstack([Disc.of(p).slopes(px, py), [0, 0, weight, 0, 0, 0]])
        by[:, 3] *= np.sign(p[3])
        return by

    if used.mean() < LEAST_FITTED_ARC or len(values) < 12:
        return None
    start = [x, y, radius, 1.0, np.quantile(values, 0.1), np.quantile(values, 0.9)]
    solved = least_squares(residuals, start, slopes, x_scale="jac", method="lm", max_nfev=50)
    fit = Disc.of(solved.x)
    return fit if np.isfinite(fit).all() and fit.radius > fit.blur else None


def _unshaded(disc, image, angles, used):
    """Rays on which no shade of rod or whisker falls: as light outside the edge as the lightest
    third, and no darker than the model by more than the used ones' scatter; bool (angles,).

    And those of them that do not lie between two narrow shades, the same where these are too few.
    """
    px, py, values = _annulus(image, disc.x, disc.y, disc.radius, angles)
    excess = (values - disc.light(px, py))[:, values.shape[1] // 3 :].mean(1)
    beyond = disc.radius + 2.5 * disc.blur + np.array([0.5, 1.0, 1.5, 2.0, 2.5])
    px, py = ray_points(disc.x, disc.y, angles, beyond)
    light = cv2.remap(image, px, py, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT).mean(1)
    lightest = light[light >= np.quantile(light, 2 / 3)]
    shaded = light < np.median(lightest) - max(3 * lightest.std(), 3 * INTERPOLATION)
    scatter = robust_sd(excess[used], about=0.0)
    shaded |= excess < -2.5 * max(scatter, 0.5 * INTERPOLATION)
    margin = _with_margin(shaded)
    untouched = ~(margin | _between_shades(shaded))
    return ~margin, untouched if untouched.mean() >= LEAST_FITTED_ARC else ~margin


def _with_margin(shaded):
    """Add the rays beside shaded ones, which may be shaded too little to show, if enough stay."""
    for steps in range(MARGIN_RAYS, 1, -1):
        wider = _widened(shaded, steps)
        if np.mean(~wider) >= COMFORTABLE_ARC:
            return wider
    return _widened(shaded, 1)


def _between_shades(shaded):
    """Rays between two narrow shades, not far apart, bool (angles,).

    Where a whisker rests on the disc, its shade merges with the disc and is seen at both sides
    only.
    """
    between = np.zeros_like(shaded)
    starts, widths = runs_around(shaded).T
    narrow = (widths >= SHADE_RAYS) & (widths < WIDEST_RAYS)
    gaps = (np.roll(starts, -1) - starts - widths) % N_RAYS
    touched = narrow & np.roll(narrow, -1) & (gaps <= WIDEST_RAYS)
    for end, gap in zip((starts + widths)[touched], gaps[touched], strict=True):
        between[(end + np.arange(gap)) % N_RAYS] = True
    return between


def _misfit(disc, image, used):
    """Root mean square misfit without the MISFITS worst pixels, where a hair may lie.

    Infinite where no pixel is in the picture.
    """
    px, py, values = _edge_pixels(image, disc.x, disc.y, disc.radius, used)
    square = np.sort((values - disc.light(px, py)) ** 2)
    kept = square[: int(np.ceil((1 - MISFITS) * len(square)))]
    return float(np.sqrt(kept.mean())) if len(kept) else np.inf


def blurred_edge(distance, radius, blur, inside, outside):
    """Intensity at `distance` from the centre of a disc blurred with a Gaussian of SD `blur`."""
    off = (distance - _half_level(radius, blur)) / (np.sqrt(2) * blur)
    return outside + (inside - outside) * 0.5 * erfc(off)


def _half_level(radius, blur):
    """Distance from the centre of a blurred disc at which half the light passes."""
    return radius - blur**2 / (2 * radius)


def plausible(circle, radius_px, near_xy) -> bool:
    """Whether a circle (x, y, radius) [px] is about as large and where it is expected."""
    x, y, radius = circle
    low, high = RADIUS_RANGE
    near = near_xy is None or np.hypot(x - near_xy[0], y - near_xy[1]) < radius_px
    return low * radius_px <= radius <= high * radius_px and near


def half_levels(image, x, y, radius_px):
    """Distance from (x, y) at which each ray first reaches half the light, inf if never."""
    distances = np.arange(0.0, 1.9 * radius_px + 3, 0.5)
    px, py = ray_points(x, y, rays(), distances)
    values = cv2.remap(image, px, py, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT)
    half = 0.5 * (values[:, 0].mean() + min(np.percentile(values[:, -1], 90), 1.0))
    above = values > half
    return np.where(above.any(1), distances[np.argmax(above, axis=1)], np.inf)


def at_edge(edge, radius):
    """Rays on which half the light is reached about at the disc's edge, bool (N_RAYS,)."""
    return np.abs(edge - radius) < 0.12 * radius + 0.5
