"""Noise of pixels: variance against intensity, from frames in time or from one picture."""

import cv2
import numpy as np
from numba import njit

from pipeline.numerics.robust import trimmed_part

WINDOW_SD = 3.0  # of its noise: values of a pixel that are farther off are of what moves
LEAST_VARIANCE = 1 / 12  # of rounding to grey levels
WINDOWED_VARIANCE = 0.9733  # of a normal variable within WINDOW_SD, in units of its own
TRIMMED_SHARE = 0.8  # of the pixels, the least varying: whiskers and fur move in the others
SECOND_FREEDOM = 9  # of 25 squared second differences, which share pixels
N_BINS = 16  # of intensity, in the fit of the noise


def noise_from_ranks(ordered):
    """First guess of the noise: mid to upper ranks of a pixel, which whiskers seldom touch."""
    n = len(ordered)
    middle = ordered[n // 2, ::3, ::3].astype(np.float32)
    upper = ordered[round(0.84 * (n - 1)), ::3, ::3].astype(np.float32)
    return fit_noise(middle, cv2.blur((upper - middle) ** 2, (5, 5)) + LEAST_VARIANCE, 25)


@njit(cache=True)
def windowed_moments(ordered, centre, window):
    """Mean and variance over time of the values within `window` of `centre`, per pixel."""
    n, height, width = ordered.shape
    mean = np.empty((height, width), np.float32)
    variance = np.empty((height, width), np.float32)
    sums = np.empty((3, width), np.float32)
    count, total, square = sums
    for row in range(height):
        sums[:] = 0.0
        for k in range(n):
            for column in range(width):
                value = np.float32(ordered[k, row, column]) - centre[row, column]
                inside = np.float32(abs(value) <= window[row, column])
                count[column] += inside
                total[column] += inside * value
                square[column] += inside * value * value
        for column in range(width):
            used = max(float(count[column]), 1.0)
            shift = total[column] / used
            mean[row, column] = centre[row, column] + shift
            variance[row, column] = (square[column] - used * shift * shift) / max(used - 1, 1.0)
    return mean, variance


def fit_noise(image, variance, freedom):
    """(floor, gain) of variance = floor + gain × intensity, from variances per pixel.

    Each is of `freedom` degrees of freedom. In bins of intensity, the mean of the lower
    TRIMMED_SHARE is taken (whiskers and fur that move are in the rest), then a line.
    """
    step = 1 + image.size // 20_000
    intensity, variance = image.ravel()[::step], variance.ravel()[::step]
    edges = np.linspace(intensity.min(), intensity.max() + 1e-3, N_BINS + 1)
    bins = np.digitize(intensity, edges) - 1
    counts = np.bincount(bins, minlength=N_BINS)
    filled = np.flatnonzero(counts >= min(50, counts.max()))
    x = np.array([intensity[bins == b].mean() for b in filled])
    y = np.array([_trimmed_mean(variance[bins == b]) for b in filled])
    variance = y / trimmed_part(TRIMMED_SHARE, freedom)
    return _fit_line(x, np.maximum(variance, LEAST_VARIANCE), counts[filled])


def _trimmed_mean(values):
    return np.sort(values)[: max(round(TRIMMED_SHARE * len(values)), 1)].mean()


def _fit_line(x, y, counts):
    """Line y = floor + gain × x with floor at least LEAST_VARIANCE and gain >= 0.

    The least sum of |log(line / y)| × counts: bins far off (whiskers that rest) count little.
    """
    floors = np.geomspace(LEAST_VARIANCE, max(y.max(), 2 * LEAST_VARIANCE), 24)
    gains = np.append(0, np.geomspace(1e-4, max(y.max() / max(x.max(), 1.0), 2e-4), 32))
    for _ in range(3):  # ever finer grids around the best
        lines = floors[:, None, None] + gains[:, None] * x
        cost = np.abs(np.log(lines / y)) @ counts
        a, b = np.unravel_index(np.argmin(cost), cost.shape)
        floor, gain = floors[a], gains[b]
        floors = np.linspace(floors[max(a - 1, 0)], floors[min(a + 1, len(floors) - 1)], 15)
        gains = np.linspace(gains[max(b - 1, 0)], gains[min(b + 1, len(gains) - 1)], 15)
    return float(floor), float(gain)


def spatial_noise(image: np.ndarray, n_averaged: int = 1) -> tuple[float, float]:
    """(floor, gain) of single frames, from the second differences of an average of them."""
    mask = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], np.float32)
    second = cv2.filter2D(image, cv2.CV_32F, mask)  # variance 36 σ²; smooth pictures give 0
    variance = cv2.blur(second**2, (5, 5)) / 36 * n_averaged
    return fit_noise(cv2.GaussianBlur(image, (0, 0), 2), variance, SECOND_FREEDOM)
