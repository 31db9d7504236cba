"""Normal equations of all cross-sections of a line, many nodes at a time.

The model is that of line_profile.py. Vector instructions run along the line, from node to node,
and the pixels of the sections are taken one after the other: every quantity has a row of BLOCK
nodes in one array, at distances that the compiler knows.
"""

import numpy as np
from numba import njit

from pipeline.detection import line_profile
from pipeline.detection.line_profile import N_SUMS, SINGLE, bell, section_at

BLOCK = 128  # nodes


def _row(number):
    return np.uint64(number * BLOCK)  # unsigned: numba need not look for negative places


GG, G1, G11, GY, OY, YY, PIXELS = map(_row, range(line_profile.GG, line_profile.PIXELS + 1))
DD, DY, DG, D1, SS, SY, SG = map(_row, range(line_profile.DD, line_profile.SG + 1))
# of the next pixel: grey, background, weight, distance/σ; from pixel to pixel: step of the latter
PIXEL, LIGHT, TRUST, PLACE, STEP, INVERSE, CAP = (_row(N_SUMS + k) for k in range(7))
# of its section: the row's or column's number, whether it is a column, first pixel, how many
FIXED, COLUMNS, FIRST, COUNT = (_row(N_SUMS + 7 + k) for k in range(4))
N_ROWS = N_SUMS + 11
AT, STRIDE, LEFT = (_row(k) for k in range(3))  # of integers: first place, step, how many


@njit(cache=True, error_model="numpy")
def accumulate(image, background, weight, gain, x, y, n, cap, sigma, reach, widths, sums):
    """Fill `sums` (N_SUMS, at least n) with the normal equations of every node's cross-section.

    image : uint8 (height, width); background, weight : float32 (height, width)
    x, y : nodes of the reference line, about 1 px apart [px]
    cap : largest believable absorbance at each node; darker pixels are cut to it
    sigma : half-width of the line at each node [px]; reach : half-width of the section / sigma
    widths : whether to fill the sums for the half-width, too
    """
    images, lights, weights = image.ravel(), background.ravel(), weight.ravel()
    height, width = image.shape
    rows, places = np.empty(N_ROWS * BLOCK, SINGLE), np.empty(3 * BLOCK, np.int32)
    around = np.empty((2, BLOCK + 2))
    before = (SINGLE(-1), SINGLE(-1))
    for start in range(0, n, BLOCK):
        m = min(n - start, BLOCK)
        for j in range(m + 2):
            i = min(max(start + j - 1, 0), n - 1)
            around[0, j], around[1, j] = x[i], y[i]
        own, thick = cap[start : start + m], sigma[start : start + m]
        _lay(around[0], around[1], m, own, thick, reach, float(width), float(height), rows)
        most, before = _find_places(rows, m, np.int32(width), before, places)
        rows[: N_SUMS * BLOCK] = 0
        for k in range(most):
            _take_pixels(images, lights, weights, places, np.int32(k), m, rows)
            if widths:
                _add_widths(rows, SINGLE(gain), m)
            _add_pixels(rows, SINGLE(gain), m)
        for c in range(N_SUMS if widths else line_profile.SS):
            _keep(rows, c, sums, start, m)


@njit(cache=True)
def _keep(rows, c, sums, start, m):
    """Copy `m` values of a row; a loop without slices, which takes a third of their time."""
    for j in range(m):
        sums[c, np.uint64(start + j)] = rows[np.uint64(c * BLOCK + j)]


@njit(cache=True, error_model="numpy")
def _lay(x, y, m, cap, sigma, reach, width, height, rows):
    """The row or column of pixels that crosses the line at each of m nodes (`section_at`).

    x, y : the nodes, with one before and one behind
    """
    for j in range(m):
        node = np.uint64(j)
        here, behind = node + np.uint64(1), node + np.uint64(2)
        tx, ty = x[behind] - x[node], y[behind] - y[node]
        columns, fixed, centre, scale = section_at(x[here], y[here], tx, ty)
        across_size, along_size = (width, height) if columns else (height, width)
        span = (reach * sigma[node] + 1.0) / max(abs(scale), 0.5)
        first, last = np.ceil(centre - span), np.floor(centre + span)
        first = first if first > 0.0 else 0.0
        last = last if last < along_size - 1.0 else along_size - 1.0
        count = last - first + 1.0
        inside = (fixed >= 0.0) & (fixed < across_size) & (count > 0.0)
        rows[FIXED + node], rows[FIRST + node] = SINGLE(fixed), SINGLE(first)
        rows[COLUMNS + node] = SINGLE(1.0 if columns else 0.0)
        rows[COUNT + node] = SINGLE(count if inside else 0.0)
        inverse = 1.0 / sigma[node]
        rows[PLACE + node] = SINGLE((first - centre) * scale * inverse)
        rows[STEP + node] = SINGLE(scale * inverse)
        rows[INVERSE + node], rows[CAP + node] = SINGLE(inverse), SINGLE(cap[node])


@njit(cache=True, error_model="numpy")
def _find_places(rows, m, width, before, places):
    """Where the sections' pixels lie in the picture; returns the largest number of pixels.

    A section that is the node's `before`, too (its second return value: the last one's), has
    none: no pixel counts twice.
    """
    most = 0
    for j in range(m):
        node = np.uint64(j)
        columns, number = rows[COLUMNS + node], rows[FIXED + node]
        fixed, first = np.int32(number), np.int32(rows[FIRST + node])
        count = np.int32(rows[COUNT + node])
        if (columns, number) == before:
            count = np.int32(0)
        before = columns, number
        place = first * width + fixed if columns > 0 else fixed * width + first
        places[AT + node] = place if count > 0 else np.int32(0)
        places[STRIDE + node] = width if columns > 0 else np.int32(1)
        places[LEFT + node] = count
        most = max(most, count)
    return most, before


@njit(cache=True, error_model="numpy")
def _take_pixels(images, lights, weights, places, k, m, rows):
    """Put pixel `k` of each section into rows of its own; those beyond it without weight."""
    for j in range(m):
        node = np.uint64(j)
        inside = k < places[LEFT + node]
        at = np.uint64(places[AT + node] + k * places[STRIDE + node]) if inside else np.uint64(0)
        rows[PIXEL + node], rows[LIGHT + node] = images[at], lights[at]
        rows[TRUST + node] = weights[at] if inside else SINGLE(0)


@njit(cache=True, error_model="numpy")
def _pixel(rows, gain, node):
    """Of a node's pixel: expected light, what is missing of it, distance/σ and the bell there."""
    v = gain * rows[LIGHT + node]
    u = rows[PLACE + node]
    return v, min(v - rows[PIXEL + node], rows[CAP + node] * v), u, bell(u)


@njit(cache=True, error_model="numpy")
def _add_pixels(rows, gain, m):
    """Add the pixels taken to the sums of each of m nodes, and go on to the next."""
    for j in range(m):
        node = np.uint64(j)
        v, value, u, g = _pixel(rows, gain, node)
        d = u * g * rows[INVERSE + node]
        wv = rows[TRUST + node] * v
        wvv, wvy = wv * v, wv * value
        wg, wd = wvv * g, wvv * d
        rows[GG + node] += wg * g
        rows[G1 + node] += wg
        rows[G11 + node] += wvv
        rows[GY + node] += wvy * g
        rows[OY + node] += wvy
        rows[YY + node] += rows[TRUST + node] * value * value
        rows[PIXELS + node] += SINGLE(rows[TRUST + node] > 0)
        rows[DD + node] += wd * d
        rows[DY + node] += wvy * d
        rows[DG + node] += wd * g
        rows[D1 + node] += wd
        rows[PLACE + node] = u + rows[STEP + node]


@njit(cache=True, error_model="numpy")
def _add_widths(rows, gain, m):
    """Add the pixels taken to those sums of each of m nodes that are for the half-width."""
    for j in range(m):
        node = np.uint64(j)
        v, value, u, g = _pixel(rows, gain, node)
        s = u * u * g
        wv = rows[TRUST + node] * v
        ws = wv * v * s
        rows[SS + node] += ws * s
        rows[SY + node] += wv * value * s
        rows[SG + node] += ws * g
