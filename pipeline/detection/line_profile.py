"""The measurement model: how a thin dark line should look across a reference line.

A pixel at signed distance u from the whisker's centre reads

    I = g B (1 − a G(u − δ) − b) + noise,      G(u) = exp(−u²/2σ²)

with the background B, the frame's gain g, the line's absorbance a and blurred half-width σ, its
offset δ from the reference line and a local error b of the background. Weights are 1/variance of
a pixel, from the noise measured in the video. Pixels are used as they are, one row or column of
them per node of the reference line, so that no interpolation biases the centre.
"""

import numpy as np
from numba import njit

from pipeline.numerics.polyline import NARROWEST

# Rows of the `sums` array, which has a column per node: Σ over its pixels (cross_sections.py).
GG, G1, G11, GY, OY, YY, PIXELS, DD, DY, DG, D1, SS, SY, SG = range(14)
N_SUMS = 14
WINDOWED = PIXELS + 1  # the first ones

BELL_AREA = 2.5066  # √(2π): of exp(−u²/2)
MOST_MISFIT = 5.0  # where dark whiskers cross, a line must not bend from one to the other
LANES = 8  # values that a vector instruction takes at a time
SINGLE = np.float32


@njit(cache=True, inline="always")
def section_at(x, y, tx, ty):
    """The row or column of pixels that crosses a line at (x, y), where it runs along (tx, ty).

    Returns whether it is a column, its number, where along it the line's centre lies [px], and
    the normal's part along it: the tangent turned counter-clockwise on the screen, (ty, −tx).
    """
    columns = abs(tx) >= abs(ty)
    main, side = (tx, ty) if columns else (ty, tx)
    along, across = (x, y) if columns else (y, x)
    fixed = np.floor(along + 0.5)
    centre = across + (fixed - along) * side / (main if main != 0 else 1.0)
    scale = (-main if columns else main) / np.sqrt(tx * tx + ty * ty + NARROWEST)
    return columns, fixed, centre, scale


@njit(cache=True, inline="always")
def _section(x, y, i, n):
    """As `section_at`, at node `i` of a line of n nodes."""
    a, b = max(i - 1, 0), min(i + 1, n - 1)
    columns, fixed, centre, scale = section_at(x[i], y[i], x[b] - x[a], y[b] - y[a])
    return columns, int(fixed), centre, scale


@njit(cache=True, inline="always")
def bell(u):
    """exp(−u²/2) to 1e-6 in single precision: the 16th power of a series."""
    t = min(u * u * SINGLE(1 / 32), SINGLE(1))
    series = SINGLE(1 / 120) - t * SINGLE(1 / 720)
    series = SINGLE(1 / 6) - t * (SINGLE(1 / 24) - t * series)
    series = SINGLE(1) - t * (SINGLE(1) - t * (SINGLE(1 / 2) - t * series))
    series *= series
    series *= series
    series *= series
    return series * series


@njit(cache=True)
def window_amplitudes(sums, n, half, amplitude, baseline, amplitude_se, misfit):
    """Solve absorbance and background error in a running window of ±`half` nodes.

    The background error is held near zero by a weak prior (SD 0.03), so that a window with
    little in it does not trade one for the other. `misfit`: χ² per degree of freedom, 1 to
    `MOST_MISFIT`.
    """
    windows = np.empty((WINDOWED, n))
    _window_sums(sums, n, half, windows)
    _solve_windows(windows, n, amplitude, baseline, amplitude_se, misfit)


@njit(cache=True, error_model="numpy")
def _window_sums(sums, n, half, out):
    """Sums of the first `WINDOWED` rows over the nodes within ±`half` of each, into `out`."""
    total = np.zeros(WINDOWED)
    for i in range(-half, n):
        for row in range(WINDOWED):
            if i + half < n:
                total[row] += sums[row, np.uint64(i + half)]
            if i > half:
                total[row] -= sums[row, np.uint64(i - half - 1)]
            if i >= 0:
                out[row, np.uint64(i)] = total[row]


@njit(cache=True, error_model="numpy")
def _solve_windows(windows, n, amplitude, baseline, amplitude_se, misfit):
    """Absorbance, background error, the former's standard error, and misfit, from `windows`."""
    gg, g1, one, gy, oy = windows[GG], windows[G1], windows[G11], windows[GY], windows[OY]
    yy, pixels = windows[YY], windows[PIXELS]
    prior = 1.0 / 0.03**2
    for i in range(n):
        m = one[i] + prior
        det = gg[i] * m - g1[i] * g1[i]
        known = (gg[i] >= 1e-6) & (det >= 1e-9 * gg[i] * m)
        scale = 1.0 / det if known else 0.0
        amplitude[i] = (gy[i] * m - g1[i] * oy[i]) * scale
        baseline[i] = (oy[i] * gg[i] - gy[i] * g1[i]) * scale
        amplitude_se[i] = np.sqrt(m * scale) if known else 1e3
        squares = yy[i] - amplitude[i] * gy[i] - baseline[i] * oy[i]
        misfit[i] = min(max(squares / max(pixels[i] - 2.0, 1.0), 1.0), MOST_MISFIT)


@njit(cache=True)
def offset_information(sums, n, amplitude, baseline, misfit, information, score):
    """Fisher information [1/px²] and score [1/px] of every node's offset δ.

    Where the pixels are farther from the model than noise brings them, as in fur, beside another
    hair or after a codec, both are as if the noise were as large as what is left (`misfit`).
    """
    for i in range(n):
        a = max(amplitude[i], 0.0)
        information[i] = a * a * sums[DD, i] / misfit[i]
        error = sums[DY, i] - a * sums[DG, i] - baseline[i] * sums[D1, i]
        score[i] = a * error / misfit[i]


@njit(cache=True)
def width_correction(sums, amplitude, first, last):
    """Least-squares relative change of σ over the nodes first … last − 1, and its SE."""
    top = 0.0
    bottom = 1e-12
    for i in range(first, last):
        a = max(amplitude[i], 0.0)
        # ∂(a G)/∂ln σ = a u² G; part of it is absorbed by the absorbance itself
        mix = sums[SG, i] / sums[GG, i] if sums[GG, i] > 0 else 0.0
        slope_y = (sums[SY, i] - mix * sums[GY, i]) - a * (sums[SG, i] - mix * sums[GG, i])
        top += a * slope_y
        bottom += a * a * (sums[SS, i] - mix * sums[SG, i])
    return top / bottom, 1.0 / np.sqrt(bottom)


def gain_points(background, mask, rows=24, columns=6):
    """A grid of the pixels in `mask` by which `frame_gain` compares frames with a background.

    Every so many rows and columns: pixels of a row come from memory together. (Half as many rows
    of more pixels each are read sooner, but after a codec forces come out less exact.)
    Returns their places in the flat picture, int32 (k,), and 1/background there, float32 (k,):
    few bytes, as decoding leaves none of them in the cache.
    """
    grid = np.zeros(mask.shape, bool)
    grid[rows // 2 :: rows, columns // 2 :: columns] = True
    places = np.flatnonzero(grid & mask).astype(np.int32)
    return places, (1 / background.ravel()[places]).astype(np.float32)


@njit(cache=True)
def frame_gain(image, places, per_light):
    """Brightness of the frame over the background's, from a coarse grid of free pixels.

    A trimmed mean of I/B; whiskers cover far less than the trimmed part. places, per_light : as
    of `gain_points`.
    """
    pixels, count = image.ravel(), len(places)
    ratio = np.empty(count, np.float32)
    for k in range(count):
        ratio[k] = pixels[np.uint64(places[k])] * per_light[k]
    if count < 16:
        return 1.0
    mean, _ = _mean_near(ratio, count, 0.0, np.inf)
    for _ in range(3):
        trimmed, used = _mean_near(ratio, count, mean, 0.1)
        if used < 16:
            break
        mean = trimmed
    return mean


@njit(cache=True, fastmath={"reassoc", "nsz"})  # summed in any order, many at a time
def _mean_near(values, n, centre, reach):
    """Mean of those of the first `n` values within `reach` of `centre`, and how many they are."""
    total = 0.0
    count = 0.0
    for i in range(n):
        near = 1.0 if abs(values[i] - centre) < reach else 0.0
        total += near * values[i]
        count += near
    return total / max(count, 1.0), count


@njit(cache=True)
def strip_misfit(picture, x, y, n, sigma):
    """Weighted squares of image − gain × background over the sections within 3 σ of a line.

    picture : of `ImageModel`
    """
    image, background = picture.image, picture.background
    weight, gain = picture.weight, picture.gain
    height, width = background.shape
    total = 0.0
    for i in range(n):
        columns, fixed, centre, scale = _section(x, y, i, n)
        limit = height if columns else width
        if scale == 0.0 or not 0 <= fixed < (width if columns else height):
            continue
        span = (3.0 * sigma[i] + 1.0) / abs(scale)
        for moving in range(max(int(centre - span), 0), min(int(centre + span) + 1, limit)):
            row = moving if columns else fixed
            column = fixed if columns else moving
            off = image[row, column] - gain * background[row, column]
            total += weight[row, column] * off * off
    return total


@njit(cache=True)
def shadow(x, y, n, amplitude, sigma, shape):
    """Transmission 1 − a G of a line: the pixels about it (flat indices) and what passes there.

    A pixel that two sections share is there twice. shape : height and width of the picture
    """
    height, width = shape
    size = 0
    for i in range(n):
        size += int(6.0 * np.sqrt(2.0) * sigma[i]) + 2
    pixels, passing, count = np.empty(size, np.int32), np.empty(size, np.float32), 0
    last_column = -1
    last_row = -1
    for i in range(n):
        columns, fixed, centre, scale = _section(x, y, i, n)
        if scale == 0.0:
            continue
        if columns:
            if fixed == last_column or fixed < 0 or fixed >= width:
                continue
            last_column, last_row, limit = fixed, -1, height
        else:
            if fixed == last_row or fixed < 0 or fixed >= height:
                continue
            last_row, last_column, limit = fixed, -1, width
        span = 3.0 * sigma[i] / abs(scale)
        first = max(int(np.ceil(centre - span)), 0)
        last = min(int(np.floor(centre + span)), limit - 1)
        # the Gaussian from pixel to pixel: its ratio to the one before changes by a constant
        absorbance, step = min(amplitude[i], 0.98), scale / sigma[i]
        u = (first - centre) * step
        gauss, ratio = np.exp(-0.5 * u * u), np.exp(-step * (u + 0.5 * step))
        change = np.exp(-step * step)
        place, stride = (first * width + fixed, width) if columns else (fixed * width + first, 1)
        for _ in range(first, last + 1):
            pixels[count], passing[count] = place, 1.0 - absorbance * gauss
            count += 1
            place += stride
            gauss *= ratio
            ratio *= change
    return pixels[:count], passing[:count]


@njit(cache=True)
def shade(background, x, y, n, amplitude, sigma):
    """Multiply a line's `shadow` into a background; return its pixels and what passes there."""
    pixels, passing = shadow(x, y, n, amplitude, sigma, background.shape)
    darken(background, pixels, passing)
    return pixels, passing


@njit(cache=True)
def darken(background, pixels, passing):
    """Multiply a line's transmission into a background, of which it hides that much."""
    light = background.ravel()
    for k in range(len(pixels)):
        light[np.uint64(pixels[k])] *= passing[k]


@njit(cache=True)
def lighten(background, pixels, passing):
    """Undo `darken`, to rounding."""
    light = background.ravel()
    for k in range(len(pixels)):
        light[np.uint64(pixels[k])] /= passing[k]


@njit(cache=True)
def restore(background, pixels, before):
    """Give pixels the values that they have in `before`."""
    light, known = background.ravel(), before.ravel()
    for k in range(len(pixels)):
        at = np.uint64(pixels[k])
        light[at] = known[at]
