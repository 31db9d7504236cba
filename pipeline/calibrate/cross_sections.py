"""Cross-sections of a whisker in a micrograph: both edges, to a hundredth of a pixel.

Across a straightened whisker the grey level is that of a strip behind a Gaussian blur,

    I(u) = b0 + b1 u − C [Φ((u − c + r)/σ) − Φ((u − c − r)/σ)],

with centre c and half-width r. Where the whisker is thick, its edges lie where the grey level is
halfway; where it is as thin as the blur, only C r shows, and r follows from the contrast C of the
thick part, and is as uncertain as that. Anything more than 3 σ inside the edges, such as a bright
core, is left out.
"""

from dataclasses import dataclass, fields, replace

import numpy as np
from scipy.ndimage import map_coordinates, spline_filter
from scipy.special import ndtr

from pipeline.calibrate.find_whisker import NoWhiskerError, Trace, smooth_line
from pipeline.numerics.robust import MAD_TO_SD, column_medians, robust_sd

SECTION_PX = 10  # along the whisker that one section is the mean of
FLANK_PX = 10.0  # ground on both sides that is fitted
BEYOND_PX = 60  # beyond both ends that the straightened picture shows
KNOT_PX = 90.0  # of the centreline's spline
ROUNDS = 3  # of centreline and sections
STEPS = 14  # of Gauss–Newton
FIRST_BLUR_PX = 1.0  # as the search for the true one begins
THICK_BLURS = 2.0  # half-width from which a section shows its own contrast
CORE_BLURS = 3.0
LEAST_HALF_WIDTH_PX = 3.0  # of the thickest part
MOST_BLUR = 0.4  # of that half-width: where more, no section shows its own contrast
STRETCH = 15  # sections of the thick part that share a contrast
CONTRAST_SD = 0.02  # least scatter of the contrast along a whisker
HUBER_SDS = 2.5
LARGEST_STEP = np.array([np.inf, np.inf, np.inf, 1.0, 0.8, 0.2])  # of b0, b1, C, c, r, σ
LEAST = np.array([-np.inf, -np.inf, -np.inf, -np.inf, 0.02, 0.3])


@dataclass(frozen=True)
class Straightened:
    """The picture along a whisker's centreline.

    Attributes
    ----------
    grey : (points, across) grey levels; row k is `s[k]` px along the centreline
    s : (points,) [px], below 0 and above the line's length beyond its ends
    u : (across,) [px] from the centreline, positive to the right of its direction in the picture
    x, y : (points,) centreline [px]
    """

    grey: np.ndarray
    s: np.ndarray
    u: np.ndarray
    x: np.ndarray
    y: np.ndarray

    def place(self, s, u):
        """x, y [px] in the picture at `s` along and `u` across the centreline."""
        tx, ty = np.gradient(self.x), np.gradient(self.y)
        norm = np.hypot(tx, ty)
        x, y, nx, ny = (
            np.interp(s, self.s, part) for part in (self.x, self.y, -ty / norm, tx / norm)
        )
        return x + u * nx, y + u * ny


@dataclass(frozen=True)
class Sections:
    """Cross-sections of a whisker, each (sections,).

    Attributes
    ----------
    s : middle, along the centreline [px]
    centre : of the edges, from the centreline [px]
    half_width, half_width_se : [px]
    half_width_doubt : [px] by which all may be off together, as the thin part's contrast may be
    contrast : C that they are held to
    blur : σ [px], one number
    """

    s: np.ndarray
    centre: np.ndarray
    half_width: np.ndarray
    half_width_se: np.ndarray
    half_width_doubt: np.ndarray
    contrast: np.ndarray
    blur: float

    def __len__(self):
        return len(self.s)


def cut_sections(trace: Trace):
    """Straighten the whisker and fit its sections, centreline and edges in turn.

    Returns
    -------
    Straightened, Sections

    Raises
    ------
    NoWhiskerError
        Where the whisker is too thin in the picture for its edges to be seen.
    """
    coefficients = spline_filter(trace.image, order=3, mode="mirror").astype(np.float32)
    line = smooth_line(trace.points, KNOT_PX)
    width = 1.6 * trace.half_width + FLANK_PX + 6
    for _ in range(ROUNDS):
        straight = straighten(coefficients, line, width)
        sections = fit_sections(straight, trace.bright)
        line = _recentred(straight, sections)
    straight = straighten(coefficients, line, width)
    return straight, fit_sections(straight, trace.bright)


def straighten(coefficients, line, half_width) -> Straightened:
    """Sample a picture's cubic-spline `coefficients` along and across a line (points, 2) [px]."""
    s = np.arange(-BEYOND_PX, len(line) + BEYOND_PX).astype(float)
    ends = [_beyond(line[:40][::-1]), _beyond(line[-40:])]
    x, y = np.concatenate([ends[0][::-1], line, ends[1]]).T
    tx, ty = np.gradient(x), np.gradient(y)
    norm = np.hypot(tx, ty)
    u = np.arange(-np.ceil(half_width), np.ceil(half_width) + 1)
    column = x[:, None] - u * (ty / norm)[:, None]
    row = y[:, None] + u * (tx / norm)[:, None]
    grey = map_coordinates(coefficients, [row, column], order=3, prefilter=False, mode="mirror")
    return Straightened(grey, s, u, x, y)


def _beyond(points):
    """BEYOND_PX more points, straight on from the last one."""
    direction = points[-1] - points[0]
    step = direction / np.hypot(*direction)
    return points[-1] + np.arange(1, BEYOND_PX + 1)[:, None] * step


def _recentred(straight, sections):
    """The line moved onto the sections' centres, smoothed."""
    points = np.column_stack(straight.place(sections.s, sections.centre))
    keep = np.abs(sections.centre) < 3 + 0.5 * sections.half_width
    inside = (straight.s >= 0) & (straight.s <= straight.s[-1] - BEYOND_PX)
    shift = np.interp(straight.s[inside], sections.s[keep], sections.centre[keep])
    points = np.column_stack(straight.place(straight.s[inside], shift))
    return smooth_line(points, KNOT_PX)


# Fits ----------------------------------------------------------------------------------------


def fit_sections(straight: Straightened, bright=False) -> Sections:
    """Both edges of all sections, with one blur and, where it is thin, one contrast."""
    s, grey = _sections_of(straight)
    start = _starting_values(grey, straight.u)
    blur = start[:, 5] = _common_blur(grey, straight.u, start)
    values, _ = _fit(grey, straight.u, start)
    thick = values[:, 4] > THICK_BLURS * blur
    if thick.sum() < 8:
        raise NoWhiskerError(
            f"shows too little of a thick whisker: expected at least {8 * SECTION_PX} px of its "
            f"length more than {2 * THICK_BLURS * blur:.1f} px wide; photograph it in focus and "
            "at a higher magnification"
        )
    usual, spread, doubt = _contrast_along(values[:, 0], values[:, 2], thick, bright)
    values, errors = _fit(grey, straight.u, values, contrast=(usual, spread))
    other, _ = _fit(grey, straight.u, values, contrast=((1 + doubt) * usual, spread))
    return Sections(
        s=s,
        centre=values[:, 3],
        half_width=values[:, 4],
        half_width_se=errors[:, 4],
        half_width_doubt=other[:, 4] - values[:, 4],
        contrast=usual,
        blur=blur,
    )


def _contrast_along(ground, contrast, thick, bright):
    """The contrast C that a whisker has along the whole of it, by that of its thick part.

    A dark whisker takes away a share of the light. A bright one may shine as its dark ground does,
    or the ground's light may say nothing of it, as in a negative or of tiles: both count, by how
    likely they make the steps of the thick part.

    Returns
    -------
    usual, spread : (sections,), and the SD of single sections about it
    doubt : (sections,) share by which the usual one may be off
    """
    light = np.maximum(ground, 1.0)  # grey level
    ways = [_levels(contrast, light**power, thick) for power in ((0, 1) if bright else (1,))]
    usual, scatter, doubt, likelihood = (np.array(part) for part in zip(*ways, strict=True))
    weight = np.exp(likelihood - likelihood.max())[:, None]
    weight /= weight.sum()
    mean = (weight * usual).sum(axis=0)
    doubt = np.sqrt((weight * (doubt**2 + (usual / mean - 1) ** 2)).sum(axis=0))
    return mean, scatter[np.argmax(weight)] * mean, doubt


def _levels(contrast, light, thick):
    """Contrast (sections,) that goes with `light`, and is that of the nearest thick stretch.

    Also the scatter about it, how far it may be off, as shares, and the log likelihood of the way:
    the contrast walks at random from stretch to stretch, and may drift on as it did.
    """
    at = np.flatnonzero(thick)
    share = contrast[at] / light[at]
    parts = np.array_split(np.arange(len(at)), max(len(at) // STRETCH, 2))
    levels = np.array([np.median(share[part]) for part in parts])
    places = [at[part].mean() for part in parts]
    number = np.arange(len(light))
    usual = np.interp(number, places, levels)
    scatter = max(float(robust_sd(share / usual[at] - 1, 0.0)), CONTRAST_SD)
    step = np.sqrt(np.mean((np.diff(levels) / levels.mean()) ** 2))
    step = np.hypot(step, 1.25 * scatter / np.sqrt(len(parts[0])))
    away = np.abs(number - np.clip(number, at[0], at[-1])) / STRETCH
    drift = abs(levels[-1] - levels[0]) / levels.mean() / (len(levels) - 1)
    doubt = np.hypot(step * np.sqrt(1 + away), drift * away)
    return light * usual, scatter, doubt, -(len(levels) - 1) * np.log(step)


def _common_blur(grey, u, start) -> float:
    """Blur [px] of the edges where the whisker is thick: the same along the whole whisker."""
    widest = np.quantile(start[:, 4], 0.95)
    if widest < LEAST_HALF_WIDTH_PX:
        raise NoWhiskerError(
            f"shows a whisker of only {2 * widest:.1f} px at its base: expected at least "
            f"{2 * LEAST_HALF_WIDTH_PX:g} px; photograph it at a higher magnification"
        )
    thick = start[:, 4] > THICK_BLURS * FIRST_BLUR_PX
    free, _ = _fit(grey[thick], u, start[thick], free_blur=True)
    found = float(np.median(free[:, 5]))
    if found > MOST_BLUR * widest:
        raise NoWhiskerError(
            f"shows a whisker of {2 * widest:.1f} px at its base, its edges blurred by "
            f"{found:.1f} px (SD): expected at most {MOST_BLUR * widest:.1f} px; photograph it in "
            "focus and at a higher magnification"
        )
    return max(found, 0.4)


def _sections_of(straight):
    """Middles [px] and mean grey levels (sections, across) of the sections between the ends."""
    first = np.searchsorted(straight.s, 0.0)
    count = (len(straight.s) - 2 * BEYOND_PX) // SECTION_PX
    rows = slice(first, first + count * SECTION_PX)
    grey = straight.grey[rows].reshape(count, SECTION_PX, -1)
    s = straight.s[rows].reshape(count, SECTION_PX).mean(axis=1)
    return s, grey.mean(axis=1).astype(float)


def _starting_values(grey, u):
    """b0, b1, C, c, r, σ of every section, from the darkness and where it lies."""
    flank = np.abs(u) > np.abs(u).max() - FLANK_PX / 2
    ground = np.median(grey[:, flank], axis=1)
    dark = np.maximum(ground[:, None] - grey, 0)
    dark[dark < 0.1 * dark.max(axis=1, keepdims=True)] = 0
    usual = np.quantile(dark.max(axis=1), 0.9)
    near = dark * (np.abs(u) < np.abs(u).max() - FLANK_PX)
    area = near.sum(axis=1)
    centre = (near * u).sum(axis=1) / np.maximum(area, 1e-9)
    half = np.clip(0.5 * area / usual, 0.15, None)
    zeros = np.zeros_like(ground)
    blur = zeros + FIRST_BLUR_PX
    return np.column_stack([ground, zeros, zeros + usual, centre, half, blur])


def _fit(grey, u, start, free_blur=False, contrast=None):
    """Gauss–Newton for all sections at once.

    Parameters
    ----------
    grey : (sections, across)
    start : (sections, 6) as in `_starting_values`
    free_blur : fit σ as well; else it stays as it is
    contrast : (values, their SD), (sections,) each, that C is held to, weakly

    Returns
    -------
    values : (sections, 6)
    standard errors : (sections, 5 or 6)
    """
    q, free = start.copy(), 6 if free_blur else 5
    damping = 1e-3
    for _ in range(STEPS):
        model, slopes = _strip(q, u)
        slopes, window = slopes[..., :free], _window(q, u)
        residual = grey - model
        sd = _scatter(residual, window)
        far = np.abs(residual) / (HUBER_SDS * sd[:, None])
        weighed = slopes * (window / np.maximum(far, 1))[..., None]
        matrix = weighed.transpose(0, 2, 1) @ slopes
        rhs = np.einsum("nuk,nu->nk", weighed, residual)
        if contrast is not None:
            usual, spread = contrast
            held = (sd / spread) ** 2
            matrix[:, 2, 2] += held
            rhs[:, 2] += held * (usual - q[:, 2])
        diagonal = np.einsum("nkk->nk", matrix)
        diagonal += damping * diagonal + 1e-9
        move = np.linalg.solve(matrix, rhs[..., None])[..., 0]
        q[:, :free] += np.clip(move, -LARGEST_STEP[:free], LARGEST_STEP[:free])
        q = np.maximum(q, LEAST)
        damping = max(damping / 10, 1e-9)
    return q, np.sqrt(np.einsum("nkk->nk", np.linalg.inv(matrix))) * sd[:, None]


def _strip(q, u):
    """The strip's grey levels (sections, across) and their slopes by the unknowns."""
    b0, b1, dark, c, r, sigma = (q[:, [k]] for k in range(6))
    left, right = (u - c + r) / sigma, (u - c - r) / sigma
    cover = ndtr(left) - ndtr(right)
    at_left, at_right = _bell(left) / sigma, _bell(right) / sigma
    slopes = [
        np.ones_like(cover), u + 0 * cover, -cover,
        dark * (at_left - at_right), -dark * (at_left + at_right),
        dark * (left * at_left - right * at_right),
    ]  # fmt: skip
    return b0 + b1 * u - dark * cover, np.stack(slopes, axis=-1)


def _bell(z):
    return np.exp(-0.5 * z**2) / np.sqrt(2 * np.pi)


def _window(q, u):
    """1 where a section is fitted: its edges and the ground beside them, not its core."""
    centre, r, sigma = q[:, [3]], q[:, [4]], q[:, [5]]
    away = np.abs(u - centre)
    return ((away < r + 3 * sigma + FLANK_PX) & (away > r - CORE_BLURS * sigma - 1)).astype(float)


def _scatter(residual, window):
    """Robust SD of the residuals within the window, (sections,)."""
    inside = np.where(window > 0, np.abs(residual), np.nan)
    usual = column_medians(np.ascontiguousarray(inside.T))
    return np.maximum(MAD_TO_SD * usual, 1e-3)


def profile_of(radius, u, blur):
    """Cover of strips of half-width `radius` (n,) about 0 at `u` (across,), (n, across)."""
    radius = np.asarray(radius)[:, None]
    return ndtr((u + radius) / blur) - ndtr((u - radius) / blur)


def without(sections: Sections, keep) -> Sections:
    """The sections where `keep` holds."""
    parts = (each.name for each in fields(sections) if each.name != "blur")
    return replace(sections, **{name: getattr(sections, name)[keep] for name in parts})
