"""The pole: a round dark disc seen end on, found and measured by itself, watched over time."""

from dataclasses import dataclass

import cv2
import numpy as np
from scipy.optimize import least_squares
from scipy.special import erfc

from pipeline.records import PoleTrack

RADIUS_RANGE = (0.7, 1.45)  # of the expected radius: the scale may be a little off
RADIUS_TRUST = 0.05  # SD of the expected radius, relative: counts only where little edge is free
PIXEL_SD = 0.015  # of a pixel's misfit, share of the light: weighs the expected radius
N_RAYS = 180
LEAST_FITTED_ARC = 0.15  # of the circumference must be free of any shade
COMFORTABLE_ARC = 0.38  # this much is enough to measure a circle well
MARGIN_RAYS = 14  # of 2°, left out beside rays that are shaded
TOUCHED_RAYS = 45  # at most, between the shades on both sides of where a whisker touches
SHADE_RAYS, WIDEST_SHADE_RAYS = 3, 45  # that a whisker shades on either side; a rod, more
MUCH_BETTER = 0.2  # part of the cost of a fit to more of the edge, for one to less of it
ROD_ARC = 0.65  # is seen where a rod hides the rest; more makes no likelier pole
LEAST_ARC = 0.55  # of the circumference must be seen as edge: a corner has 0.5, a rod's end 0.65
MOST_RESIDUAL = 0.05  # of the edge's contrast, root mean square
MISFITS = 0.1  # of the edge's pixels
LEAST_CONTRAST = 0.2  # share of the light that the disc takes
OPAQUE, GREY_ARC = 0.8, 0.3  # what takes less light must show so much of its edge: fur does not
LEAST_SHADE = 0.08  # the same, where a person says that there is a pole
RADIUS_SPREAD = 0.15  # SD of a pole's radius about the expected one, relative, in its score
RIVAL = 0.5  # of the best rough score: what has more may be the pole when measured exactly
SURE = 0.45  # likeness; an opaque disc on a rod has 0.6, sharp dust of its size 0.25
EDGE_SLOPE = 0.04  # of the light per pixel: less is no edge of a thing in focus
INTERPOLATION = 0.003  # error of interpolated pixels, share of the light


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


def find_pole(
    transmission, radius_px: float, near_xy=None, exclude=None, passed_over=None
) -> Pole | None:
    """Find a dark disc of about the given radius, to a few hundredths of a pixel.

    Parameters
    ----------
    transmission : float32 (height, width), share of the light that passes
    radius_px : expected radius [px]
    near_xy : (x, y) or None; where a person says that the pole is
    exclude : bool (height, width) or None; where it is not (the face)
    passed_over : function of x, y, radius, or None; whether whiskers pass over a disc: then any
        other disc is rather the pole

    Returns
    -------
    Pole, or None where no disc with at least 55 % of its edge in view is seen. Where a person
    says that there is one, a darker place is enough; what cannot be measured of it is believed.
    """
    if not radius_px > 0:
        raise ValueError(f"radius_px must be > 0, got {radius_px!r}")
    image = np.asarray(transmission, np.float32)
    rough = []
    for x, y in _candidates(image, radius_px, near_xy, exclude):
        circle = _rough_circle(image, x, y, radius_px)
        if circle is not None and _plausible(circle[:3], radius_px, near_xy):
            rough.append(circle)
    found = _first_firm(_likeliest_first(image, rough, radius_px), passed_over)
    shade = 0.0 if near_xy is None else _shade(image, *near_xy, radius_px)
    if found is None and shade > LEAST_SHADE:
        return Pole(*map(float, near_xy), float(radius_px), 1.0, 0.0, np.nan, shade)
    return found


def _likeliest_first(image, rough, radius_px):
    """Yield the discs that can be measured, likeliest first; `rough` as of `_rough_circle`.

    Where one of them is surely a pole, circles of much less score are measured only when those
    above are used up.
    """
    rivals, seen, best, sure = [], [], 0.0, False
    for x, y, radius, score in sorted(rough, key=lambda circle: -circle[3]):
        if sure and score < RIVAL * best:
            yield from (pole for _, pole in sorted(rivals, key=lambda each: -each[0]))
            rivals, best, sure = [], 0.0, False
        if any(np.hypot(x - pole.x_px, y - pole.y_px) < pole.radius_px for pole in seen):
            continue
        pole = measure_disc(image, x, y, radius, radius_px)
        if pole is not None:
            likeness = _likeness(pole, radius_px)
            best, sure = max(best, score), sure or likeness > SURE
            rivals.append((likeness, pole))
            seen.append(pole)
    yield from (pole for _, pole in sorted(rivals, key=lambda each: -each[0]))


def _likeness(pole, radius_px):
    """How much a measured disc is like a pole's end: round, opaque, of the expected radius.

    Dust is paler, and of any size.
    """
    off = (pole.radius_px / radius_px - 1) / RADIUS_SPREAD
    edge = min(pole.arc, ROD_ARC) * (1 - 4 * pole.residual)
    return edge * pole.opacity**4 * np.exp(-0.5 * off**2)


def _first_firm(poles, passed_over):
    """First of the `poles` that whiskers do not pass over; else the first, None without any."""
    first = None
    for pole in poles:
        if passed_over is None or not passed_over(pole.x_px, pole.y_px, pole.radius_px):
            return pole
        first = first or pole
    return first


def _shade(image, x, y, radius_px):
    """Share of the light around (x, y) that a disc there takes."""
    inside = _disc(image.shape, x, y, 0.8 * radius_px)
    around = _disc(image.shape, x, y, 2 * radius_px) & ~_disc(image.shape, x, y, 1.3 * radius_px)
    if not inside.any() or not around.any():
        return 0.0
    light = max(float(np.percentile(image[around], 75)), 1e-6)  # beside the rod
    return 1 - float(np.median(image[inside])) / light


def _plausible(circle, radius_px, near_xy):
    x, y, radius = circle
    low, high = RADIUS_RANGE
    near = near_xy is None or np.hypot(x - near_xy[0], y - near_xy[1]) < radius_px
    return low * radius_px <= radius <= high * radius_px and near


# ---- roughly ------------------------------------------------------------------------------


def _candidates(image, radius_px, near_xy, exclude, most=10):
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
    votes *= smooth < 1 - LEAST_CONTRAST  # a centre is dark
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
    """Circle (x, y, radius, score) through the half levels along rays from (x, y), or None.

    The score is a first guess of `_likeness`: the inside of a small pole looks paler than it is
    while the circle is a little off, as the rod makes it.
    """
    angles = _rays()
    design = np.column_stack([np.cos(angles), np.sin(angles), np.ones(N_RAYS)])
    for _ in range(3):
        edge = _half_levels(image, x, y, radius_px)
        near = (edge > 0.4 * radius_px) & (edge < RADIUS_RANGE[1] * radius_px)
        if near.mean() < LEAST_FITTED_ARC:
            return None
        # the disc is round where most rays agree; the rod and whiskers only add distance
        radius = np.percentile(edge[near], 40)
        near = _at_edge(edge, radius)
        if near.mean() < LEAST_FITTED_ARC:
            return None
        (dx, dy, radius), *_ = np.linalg.lstsq(design[near], edge[near], rcond=None)
        x, y = x + dx, y + dy
    spread = np.std(edge[near] - design[near] @ (dx, dy, radius)) / radius
    px, py = ray_points(x, y, angles, radius * np.array([0.2, 0.4, 0.6]))
    inner = cv2.remap(image, px, py, cv2.INTER_LINEAR).mean()
    off = (radius / radius_px - 1) / RADIUS_SPREAD
    score = min(near.mean(), ROD_ARC) * (1 - 4 * spread) * (1 - inner) ** 4 * np.exp(-0.5 * off**2)
    return float(x), float(y), float(radius), float(score)


def _half_levels(image, x, y, radius_px):
    """Distance from (x, y) at which each ray first reaches half the light, inf if never."""
    distances = np.arange(0.0, 1.9 * radius_px + 3, 0.5)
    px, py = ray_points(x, y, _rays(), distances)
    values = cv2.remap(image, px, py, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT)
    half = 0.5 * (values[:, 0].mean() + min(np.percentile(values[:, -1], 90), 1.0))
    above = values > half
    return np.where(above.any(1), distances[np.argmax(above, axis=1)], np.inf)


def _at_edge(edge, radius):
    """Rays on which half the light is reached about at the disc's edge, bool (N_RAYS,)."""
    return np.abs(edge - radius) < 0.12 * radius + 0.5


def _disc(shape, x, y, radius):
    rows, columns = np.ogrid[: shape[0], : shape[1]]
    return (columns - x) ** 2 + (rows - y) ** 2 <= max(radius, 0.8) ** 2


# ---- exactly ------------------------------------------------------------------------------


def measure_disc(image, x: float, y: float, radius: float, expected: float) -> Pole | None:
    """Fit a blurred disc to the free part of its edge, starting from (x, y, radius) [px].

    The edge of a disc of radius R blurred with SD σ has its half level σ²/2R inside R (to first
    order in σ/R), and falls off as erfc; both are in the model, so the radius is the disc's own.
    Rays that are shaded by the rod or by a whisker are left out in the next round; `expected`
    [px] counts where the arc that is left is too short to tell the radius.
    """
    plain, untouched = (
        _measure(image, x, y, radius, expected, touched) for touched in (False, True)
    )
    if plain is None or untouched is None:
        return plain or untouched
    much_better = _cost(untouched, expected) < MUCH_BETTER * _cost(plain, expected)
    return untouched if much_better else plain


def _cost(pole, expected):
    """Misfit of a measured disc and of its radius, in squares of their usual sizes."""
    off = (pole.radius_px / expected - 1) / RADIUS_TRUST
    return (pole.residual / PIXEL_SD) ** 2 + off**2


def _measure(image, x, y, radius, expected, touched):
    """As `measure_disc`; `touched`: also without what lies between two narrow shades."""
    angles = _rays()
    used = _free_rays(image, x, y, radius, angles)
    for _ in range(8):
        if used.mean() < LEAST_FITTED_ARC:
            return None
        fit = _fit_edge(image, x, y, radius, used, expected)
        if fit is None or not _plausible(fit[:3], expected, None):
            return None
        x, y, radius = fit[:3]
        before, used = used, _unshaded(fit, image, angles, used, touched)
        if np.array_equal(before, used):
            break
    arc = _at_edge(_half_levels(image, x, y, radius), radius).mean()
    contrast = fit[5] - fit[4]
    residual = _misfit(fit, image, before) / max(contrast, 1e-6)
    if arc < LEAST_ARC or contrast < LEAST_CONTRAST or residual > MOST_RESIDUAL:
        return None
    if contrast < OPAQUE and before.mean() < GREY_ARC:
        return None
    return Pole(*map(float, (x, y, radius, abs(fit[3]), arc, residual, _opacity(fit))))


def _opacity(p):
    """Share of the light that a fitted disc takes as far inside as it was fitted.

    The level farther in is not seen where a small disc is much blurred.
    """
    inmost = max(p[2] - _edge_width(p[2]), 0.0)
    return 1 - max(blurred_edge(inmost, p[2], abs(p[3]) + 1e-3, p[4], p[5]) / p[5], 0.0)


def _rays():
    return np.arange(N_RAYS) * 2 * np.pi / N_RAYS


def ray_points(x, y, angles, distances):
    """Points at all distances along all angles, two float32 (angles, distances)."""
    px = x + np.multiply.outer(np.cos(angles), distances)
    py = y + np.multiply.outer(np.sin(angles), distances)
    return px.astype(np.float32), py.astype(np.float32)


def _free_rays(image, x, y, radius, angles):
    """Tell along which angles the disc ends against the light, bool (angles,)."""
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


def _model(p, px, py):
    """Blurred disc: p = x, y, radius, blur, inside, outside."""
    distance = np.hypot(px - p[0], py - p[1])
    return blurred_edge(distance, p[2], abs(p[3]) + 1e-3, p[4], p[5])


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
    """Least squares of the model over the pixels around the used arc; parameters or None."""
    px, py, values = _edge_pixels(image, x, y, radius, used)

    def residuals(p):
        prior = PIXEL_SD * (p[2] - expected) / (RADIUS_TRUST * expected)
        return np.append(_model(p, px, py) - values, prior)

    if len(values) < 12:
        return None
    start = [x, y, radius, 1.0, np.quantile(values, 0.1), np.quantile(values, 0.9)]
    fit = least_squares(residuals, start, x_scale="jac", method="lm", max_nfev=200)
    return fit.x if np.isfinite(fit.x).all() and fit.x[2] > 0 else None


def _unshaded(p, image, angles, used, touched):
    """Rays on which no shade of rod or whisker falls: as light outside the edge as the lightest
    third, and no darker than the model by more than the used ones' scatter; bool (angles,).
    """
    px, py, values = _annulus(image, *p[:3], angles)
    excess = (values - _model(p, px, py))[:, values.shape[1] // 3 :].mean(1)
    beyond = p[2] + 2.5 * abs(p[3]) + np.array([0.5, 1.0, 1.5, 2.0, 2.5])
    px, py = ray_points(p[0], p[1], angles, beyond)
    light = cv2.remap(image, px, py, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT).mean(1)
    lightest = light[light >= np.quantile(light, 2 / 3)]
    shaded = light < np.median(lightest) - max(3 * lightest.std(), 3 * INTERPOLATION)
    scatter = 1.4826 * np.median(np.abs(excess[used]))
    shaded |= excess < -2.5 * max(scatter, 0.5 * INTERPOLATION)
    margin = _with_margin(shaded)
    untouched = ~(margin | _between_shades(shaded))
    return untouched if touched and untouched.mean() >= LEAST_FITTED_ARC else ~margin


def _with_margin(shaded):
    """Add the rays beside shaded ones, which may be shaded too little to show, if enough stay."""
    for steps in range(MARGIN_RAYS, 1, -1):
        wider = _widened(shaded, steps)
        if np.mean(~wider) >= COMFORTABLE_ARC:
            return wider
    return _widened(shaded, 1)


def _between_shades(shaded):
    """Rays between two narrow shades, not far apart, bool (angles,).

    Where a whisker rests on the disc, its shade joins the disc's and shows to both sides only.
    """
    between = np.zeros_like(shaded)
    starts = np.flatnonzero(shaded & ~np.roll(shaded, 1))
    ends = np.flatnonzero(~shaded & np.roll(shaded, 1))
    if len(starts) < 2:
        return between
    ends = np.roll(ends, -1) if ends[0] <= starts[0] else ends
    narrow = (ends - starts) % N_RAYS < WIDEST_SHADE_RAYS
    narrow &= (ends - starts) % N_RAYS >= SHADE_RAYS
    for k, end in enumerate(ends):
        following = (k + 1) % len(starts)
        gap = (starts[following] - end) % N_RAYS
        if narrow[k] and narrow[following] and gap <= TOUCHED_RAYS:
            between[(end + np.arange(gap)) % N_RAYS] = True
    return between


def _misfit(p, image, used):
    """Root mean square misfit, but for the MISFITS worst pixels: a hair may lie on some."""
    px, py, values = _edge_pixels(image, *p[:3], used)
    square = np.sort((values - _model(p, px, py)) ** 2)
    return float(np.sqrt(np.mean(square[: int(np.ceil((1 - MISFITS) * len(square)))])))


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

    It is in its place while its disc is dark and what is light around it has not become dark;
    a whisker may cover a part of that.
    """

    DARK_PART = 0.9  # of the disc
    LIGHT_PART = 0.6  # of the light surroundings

    def __init__(self, x_px: float, y_px: float, radius_px: float, background: np.ndarray):
        self.x_px, self.y_px, self.radius_px = x_px, y_px, radius_px
        shape = background.shape
        core = _disc(shape, x_px, y_px, max(radius_px - 1.0, 0.75 * radius_px))
        ring = _disc(shape, x_px, y_px, 1.1 * radius_px + 2.0)
        ring &= ~_disc(shape, x_px, y_px, radius_px + 1.2)
        dark = float(np.median(background[core]))
        light = float(np.percentile(background[ring], 90)) if ring.any() else 255.0
        self._limit = 0.5 * (dark + light)
        self._core = np.flatnonzero(core)
        self._ring = np.flatnonzero(ring & (background > dark + 0.8 * (light - dark)))
        self._seen = []

    def look(self, frame: np.ndarray) -> bool:
        """Look at the next frame, uint8 (height, width); True if the pole is in its place."""
        pixels = frame.ravel()
        dark = np.count_nonzero(pixels[self._core] < self._limit)
        light = np.count_nonzero(pixels[self._ring] > self._limit)
        seen = dark >= self.DARK_PART * len(self._core)
        seen = seen and light >= self.LIGHT_PART * len(self._ring)
        self._seen.append(seen)
        return seen

    def track(self) -> PoleTrack:
        """Return where the pole was in all frames looked at so far; NaN: not in its place."""
        seen = np.array(self._seen, bool)
        return PoleTrack(
            np.where(seen, self.x_px, np.nan), np.where(seen, self.y_px, np.nan), self.radius_px
        )
