"""Derivatives of a picture by a Gaussian, many pixels at a time.

Each is the product of one filter along rows and one along columns. Along rows the whole picture is
filtered at once; along columns row by row, as long as the rows about it are in the cache.
"""

import numpy as np
from numba import njit


def gaussian_kernels(scale: float):
    """Return the Gaussian of SD `scale` [px] and its first two derivatives, sampled, float32."""
    reach = int(np.ceil(4 * scale))
    u = np.arange(-reach, reach + 1, dtype=float)
    g = np.exp(-(u**2) / (2 * scale**2))
    g /= g.sum()
    first = -u / scale**2 * g
    second = (u**2 / scale**4 - 1 / scale**2) * g
    second -= second.mean()
    return g.astype(np.float32), first.astype(np.float32), second.astype(np.float32)


def halves(kernels):
    """Of odd or even kernels, from the middle on, float32 (3, reach + 1)."""
    return np.array([kernel[len(kernel) // 2 :] for kernel in kernels])


@njit(cache=True, error_model="numpy")
def along_rows(image, part, kernels):
    """Rows of a part of a picture, float32, by a Gaussian and its first two derivatives.

    part : as of `rectangles.bounds`; kernels : as in `halves`.
    Returns float32 (3, height + 2 reach, width) of the part, which goes on mirrored above and
    below, as it does beside its edges.
    """
    top, bottom, left, right = part
    height, width = bottom - top, right - left
    reach = kernels.shape[1] - 1
    out = np.empty((3, height + 2 * reach, width), np.float32)
    padded = np.empty(width + 2 * reach, np.float32)
    for row in range(height):
        padded[reach : reach + width] = image[top + row, left:right]
        for k in range(1, reach + 1):
            padded[reach - k] = padded[reach + min(k, width - 1)]
            padded[reach + width - 1 + k] = padded[reach + width - 1 - min(k, width - 1)]
        to = row + reach
        _filter(out[0, to], out[1, to], out[2, to], padded, kernels)
    for k in range(1, reach + 1):
        off = min(k, height - 1)
        out[:, reach - k] = out[:, reach + off]
        out[:, reach + height - 1 + k] = out[:, reach + height - 1 - off]
    return out


@njit(cache=True, error_model="numpy")
def _filter(smooth, first, second, padded, kernels):
    """Fill three rows (width,) from a `padded` one (width + 2 reach,)."""
    reach, width = kernels.shape[1] - 1, len(smooth)
    middle, even, bent = padded[reach : reach + width], kernels[0, 0], kernels[2, 0]
    for i in range(width):
        smooth[i], first[i], second[i] = even * middle[i], np.float32(0), bent * middle[i]
    for k in range(1, reach + 1):
        even, odd, bent = kernels[0, k], kernels[1, k], kernels[2, k]
        before, behind = padded[reach - k :], padded[reach + k :]
        for i in range(width):
            both = before[i] + behind[i]
            smooth[i] += even * both
            first[i] += odd * (before[i] - behind[i])
            second[i] += bent * both


@njit(cache=True, error_model="numpy")
def second_derivatives(rows, row, kernels, xx, yy, xy):
    """Fill the second derivatives of one row of the picture, (width,) each.

    rows : as in `along_rows`
    """
    reach, width = kernels.shape[1] - 1, len(xx)
    smooth, first, second, here = rows[0], rows[1], rows[2], row + reach
    s, ss, even, bent = smooth[here], second[here], kernels[0, 0], kernels[2, 0]
    for i in range(width):
        xx[i], yy[i], xy[i] = even * ss[i], bent * s[i], np.float32(0)
    for k in range(1, reach + 1):
        even, odd, bent = kernels[0, k], kernels[1, k], kernels[2, k]
        s, f, ss = smooth[here - k], first[here - k], second[here - k]
        t, g, tt = smooth[here + k], first[here + k], second[here + k]
        for i in range(width):
            xx[i] += even * (ss[i] + tt[i])
            yy[i] += bent * (s[i] + t[i])
            xy[i] += odd * (f[i] - g[i])


@njit(cache=True, error_model="numpy")
def first_derivatives(rows, row, kernels, columns, x, y):
    """Fill the first derivatives at some columns of one row of the picture, (columns,) each."""
    reach, count = kernels.shape[1] - 1, len(columns)
    smooth, first, here = rows[0], rows[1], row + reach
    f, even = first[here], kernels[0, 0]
    for i in range(count):
        x[i], y[i] = even * f[np.uint64(columns[i])], np.float32(0)
    for k in range(1, reach + 1):
        even, odd = kernels[0, k], kernels[1, k]
        s, f, t, g = smooth[here - k], first[here - k], smooth[here + k], first[here + k]
        for i in range(count):
            at = np.uint64(columns[i])
            x[i] += even * (f[at] + g[at])
            y[i] += odd * (s[at] - t[at])


@njit(cache=True, error_model="numpy")
def second_along_rows(rows, kernels, first, step):
    """The second derivative along rows at every `step`-th pixel from the `first` on, either way.

    rows : as in `along_rows`. The numbers of its rows and columns follow from the picture's.
    """
    reach = kernels.shape[1] - 1
    height, width = rows.shape[1] - 2 * reach, rows.shape[2]
    out = np.empty((len(range(first, height, step)), len(range(first, width, step))), np.float32)
    for i in range(out.shape[0]):
        here = first + step * i + reach
        for j in range(out.shape[1]):
            at = first + step * j
            total = kernels[0, 0] * rows[2, here, at]
            for k in range(1, reach + 1):
                total += kernels[0, k] * (rows[2, here - k, at] + rows[2, here + k, at])
            out[i, j] = total
    return out
