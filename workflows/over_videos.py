"""Figures over videos: the value of all together, with the range of single ones or an interval.

Errors are shared by a video: its hidden length, its rest shape, its fur. So intervals resample
videos, not contacts (a bootstrap in clusters).
"""

import numpy as np

DRAWS = 1000
INTERVAL = 0.025, 0.975


def with_range(samples: list[np.ndarray], statistic) -> tuple[float, float, float]:
    """`statistic` of all videos' samples together, and its least and largest of one video.

    `samples` has an array per video; NaN where nothing is known.
    """
    samples = _known(samples)
    if not samples:
        return np.nan, np.nan, np.nan
    single = [float(statistic(each)) for each in samples]
    return float(statistic(np.concatenate(samples))), min(single), max(single)


def with_interval(samples: list[np.ndarray], statistic, rng) -> tuple[float, float, float]:
    """As `with_range`, with the ends of the value's 95 % interval, NaN for a single video."""
    value, samples = with_range(samples, statistic)[0], _known(samples)
    if len(samples) < 2:
        return value, np.nan, np.nan
    draws = rng.integers(0, len(samples), (DRAWS, len(samples)))
    drawn = [statistic(np.concatenate([samples[k] for k in row])) for row in draws]
    low, high = np.quantile(drawn, INTERVAL)
    return value, float(low), float(high)


def _known(samples):
    samples = [each[np.isfinite(each)] for each in (np.asarray(s, float) for s in samples)]
    return [each for each in samples if len(each)]
