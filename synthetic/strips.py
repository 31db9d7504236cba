"""Light lost behind a tapered curved strip: exact area coverage, blurred by the optics.

A strip is a smooth centreline with a half-width r(s). Behind a Gaussian blur (SD σ) and square
pixels the share of light that it takes is, at signed distance δ from the centreline,

    A(δ) = S(δ + r) − S(δ − r),      S = Φ_σ ⊗ box(|n_x|) ⊗ box(|n_y|),

the step response of blur and pixel across an edge with the normal (n_x, n_y). δ and s are those
of the closest point of the smooth centreline, to third order about the nearest of its nodes; a
bent edge moves by κ (σ² + 1/12)/2 towards its inner side when blur and pixel spread it.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numba import njit
from scipy.special import ndtr

_ANGLES = 33  # edge directions from 0 to 45° in a step table
_STEPS_PER_SIGMA = 48
_REACH = 4.0  # blur SDs beyond which an edge is complete
_GAUSS_POINTS = 12


class Steps(NamedTuple):
    """S of one blur.

    Attributes
    ----------
    blur : SD of the optics' Gaussian [px]
    table : float32 (33, steps), S at edge direction i × 45°/32 and distance −reach + j × step
    reach : distance beyond which S is 0 or 1 [px]
    per_px : steps per pixel
    """

    blur: float
    table: np.ndarray
    reach: float
    per_px: float


class Strip(NamedTuple):
    """Evenly spaced nodes of a strip, each (nodes,).

    Attributes
    ----------
    x, y : centreline [px], y down
    angle : tangent's direction on the screen, counter-clockwise [rad]
    curvature : counter-clockwise on the screen [1/px]
    radius : half-width [px]
    smear : way across the tangent during the exposure [px]
    """

    x: np.ndarray
    y: np.ndarray
    angle: np.ndarray
    curvature: np.ndarray
    radius: np.ndarray
    smear: np.ndarray


class _Node(NamedTuple):
    """One node of a `Strip`, `slope` of its radius, and what lies nearest to it.

    That is so far `across`, `before` and `after` it; `from_start`, `to_end`: its way to the
    strip's ends. All in px.
    """

    x: float
    y: float
    angle: float
    curvature: float
    radius: float
    slope: float
    smear: float
    across: float
    before: float
    after: float
    from_start: float
    to_end: float


@lru_cache(maxsize=64)
def step_table(blur: float) -> Steps:
    """Tabulate S over distance and edge direction, for a blur of this SD [px], > 0."""
    if not blur > 0:
        raise ValueError(f"blur must be > 0 px, got {blur!r}")
    reach = _REACH * blur + 1 / np.sqrt(2)
    per_px = _STEPS_PER_SIGMA / blur
    distance = np.arange(2 * int(np.ceil(reach * per_px)) + 2) / per_px - reach
    angle = np.linspace(0, np.pi / 4, _ANGLES)
    node, weight = np.polynomial.legendre.leggauss(_GAUSS_POINTS)
    table = np.zeros((_ANGLES, len(distance)))
    for ni, wi in zip(node, weight, strict=True):
        for nj, wj in zip(node, weight, strict=True):
            offset = 0.5 * (ni * np.cos(angle) + nj * np.sin(angle))
            table += wi * wj / 4 * ndtr((distance + offset[:, None]) / blur)
    return Steps(float(blur), table.astype(np.float32), float(reach), float(per_px))


@njit(cache=True, inline="always")
def _edge(steps, row, mix, distance):
    """S at `distance`, between two neighbouring rows of the table."""
    if distance <= -steps.reach:
        return 0.0
    if distance >= steps.reach:
        return 1.0
    table = steps.table
    place = (distance + steps.reach) * steps.per_px
    j = int(place)
    f = place - j
    low = table[row, j] + f * (table[row, j + 1] - table[row, j])
    high = table[row + 1, j] + f * (table[row + 1, j + 1] - table[row + 1, j])
    return low + mix * (high - low)


@njit(cache=True, inline="always")
def _direction_row(nx, ny, rows):
    """Row of the step table, and the part of the way to the next, of an edge normal."""
    a, b = abs(nx), abs(ny)
    if b > a:
        a, b = b, a
    place = np.arctan2(b, a) / (np.pi / 4) * (rows - 1)
    row = min(int(place), rows - 2)
    return row, place - row


@njit(cache=True, nogil=True)
def cover_strip(cover, touched, strip, steps):
    """Write the light share taken by one strip into `cover` where it exceeds what is there.

    Parameters
    ----------
    cover : float32 (height, width), zeros where no strip is
    touched : int32 (pixels,), filled with the flat indices of pixels made non-zero
    strip : Strip
    steps : step_table of the optics' blur

    Returns
    -------
    How many these are; overlap of a strip with itself counts once.
    """
    x, y, radius = strip.x, strip.y, strip.radius
    n, n_touched = len(x), 0
    step = np.hypot(x[1] - x[0], y[1] - y[0])
    for k in range(n):
        low, high = max(k - 1, 0), min(k + 1, n - 1)
        slope = (radius[high] - radius[low]) / (step * (high - low))
        half = 0.5 * step + 0.02  # neighbours overlap a little, so that no pixel falls between
        across = radius[k] + steps.reach + 0.5 * strip.smear[k]
        node = _Node(
            x[k], y[k], strip.angle[k], strip.curvature[k], radius[k], slope, strip.smear[k],
            across, across if k == 0 else half, across if k == n - 1 else half,
            k * step, (n - 1 - k) * step,
        )  # fmt: skip
        n_touched = _cover_piece(cover, touched, n_touched, node, steps)
    return n_touched


@njit(cache=True, inline="always")
def _crossing(delta, reach, smear, smears):
    """First and last (excluded) of a strip's places during the exposure that reach a pixel."""
    if smears == 1:
        return 0, 1
    half = smears * reach / smear
    middle = smears * (0.5 - delta / smear)
    return max(int(middle - half) - 1, 0), min(int(middle + half) + 2, smears)


@njit(cache=True, nogil=True)
def _cover_piece(cover, touched, n_touched, node, steps):
    """Write the pixels whose closest point lies from `before` to `after` one node."""
    x, y, angle, curvature, radius, slope, smear, across, before, after, from_start, to_end = node
    blur = steps.blur
    height, width = cover.shape
    c, s = np.cos(angle), np.sin(angle)
    row, mix = _direction_row(s, c, steps.table.shape[0])
    drift = 0.5 * curvature * (blur * blur + 1.0 / 12.0)
    near_an_end = min(from_start, to_end) < steps.reach + 1.0
    smears = 1 + int(2.0 * smear / blur) if smear > 0.1 * blur else 1
    along_box = max(before, after)
    bx, by = abs(s) * across + abs(c) * along_box, abs(c) * across + abs(s) * along_box
    for j in range(max(0, int(np.ceil(y - by))), min(height - 1, int(np.floor(y + by))) + 1):
        dy = y - j
        for i in range(max(0, int(np.ceil(x - bx))), min(width - 1, int(np.floor(x + bx))) + 1):
            dx = i - x
            u, v = dx * c + dy * s, dy * c - dx * s
            if u < -before or u > after or abs(v) > across:
                continue
            along = u / (1.0 - curvature * v)
            delta = v - 0.5 * curvature * u * along - drift
            r = max(radius + slope * along, 0.0)
            a = 0.0
            first, last = _crossing(delta, r + steps.reach, smear, smears)
            for m in range(first, last):
                d = delta + smear * ((m + 0.5) / smears - 0.5)
                a += _edge(steps, row, mix, d + r)
                a -= _edge(steps, row, mix, d - r)
            a /= smears
            if near_an_end:
                a *= _edge(steps, row, mix, from_start + along)
                a *= _edge(steps, row, mix, to_end - along)
            if a > cover[j, i]:
                if cover[j, i] == 0.0:
                    touched[n_touched] = j * width + i
                    n_touched += 1
                cover[j, i] = a
    return n_touched


@njit(cache=True, nogil=True)
def absorb(transmission, cover, touched, n_touched, opacity):
    """Multiply `transmission` by 1 − opacity × cover and clear `cover` again."""
    width = cover.shape[1]
    for k in range(n_touched):
        j, i = touched[k] // width, touched[k] % width
        transmission[j, i] *= 1.0 - opacity * cover[j, i]
        cover[j, i] = 0.0


@njit(cache=True, nogil=True)
def cover_disc(cover, x, y, radius, steps):
    """Write the light share taken by a disc into `cover` where it exceeds what is there."""
    height, width = cover.shape
    blur, outside = steps.blur, radius + steps.reach
    for j in range(max(0, int(y - outside)), min(height, int(y + outside) + 2)):
        for i in range(max(0, int(x - outside)), min(width, int(x + outside) + 2)):
            dx, dy = i - x, j - y
            distance = np.hypot(dx, dy)
            if distance >= outside:
                continue
            row, mix = _direction_row(dx, dy, steps.table.shape[0])
            # a blurred round edge moves inwards by σ²/2r at its own radius
            drift = 0.5 * (blur * blur + 1.0 / 12.0) / radius
            a = _edge(steps, row, mix, radius - drift - distance)
            if a > cover[j, i]:
                cover[j, i] = a


def blank(height: int, width: int):
    """Working arrays for `cover_strip`: a cover of zeros and an empty list of pixels."""
    return np.zeros((height, width), np.float32), np.empty(height * width, np.int32)
