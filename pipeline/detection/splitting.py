"""Two whiskers seen as one broad line are taken apart.

Blur makes whiskers of one picture about equally broad. A line that is much broader than the
others lies upon two whiskers, close beside each other; what it leaves at its edges would pass for
two more.
"""

import numpy as np

LEAST_LINES = 4  # needed to know the usual breadth
USUAL_QUANTILE = 0.25  # of the lines' breadths: broader ones may be of two whiskers
BLURRED = 1.2  # times as broad at the tip as at the base
ROUNDS = 3  # of fitting two lines, each beside the other
EVEN = 0.5  # the fainter one's part of the darker one's absorbance, at least
CLEAR = 0.85  # quality of both, at least: what is expected of them is there


def usual_sigma(lines) -> float | None:
    """Half-width σ [px] of a single whisker's profile in this picture; None where few are seen."""
    if len(lines) < LEAST_LINES:
        return None
    return float(np.quantile([breadth(line) for line in lines], USUAL_QUANTILE))


def growth(line) -> float:
    """Half-width of a line at its tip over that at its base: above 1 where motion blurs it."""
    return float(line.sigma[line.n - 1] / line.sigma[0])


def breadth(line) -> float:
    """Half-width σ [px] of a line, root mean square over its proximal half."""
    sigma = line.sigma[: max(line.n // 2, 1)]
    return float(np.sqrt(sigma @ sigma / len(sigma)))


def is_broad(line, usual, factor, thickest_px) -> bool:
    """Whether a line is broader than `factor` times the usual σ, and than a whisker's radius adds.

    One that gets broader towards its tip is blurred by its own motion.
    """
    if growth(line) > BLURRED:
        return False
    sigma = breadth(line)
    excess = sigma**2 - usual**2
    return sigma > factor * usual and excess > thickest_px**2 / 3


def split(line, sigma, refine, like_whisker):
    """Two lines in the place of a broad one, or None where they are not better.

    Parameters
    ----------
    line : `detection.Line`
    sigma : half-width of a single whisker's profile [px]
    refine : function of (line, lines): refine it with those held in the background, in place
    like_whisker : function of a line: whether it is a whisker by itself
    """
    pair = [_beside(line, sigma, side) for side in (-1, 1)]
    for _ in range(ROUNDS):
        for one, other in (pair, pair[::-1]):
            refine(one, [other])
            if not like_whisker(one):
                return None
    dark = [float(np.median(each.amplitude[: each.n])) for each in pair]
    clear = min(each.quality for each in pair) >= CLEAR
    if not clear or min(dark) < EVEN * max(dark) or _crossed(*pair):
        return None
    return pair


def _beside(line, sigma, side):
    """Copy of a line with the usual breadth, moved to one side by what it is too broad."""
    out = line.copy()
    n = line.n
    shift = np.sqrt(np.maximum(line.sigma[:n] ** 2 - sigma**2, (0.5 * sigma) ** 2))
    tx, ty = np.gradient(line.x[:n]), np.gradient(line.y[:n])
    norm = np.maximum(np.hypot(tx, ty), 1e-9)
    out.x[:n] -= side * shift * ty / norm
    out.y[:n] += side * shift * tx / norm
    out.sigma[:] = sigma
    out.amplitude[:] = np.maximum(0.5 * line.amplitude * line.sigma / sigma, 0.02)
    return out


def narrowed(line, sigma):
    """Copy of a line with the usual breadth, to be refined: it will lie on the darker whisker."""
    out = line.copy()
    out.amplitude[:] = np.maximum(line.amplitude * line.sigma / sigma, 0.02)
    out.sigma[:] = sigma
    return out


def _crossed(one, other) -> bool:
    """Whether both lines lie upon each other over most of their proximal halves."""
    n = min(one.n, other.n) // 2
    gap = np.hypot(one.x[:n] - other.x[:n], one.y[:n] - other.y[:n])
    return bool(np.median(gap) < 1.0)
