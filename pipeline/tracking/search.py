"""The best path for a line through a strip of cross-sections about its prediction.

It is found for the whole whisker at once, by dynamic programming over the likelihood gain of "a
line of the known absorbance lies here".
"""

import numpy as np
from numba import njit

from pipeline.detection import line_profile
from pipeline.detection.line import nodes_of, scratch_of
from pipeline.detection.line_fit import FLOAT, HALF, SHORTEST
from pipeline.numerics.polyline import normals, resample

STATION = 2  # nodes between two cross-sections of the strip
REACH = 3  # half-width of the line's profile in it [px]
SLOPE_COST = 3.0  # log likelihood, of a step of 1 px between neighbouring stations
OFFSET_COST = 0.002  # log likelihood per px², of an offset from the prediction


@njit(cache=True, error_model="numpy")
def strip_gains(picture, nodes, nx, ny, half, out, at):
    """Likelihood gain of a line at every station and integer offset −half … half.

    The nearest pixels are taken as they are. out : float32 (stations, `strip_width(half)`); at :
    likewise, the offset at which the pixel's centre really lies.
    """
    x, y, amplitude, sigma = nodes.x, nodes.y, nodes.amplitude, nodes.sigma
    width, height = np.int32(picture.image.shape[1]), np.int32(picture.image.shape[0])
    images, lights = picture.image.ravel(), picture.background.ravel()
    weights = picture.weight.ravel()
    offsets = out.shape[1]
    size = offsets + line_profile.LANES
    place, off = np.empty(size, np.int32), np.empty(size, FLOAT)
    pixel, light, trust = np.empty(size, FLOAT), np.empty(size, FLOAT), np.empty(size, FLOAT)
    value, power = np.empty(size, FLOAT), np.empty(size, FLOAT)
    level, middle = FLOAT(picture.gain), half + REACH
    for station in range(len(out)):
        i = station * STATION
        cx, cy, ux, uy = FLOAT(x[i]), FLOAT(y[i]), FLOAT(nx[i]), FLOAT(ny[i])
        for k in range(size):
            u = FLOAT(np.int32(k - middle))
            px, py = cx + u * ux, cy + u * uy
            column, row = np.int32(np.floor(px + HALF)), np.int32(np.floor(py + HALF))
            off[k] = u + (FLOAT(column) - px) * ux + (FLOAT(row) - py) * uy
            inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
            place[k] = row * width + column if inside else np.int32(-1)
        for k in range(size):
            p = np.uint64(max(place[k], 0))  # unsigned: numba need not look for negative places
            pixel[k], light[k] = images[p], lights[p]
            trust[k] = weights[p] if place[k] >= 0 else FLOAT(0)
        a = FLOAT(max(amplitude[i], 0.02))
        highest = FLOAT(1.3) * a
        for k in range(size):
            v = level * light[k]
            power[k] = trust[k] * v * v
            value[k] = trust[k] * v * min(v - pixel[k], highest * v)
        linear, constant = _profile(a, sigma[i])
        for j in range(offsets):
            out[station, j] = _taps(value, j, linear) - _taps(power, j, constant)
        for j in range(offsets):
            at[station, j] = off[j + REACH]


@njit(cache=True)
def strip_width(half):
    """Number of offsets in a strip's arrays: 2 half + 1 and some, for vector instructions."""
    return (2 * half + line_profile.LANES) // line_profile.LANES * line_profile.LANES


@njit(cache=True, inline="always")
def _profile(a, sigma):
    """Factors of the gain's terms linear in the picture and constant, at 0 … REACH px [4-tuples].

    Blind to a constant error of the background.
    """
    inverse = FLOAT(1 / np.sqrt(sigma * sigma + 0.1))  # taking the nearest pixel blurs a little
    b1, b2 = line_profile.bell(inverse), line_profile.bell(FLOAT(2) * inverse)
    b3 = line_profile.bell(FLOAT(3) * inverse)
    mean = (FLOAT(0.5) + b1 + b2 + b3) * FLOAT(2 / (2 * REACH + 1))
    l0, l1, l2, l3 = a * (FLOAT(1) - mean), a * (b1 - mean), a * (b2 - mean), a * (b3 - mean)
    return (l0, l1, l2, l3), (HALF * l0 * l0, HALF * l1 * l1, HALF * l2 * l2, HALF * l3 * l3)


@njit(cache=True, inline="always")
def _taps(row, j, f):
    """Value at place j of a row's product with a symmetric profile."""
    return (
        f[0] * row[j + 3]
        + f[1] * (row[j + 2] + row[j + 4])
        + f[2] * (row[j + 1] + row[j + 5])
        + f[3] * (row[j] + row[j + 6])
    )


@njit(cache=True)
def best_path(gains, stations, half, slope_cost, offset_cost, path):
    """Fill `path` with the offsets, one per station, of the path of largest gain.

    A step of one pixel between neighbouring stations costs `slope_cost`, an offset u costs
    offset_cost u².
    """
    size = 2 * half + 1
    score = np.empty((stations, size))
    origin = np.empty((stations, size), np.int8)
    for j in range(size):
        score[0, j] = gains[0, j] - offset_cost * (j - half) ** 2
        origin[0, j] = 0
    for i in range(1, stations):
        for j in range(size):
            best = score[i - 1, j]
            step = 0
            if j > 0 and score[i - 1, j - 1] - slope_cost > best:
                best = score[i - 1, j - 1] - slope_cost
                step = -1
            if j < size - 1 and score[i - 1, j + 1] - slope_cost > best:
                best = score[i - 1, j + 1] - slope_cost
                step = 1
            score[i, j] = best + gains[i, j] - offset_cost * (j - half) ** 2
            origin[i, j] = step
    j = int(np.argmax(score[stations - 1]))
    for i in range(stations - 1, -1, -1):
        path[i] = j - half
        j += origin[i, j]


@njit(cache=True)
def _peak(gains, at, j, last):
    """Offset of the largest gain near place `j` of a station, by a parabola where there is one."""
    if j == 0 or j == last:
        return at[j]
    bend = gains[j - 1] - 2 * gains[j] + gains[j + 1]
    if gains[j] <= max(gains[j - 1], gains[j + 1]) or bend >= 0:
        return at[j]
    shift = 0.5 * (gains[j - 1] - gains[j + 1]) / bend
    return at[j] + shift


@njit(cache=True)
def capture(picture, values, n, half, room):
    """Move the nodes onto the best path of the strip, evenly spaced; return their number.

    values, room : those of a `Line` and a `Workspace`
    """
    nodes, scratch = nodes_of(values), scratch_of(room)
    if n < SHORTEST:
        return resample(nodes.x, nodes.y, n, scratch.room)
    x, y, nx, ny = nodes.x, nodes.y, scratch.normal_x, scratch.normal_y
    normals(x, y, n, nx, ny)
    gains = np.empty(((n - 1) // STATION + 1, strip_width(half)), FLOAT)
    at = np.empty_like(gains)
    strip_gains(picture, nodes, nx, ny, half, gains, at)
    stations = len(gains)
    path = np.empty(stations)
    best_path(gains, stations, half, SLOPE_COST, OFFSET_COST, path)
    for i in range(stations):
        path[i] = _peak(gains[i], at[i], int(path[i]) + half, 2 * half)
    # The path is that of whole pixels: smooth it over ±4 stations before it moves the nodes.
    smooth = np.empty(stations)
    for i in range(stations):
        reach = min(4, i, stations - 1 - i)
        total = 0.0
        for k in range(-reach, reach + 1):
            total += path[i + k]
        smooth[i] = total / (2 * reach + 1)
    for i in range(n):
        f = i / STATION
        j = min(int(f), stations - 1)
        k = min(j + 1, stations - 1)
        u = smooth[j] + (smooth[k] - smooth[j]) * (f - j)
        x[i] += u * nx[i]
        y[i] += u * ny[i]
    return resample(x, y, n, scratch.room)
