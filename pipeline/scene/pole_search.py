"""The pole: a round dark disc seen end on, found, measured, and checked over time."""

from itertools import filterfalse

import cv2
import numpy as np

from pipeline.scene.circle_fit import (
    EDGE_SLOPE,
    LEAST_CONTRAST,
    LEAST_FITTED_ARC,
    N_RAYS,
    RADIUS_RANGE,
    Pole,
    at_edge,
    half_levels,
    measure_disc,
    plausible,
    ray_points,
    rays,
)

ROD_ARC = 0.65  # is seen where a rod hides the rest; more makes no likelier pole
LEAST_SHADE = 0.08  # the same, where a person says that there is a pole
RADIUS_SPREAD = 0.15  # SD of a pole's radius about the expected one, relative, in its score
RIVAL = 0.5  # of the best score, or likeness: what has more may be the pole after all
MOST_CANDIDATES = 10  # rough places in one picture
SURE = 0.45  # likeness; an opaque disc on a rod has 0.6, sharp dust of its size 0.25
DUST = 0.35  # likeness: less may be dust, if whiskers pass over it


def find_pole(
    transmission, radius_px: float, near_xy=None, exclude=None, passed_over=None, refused=None
) -> Pole | None:
    """Find a dark disc of about the given radius, to a few hundredths of a pixel.

    Parameters
    ----------
    transmission : float32 (height, width), share of the light that passes
    radius_px : expected radius [px]
    near_xy : (x, y) or None; place of the pole in session.toml
    exclude : bool (height, width) or None; where it is not (the face)
    passed_over : function of x, y, radius, or None; whether whiskers pass over a disc: then
        another one is the pole, if it is at least half as like one
    refused : function of a Pole, or None; whether a disc is no pole, where no person says so

    Returns
    -------
    Pole, or None where no disc is seen with at least 55 % of its edge in view. Where `near_xy` is
    given, it is enough that this place is darker, and the expected radius stands for one that
    cannot be measured.
    """
    if not radius_px > 0:
        raise ValueError(f"radius_px must be > 0, got {radius_px!r}")
    image = np.asarray(transmission, np.float32)
    rough = []
    for x, y in _candidates(image, radius_px, near_xy, exclude):
        circle = _rough_circle(image, x, y, radius_px)
        if circle is not None and plausible(circle[:3], radius_px, near_xy):
            rough.append(circle)
    poles = _likeliest_first(image, rough, radius_px)
    if near_xy is None and refused is not None:
        poles = filterfalse(refused, poles)
    found = _first_firm(poles, passed_over)
    shade = 0.0 if near_xy is None else _shade(image, *near_xy, radius_px)
    if found is None and shade > LEAST_SHADE:
        return Pole(*map(float, near_xy), float(radius_px), 1.0, 0.0, np.nan, shade)
    return found


def _likeliest_first(image, rough, radius_px):
    """Yield the discs that can be measured, likeliest first; `rough` as in `_rough_circle`.

    Circles with a much lower score than one that is surely a pole come last: they are measured
    only if those before do not suffice.
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
            off = (pole.radius_px / radius_px - 1) / RADIUS_SPREAD
            likely = likeness(pole) * np.exp(-0.5 * off**2)
            best, sure = max(best, score), sure or likely > SURE
            rivals.append((likely, pole))
            seen.append(pole)
    yield from (pole for _, pole in sorted(rivals, key=lambda each: -each[0]))


def likeness(pole) -> float:
    """How similar a measured disc is to a pole's end: round and opaque, 0 to 0.65.

    Dust is paler, and so is a place where hairs cross.
    """
    return float(min(pole.arc, ROD_ARC) * (1 - 4 * pole.residual) * pole.opacity**4)


def _first_firm(poles, passed_over):
    """First of the `poles` that whiskers do not pass over, of those that are likely enough.

    Otherwise the likeliest, None without any: whiskers may pass before or behind a pole, too.
    """
    likeliest = None
    for pole in poles:
        likeliest = likeliest or pole
        if likeness(pole) < RIVAL * likeness(likeliest):
            continue
        if passed_over is None or not passed_over(pole.x_px, pole.y_px, pole.radius_px):
            return pole
    return likeliest


def _shade(image, x, y, radius_px):
    """Share of the light around (x, y) that a disc there takes."""
    inside = _disc(image.shape, x, y, 0.8 * radius_px)
    around = _disc(image.shape, x, y, 2 * radius_px) & ~_disc(image.shape, x, y, 1.3 * radius_px)
    if not inside.any() or not around.any():
        return 0.0
    light = max(float(np.percentile(image[around], 75)), 1e-6)  # beside the rod
    return 1 - float(np.median(image[inside])) / light


# ---- roughly ------------------------------------------------------------------------------


def _candidates(image, radius_px, near_xy, exclude):
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
    hough = _hough(
        image.shape, x, y, gx[y, x] / strength, gy[y, x] / strength, strength, radius_px
    )
    hough *= smooth < 1 - LEAST_CONTRAST  # a centre is dark
    for _ in range(MOST_CANDIDATES):
        _, peak, _, (px, py) = cv2.minMaxLoc(hough)
        if peak <= 0:
            return
        yield float(px), float(py)
        cv2.circle(hough, (px, py), max(int(0.7 * radius_px), 1), 0.0, -1)


def _hough(shape, x, y, ux, uy, strength, radius_px):
    """Hough transform: gradients summed up at the centres of discs of all allowed radii."""
    radii = np.arange(RADIUS_RANGE[0], RADIUS_RANGE[1], 0.1)[:, None] * radius_px
    columns = np.rint(x - radii * ux).astype(np.int64)
    rows = np.rint(y - radii * uy).astype(np.int64)
    inside = (columns >= 0) & (columns < shape[1]) & (rows >= 0) & (rows < shape[0])
    weight = np.broadcast_to(strength, inside.shape)[inside]
    flat = np.bincount(rows[inside] * shape[1] + columns[inside], weight, shape[0] * shape[1])
    hough = flat.reshape(shape).astype(np.float32)
    return cv2.GaussianBlur(hough, (0, 0), max(0.12 * radius_px, 1.0))


def _rough_circle(image, x, y, radius_px):
    """Circle (x, y, radius, score) through the half levels along rays from (x, y), or None.

    The score is a first guess of the likeness, less for another radius. It is no more than that,
    since the rod shifts the circle a little, and a small pole then looks too pale.
    """
    angles = rays()
    design = np.column_stack([np.cos(angles), np.sin(angles), np.ones(N_RAYS)])
    for _ in range(3):
        edge = half_levels(image, x, y, radius_px)
        near = (edge > 0.4 * radius_px) & (edge < RADIUS_RANGE[1] * radius_px)
        if near.mean() < LEAST_FITTED_ARC:
            return None
        # the disc is round where most rays agree; the rod and whiskers only add distance
        radius = np.percentile(edge[near], 40)
        near = at_edge(edge, radius)
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


def _disc(shape, x, y, radius):
    rows, columns = np.ogrid[: shape[0], : shape[1]]
    return (columns - x) ** 2 + (rows - y) ** 2 <= max(radius, 0.8) ** 2


# ---- over time ----------------------------------------------------------------------------


class PoleCheck:
    """Checks frame by frame whether a pole is in its place.

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

    def in_place(self, frame: np.ndarray) -> bool:
        """Whether the pole is in its place in a frame, uint8 (height, width)."""
        pixels = frame.ravel()
        dark = np.count_nonzero(pixels[self._core] < self._limit)
        light = np.count_nonzero(pixels[self._ring] > self._limit)
        enough = dark >= self.DARK_PART * len(self._core)
        return enough and light >= self.LIGHT_PART * len(self._ring)
