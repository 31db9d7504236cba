"""Find thin dark lines in one frame: sub-pixel ridge points, linked into curves.

Ridge points after Steger (IEEE PAMI 1998, "An unbiased detector of curvilinear structures"):
the image is differentiated by Gaussians, and a point lies on a line where the derivative across
the line, along the Hessian's main direction, is zero within the pixel.
"""

from functools import lru_cache

import cv2
import numpy as np
from numba import njit

from pipeline.detection import derivatives
from pipeline.detection.curves import Curves, join
from pipeline.numerics.rectangles import WHOLE, bounds
from pipeline.numerics.robust import robust_sd

SCALE_PX = 1.6  # SD of the differentiating Gaussian
COARSE_PX = 2.5  # scales from here on are looked for on a smaller picture
PYRAMID_NOISE = 0.27  # SD of white noise after cv2.pyrDown
FEW_FROM, FEW = 3, 7  # of the pixels that the noise is measured at
LOW, HIGH = 2.5, 5.0  # standard deviations of the noise: to go on along a line, to start one


def curves_of(absorbance, noise_sd, scale=SCALE_PX, shortest=10) -> Curves:
    """Ridges of an absorbance image as curves, joined across gaps.

    Broad ones are found on the picture at half its size, in a quarter of the time.
    """
    return curves_in(WHOLE, absorbance, noise_sd, scale, shortest)


def curves_in(part, absorbance, noise_sd, scale, shortest=10) -> Curves:
    """`curves_of` a part of an image, slices of rows and columns, where they lie in the whole."""
    if scale < COARSE_PX:
        curves = join(link(*ridge_points(absorbance, noise_sd, scale, part), shortest))
    else:
        noise = np.ascontiguousarray(noise_sd[part][::2, ::2]) * PYRAMID_NOISE
        points = ridge_points(cv2.pyrDown(absorbance[part]), noise, scale / 2)
        curves = join(link(*points, shortest // 2))
        curves = curves._replace(places=2 * curves.places)
    corner = float(part[1].start or 0), float(part[0].start or 0)
    return curves._replace(places=curves.places + corner)


def ridge_points(absorbance, noise_sd, scale=SCALE_PX, part=WHOLE):
    """Return the ridge points of an absorbance image, or of a part of it.

    Parameters
    ----------
    absorbance : float32 (height, width), 1 − I/B, zero where nothing may be found
    noise_sd : float32 (height, width), SD of its noise per pixel
    scale : SD of the differentiating Gaussian [px]
    part : slices of rows and columns; all below is of the part alone

    Returns
    -------
    index : int32 (height, width), number of the point in that pixel, −1 where there is none
    points : float64 (n, 5): x, y [px], tangent (tx, ty), strength in SDs of its noise
    """
    kernels, response_sd = _filters(scale)
    within = bounds(part, absorbance.shape)
    top, bottom, left, right = within
    rows = derivatives.along_rows(absorbance, within, kernels)
    few = np.s_[FEW_FROM::FEW, FEW_FROM::FEW]
    response = derivatives.second_along_rows(rows, kernels, FEW_FROM, FEW)
    excess = _excess_noise(response, response_sd * noise_sd[part][few], absorbance[part][few])
    index = np.empty((bottom - top, right - left), np.int32)
    points = np.empty((index.size, 5))
    count = _points(rows, kernels, noise_sd, (top, left), response_sd * excess, index, points)
    return index, points[:count]


@lru_cache
def _filters(scale):
    """Kernels as in `derivatives.halves`, and the SD of their response to white noise of SD 1."""
    g, g1, g2 = derivatives.gaussian_kernels(scale)
    response_sd = np.sqrt((g2.astype(float) ** 2).sum() * (g.astype(float) ** 2).sum())
    return derivatives.halves((g, g1, g2)), response_sd


@njit(cache=True)
def _may_be_strong(xx, yy, xy, noise_sd, limit, out):
    """Fill `out`: whether the response at a row's pixels is above `limit` SDs, rounding left out.

    Most pixels are below, which many at a time can show without a square root.
    """
    half, nearly = np.float32(0.5), np.float32(1 - 1e-4)
    for i in range(len(out)):
        least = half * (xx[i] + yy[i]) + limit * noise_sd[i]
        apart = half * (xx[i] - yy[i])
        out[i] = (least <= 0) | (apart * apart + xy[i] * xy[i] >= nearly * least * least)


@njit(cache=True)
def _points(rows, kernels, noise_sd, corner, response_sd, index, points):
    """Fill `index` and `points` (see ridge_points) from `rows`; return their number.

    rows, kernels : as in `derivatives.along_rows`; corner : of the part, first row and column
    """
    height, width = index.shape
    top, left = corner
    count = 0
    of_row, of_strong = np.empty((3, width), np.float32), np.empty((6, width), np.float32)
    strong, columns = np.zeros(8 * (width // 8 + 1), np.bool_), np.empty(width, np.int32)
    limit, response = np.float32(LOW * response_sd), np.float32(response_sd)
    for row in range(height):
        index[row] = -1
        axx, ayy, axy = of_row[0], of_row[1], of_row[2]
        derivatives.second_derivatives(rows, row, kernels, axx, ayy, axy)
        noise = noise_sd[top + row, left : left + width]
        _may_be_strong(axx, ayy, axy, noise, limit, strong[:width])
        found = _places(strong, columns)
        if found == 0:
            continue
        x, y = of_strong[0], of_strong[1]
        derivatives.first_derivatives(rows, row, kernels, columns[:found], x, y)
        for k in range(3):
            for i in range(found):
                of_strong[2 + k, i] = of_row[k, np.uint64(columns[i])]
        for i in range(found):
            of_strong[5, i] = response * noise[np.uint64(columns[i])]
        _crests(of_strong, found)
        for i in range(found):
            aside, below, strength = x[i], y[i], of_strong[4, i]
            if not (strength > LOW and abs(aside) <= 0.6 and abs(below) <= 0.6):
                continue
            column = columns[i]
            index[row, column] = count
            points[count, 0] = column + np.float64(aside)
            points[count, 1] = row + np.float64(below)
            points[count, 2], points[count, 3] = of_strong[2, i], of_strong[3, i]
            points[count, 4] = strength
            count += 1
    return count


@njit(cache=True)
def _places(marks, places):
    """Fill in the places of the marks, eight of which are looked at at a time; their number."""
    count, words = 0, marks.view(np.uint64)
    for word in range(len(words)):
        if words[word] == 0:
            continue
        for place in range(8 * word, 8 * word + 8):
            if marks[place]:
                places[count] = place
                count += 1
    return count


@njit(cache=True, error_model="numpy")
def _crests(values, n):
    """Of derivatives x, y, xx, yy, xy and noise, rows of `values`, the ridge's point and strength.

    In their place: where it is beside the pixel's centre (x, y), tangent (x, y), SDs of the noise.
    """
    half, least = np.float32(0.5), np.float32(1e-30)
    ax, ay, axx, ayy, axy, noise = values[0], values[1], values[2], values[3], values[4], values[5]
    for i in range(n):
        xx, yy, xy = axx[i], ayy[i], axy[i]
        # the more negative eigenvalue: across a line of absorbance
        apart = half * (xx - yy)
        lam = half * (xx + yy) - np.sqrt(apart * apart + xy * xy)
        # its eigenvector: (xy, lam − xx) or (lam − yy, xy), whichever is longer
        first = abs(lam - xx) > abs(lam - yy)
        nx, ny = (xy, lam - xx) if first else (lam - yy, xy)
        norm = np.sqrt(nx * nx + ny * ny)
        shrink = np.float32(1) / (norm if norm > least else least)
        nx, ny = nx * shrink, ny * shrink
        t = -(ax[i] * nx + ay[i] * ny) / lam
        ax[i], ay[i], axx[i], ayy[i], axy[i] = t * nx, t * ny, -ny, nx, -lam / noise[i]


def _excess_noise(response, noise, absorbance) -> float:
    """How much larger the filtered noise is than white noise would be, at least 1.

    Compressed video has less noise, but of longer range, which the filter lets pass.
    """
    sample = (response / noise)[absorbance != 0]
    if sample.size < 100:
        return 1.0
    return max(1.0, float(robust_sd(sample, about=0.0)))


@njit(cache=True)
def _grow(index, points, used, start, sign, out):
    """Follow ridge points from `start` in direction `sign`; return how many were written."""
    count = 0
    current = start
    tx = sign * points[start, 2]
    ty = sign * points[start, 3]
    while count < len(out):
        best = _next_point(index, points, used, current, tx, ty)
        if best < 0:
            break
        out[count] = best
        count += 1
        used[best] = 1
        _mark_beside(index, points, used, best)
        direction = points[best, 2] * tx + points[best, 3] * ty
        s = 1.0 if direction >= 0 else -1.0
        # the running direction is averaged: one noisy point must not turn it
        tx = 0.6 * tx + 0.4 * s * points[best, 2]
        ty = 0.6 * ty + 0.4 * s * points[best, 3]
        norm = np.sqrt(tx * tx + ty * ty)
        tx /= norm
        ty /= norm
        current = best
    return count


@njit(cache=True)
def _next_point(index, points, used, current, tx, ty):
    """The ridge point by which a line in direction (tx, ty) continues; −1 where it ends."""
    height, width = index.shape
    x, y = points[current, 0], points[current, 1]
    for reach in range(1, 5):
        # look into a small window around the point `reach` px ahead
        row0 = int(np.floor(y + reach * ty + 0.5))
        column0 = int(np.floor(x + reach * tx + 0.5))
        best, best_cost = -1, 1e9
        for row in range(max(row0 - 1, 0), min(row0 + 2, height)):
            for column in range(max(column0 - 1, 0), min(column0 + 2, width)):
                candidate = index[np.uint64(row), np.uint64(column)]
                if candidate < 0 or candidate == current or used[candidate] == 1:
                    continue
                cost = _step_cost(points, current, candidate, tx, ty)
                if cost < best_cost:
                    best, best_cost = candidate, cost
        if best >= 0:
            return best
    return -1


@njit(cache=True)
def _step_cost(points, current, candidate, tx, ty):
    """How far a step goes, aside and round a corner counting more; infinite for one too bent."""
    dx = points[candidate, 0] - points[current, 0]
    dy = points[candidate, 1] - points[current, 1]
    along = dx * tx + dy * ty
    across = abs(dx * ty - dy * tx)
    turn = abs(points[candidate, 2] * ty - points[candidate, 3] * tx)
    if along < 0.3 or across > 0.5 * along + 0.5 or turn > 0.5:
        return np.inf
    return along + 2 * across + 3 * turn


@njit(cache=True)
def _mark_beside(index, points, used, p):
    """Take the neighbours across the line out of play, so that a line is followed once."""
    height, width = index.shape
    x, y, tx, ty = points[p, 0], points[p, 1], points[p, 2], points[p, 3]
    row0 = int(np.floor(y + 0.5))
    column0 = int(np.floor(x + 0.5))
    for row in range(max(row0 - 2, 0), min(row0 + 3, height)):
        for column in range(max(column0 - 2, 0), min(column0 + 3, width)):
            q = index[np.uint64(row), np.uint64(column)]
            if q < 0 or used[q] != 0:
                continue
            dx = points[q, 0] - x
            dy = points[q, 1] - y
            if abs(dx * tx + dy * ty) < 0.55 and abs(dx * ty - dy * tx) < 1.6:
                used[q] = 2


def link(index, points, shortest=8) -> Curves:
    """Link ridge points into curves; those of fewer than `shortest` points are left out."""
    return Curves(*_linked(index, points, shortest))


@njit(cache=True)
def _linked(index, points, shortest):
    """Places and offsets of `link`: ridges are followed from the strongest points on."""
    seeds = np.flatnonzero(points[:, 4] >= HIGH)
    order = seeds[np.argsort(-points[seeds, 4], kind="mergesort")]
    used = np.zeros(len(points), np.uint8)
    forward, backward = np.empty(len(points), np.int32), np.empty(len(points), np.int32)
    places, offsets = np.empty((len(points), 2)), np.zeros(len(order) + 1, np.int64)
    count = 0
    for seed in order:
        if used[seed]:
            continue
        used[seed] = 1
        a = _grow(index, points, used, seed, 1.0, forward)
        b = _grow(index, points, used, seed, -1.0, backward)
        n = b + 1 + a
        if n < shortest:
            continue
        first = offsets[count]
        for i in range(n):
            p = backward[b - 1 - i] if i < b else seed if i == b else forward[i - b - 1]
            places[first + i, 0], places[first + i, 1] = points[p, 0], points[p, 1]
        count += 1
        offsets[count] = first + n
    return places[: offsets[count]], offsets[: count + 1]
