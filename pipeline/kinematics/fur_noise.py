"""Errors by fur in the first visible part of a whisker, which therefore counts less.

Fur that moves with the whisker, or lies across it, shifts the first millimetre of the trace by
some hundredths of a pixel; extrapolated into the hidden part, that turns the base by a degree. It
is recognised by a misfit that changes from frame to frame: a curve is fitted farther out and
continued towards the face, and its misfit there is compared with that of the same continuation one
reach farther out, where there is no fur. So neither noise (also a codec's) nor a bend that the
curve does not follow is taken for fur.
"""

from dataclasses import replace

import numpy as np
from numba import njit

from pipeline.kinematics.base_curves import FEWEST_ROWS, TRIMMED, TRIMMED_MEAN
from pipeline.kinematics.follicle import FollicleFinder, rough_base
from pipeline.session.parameters import KinematicsParams
from pipeline.tables.centrelines import Centrelines

ORDINARY = 2.5  # ratio of misfits that may be chance


def locate_follicles(chunks, samples: Centrelines, options):
    """Yield the chunks with every row's hidden length.

    Points that fur shifts get less information (`FurNoise`). The chunks stay as they are where
    the hidden lengths are not known, or a whisker has no sample.

    Parameters
    ----------
    chunks : `Centrelines`, in order
    samples : `Centrelines` of frames from the whole video, of all whiskers
    options : the tracker's lengths (`TracingOptions`)
    """
    params = options.params.kinematics
    sampled = len(np.unique(samples.whisker)) == len(samples.names) > 0
    if len(options.hidden_px) != len(samples.names) or not sampled:
        yield from chunks
        return
    noise = FurNoise(samples, options.pixels_per_m, params)
    finder = FollicleFinder(noise.weigh(samples), options.hidden_px, options.pixels_per_m, params)
    for chunk in chunks:
        yield finder.place(noise.weigh(chunk))


class FurNoise:
    """Excess error of the first visible part of each whisker, by fur, over that by noise.

    Parameters
    ----------
    samples : Centrelines of frames from the whole video
    pixels_per_m : scale
    params : the room's parameters

    Attributes
    ----------
    excess : (names, nodes) variance of the misfit over that of noise, 1 where there is no fur
    """

    def __init__(self, samples: Centrelines, pixels_per_m: float, params: KinematicsParams):
        block = max(round(1e-3 * params.fur_block_mm * pixels_per_m), 1)
        blocks = max(round(params.fur_reach_mm / params.fur_block_mm), 1)
        window = round(1e-3 * params.fur_window_mm * pixels_per_m)
        misfit = np.full((len(samples), 2, blocks), np.nan)
        _misfits(
            samples.offsets,
            *(np.asarray(a, float) for a in (samples.x_px, samples.y_px, samples.offset_px)),
            samples.information.astype(float), block, window, misfit,
        )  # fmt: skip
        leverage = _leverage(block, blocks, window)
        names = range(len(samples.names))
        excess = [_excess(misfit[samples.whisker == k], leverage) for k in names]
        self.excess = np.repeat(np.reshape(excess, (-1, blocks)), block, axis=1)

    def weigh(self, lines: Centrelines) -> Centrelines:
        """Return the lines with the information of their first points reduced where fur errs."""
        if not (self.excess > 1).any():
            return lines
        information = lines.information.copy()
        _weaken(lines.offsets, lines.whisker, self.excess, information)
        return replace(lines, information=information)


@njit(cache=True)
def _misfits(offsets, xs, ys, raw, info, block, window, out):
    """Squared block misfits over their variance, near the fur and one reach farther out."""
    blocks = out.shape[2]
    reach = block * blocks
    for row in range(len(offsets) - 1):
        a, b = offsets[row], offsets[row + 1]
        if b - a < 2 * reach + window:
            continue
        line = xs[a:b], ys[a:b], raw[a:b], info[a:b]
        for place in range(2):
            _block_misfits(line, (place + 1) * reach, block, window, out[row, place])


@njit(cache=True)
def _block_misfits(line, start, block, window, out):
    """As of `_misfits`, of the blocks before node `start`, out of the curve behind it."""
    x, y, offset, information = line
    reach = block * len(out)
    mx, my, theta, k0, k1 = rough_base(x, y, offset, information, start, start + window)
    total, weight = 0.0, 0.0
    for i in range(start - 1, start - reach - 1, -1):
        middle = theta + (i + 0.5 - start) * (k0 + 0.5 * k1 * (i + 0.5 - start))
        mx -= np.cos(middle)
        my += np.sin(middle)
        angle = theta + (i - start) * (k0 + 0.5 * k1 * (i - start))
        r = -(x[i] - mx) * np.sin(angle) - (y[i] - my) * np.cos(angle) + offset[i]
        total += information[i] * r
        weight += information[i]
        if (i - start + reach) % block == 0:
            if weight > 0:
                out[(i - start + reach) // block] = total * total / weight
            total, weight = 0.0, 0.0


def _leverage(block, blocks, window):
    """Variance of the continued cubic in the middle of each block, in a block's own noise."""
    u = 1 + 2 * block * (blocks - 0.5 - np.arange(blocks)) / window
    powers = np.polynomial.legendre.legvander(u, 3) ** 2
    return powers @ np.array([1, 3, 5, 7]) * block / window


def _excess(misfit, leverage):
    """Variance of each block over its noise, for the `misfit` (rows, places, blocks)."""
    known = np.isfinite(misfit).all(axis=(1, 2))
    if known.sum() < FEWEST_ROWS:
        return np.ones(misfit.shape[2])
    ordered = np.sort(misfit[known], axis=0)[: int(TRIMMED * known.sum())]
    near, far = ordered.mean(axis=0) / TRIMMED_MEAN
    ratio = near / np.maximum(far, 1 + leverage)
    excess = 1 + np.maximum(ratio - ORDINARY, 0) * (1 + leverage)
    excess = np.maximum.accumulate(excess[::-1])[::-1]  # the nearer to the face the more fur
    return np.maximum(excess, np.roll(excess, 1))  # which has no sharp end


@njit(cache=True)
def _weaken(offsets, whisker, excess, information):
    for row in range(len(offsets) - 1):
        start = offsets[row]
        for i in range(min(excess.shape[1], offsets[row + 1] - start)):
            information[start + i] /= excess[whisker[row], i]
