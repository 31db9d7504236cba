"""Figures over videos: the pooled value, its interval, and the range from video to video.

Errors are shared by a video: its hidden length, its rest shape, its fur. So intervals resample
videos, not contacts (a bootstrap in clusters).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

DRAWS = 1000
INTERVAL = 0.025, 0.975


@dataclass(frozen=True)
class Spread:
    """A figure of several videos: pooled, its 95 % interval, least and largest of one video."""

    value: float
    low: float
    high: float
    least: float
    most: float
    videos: int


def spread(samples: list[np.ndarray], statistic: Callable, rng) -> Spread:
    """`statistic` of the samples of all videos together; `samples` has an array per video.

    NaN where nothing is known, and an interval of NaN for a single video.
    """
    samples = [each[np.isfinite(each)] for each in (np.asarray(s, float) for s in samples)]
    samples = [each for each in samples if len(each)]
    if not samples:
        return Spread(*[np.nan] * 5, 0)
    single = [float(statistic(each)) for each in samples]
    n, interval = len(samples), (np.nan, np.nan)
    if n > 1:
        draws = rng.integers(0, n, (DRAWS, n))
        drawn = [statistic(np.concatenate([samples[k] for k in row])) for row in draws]
        interval = np.quantile(drawn, INTERVAL)
    value = float(statistic(np.concatenate(samples)))
    return Spread(value, *map(float, interval), min(single), max(single), n)
