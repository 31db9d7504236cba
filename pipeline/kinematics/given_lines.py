"""Lines that another program traced, converted to centrelines as the tracker here has them.

The tracker's centrelines have nodes 1 px apart on a smooth curve, and for each node an unsmoothed
measurement with its Fisher information. Here the curve comes from the other program's points,
smoothed over about a third of a millimetre, and the information from their scatter about it.
"""

from dataclasses import replace

import numpy as np
from scipy.special import chdtri

from pipeline.kinematics.curvature import BLOCK_PX, NOISE_DEGREE
from pipeline.numerics.polyline import arc_along
from pipeline.numerics.runs import evenly
from pipeline.tables.centrelines import Centrelines

SMOOTHED_NODES, SMOOTHED_DEGREE = 21, 3  # the curve is a running cubic
FARTHEST_PX = 1e5  # of a point from the first pixel: what lies beyond is damage
FEWEST_NODES = SMOOTHED_NODES + 4  # of a line that is used
FREE_BLOCKS = 3  # at least, beyond those that the polynomial takes
NOISY_ROWS = 200  # of each whisker: enough to estimate its noise
USUAL_NOISE_PX = 0.3  # where the lines are too short to show it
LEAST_NOISE_PX = 0.02


def as_centrelines(lines: Centrelines) -> Centrelines:
    """Return the lines with nodes 1 px apart, raw offsets and information, without short ones.

    Lines that have information are taken to be centrelines already.
    """
    lines = _without_unused_names(lines)
    if lines.information is not None:
        return lines
    rows, kept = [], []
    for i in range(len(lines)):
        points = _distinct(lines.row(i).astype(float))
        if len(points) >= FEWEST_NODES:
            rows.append(_smoothed(points))
            kept.append(i)
    made = _without_unused_names(_assembled(lines, kept, rows))
    sd = _noise(made)[made.whisker]
    per_point = np.repeat(sd, np.diff(made.offsets)).astype(np.float32)
    return replace(made, se_px=per_point, information=per_point**-2)


def _without_unused_names(lines):
    """The lines without names that no line has."""
    used, whisker = np.unique(lines.whisker, return_inverse=True)
    names = tuple(lines.names[k] for k in used)
    return replace(lines, names=names, whisker=whisker.astype(np.int32))


def is_place(xy):
    """Which points (…, 2) [px] may lie in a picture; not those that are no numbers."""
    return (np.abs(xy) < FARTHEST_PX).all(axis=-1)


def _distinct(points):
    """Points (n, 2) without those that are none, or equal the one before."""
    points = points[is_place(points)]
    steps = np.hypot(*np.diff(points, axis=0, prepend=-FARTHEST_PX).T)  # the first is kept
    return points[steps > 1e-3]


def _smoothed(points):
    """A smooth curve's nodes 1 px apart, x and y [px], and each node's raw offset; (3, nodes)."""
    from scipy.signal import savgol_filter  # takes half a second, which other runs need not spend

    curve = savgol_filter(points, SMOOTHED_NODES, SMOOTHED_DEGREE, axis=0)
    tangent = np.gradient(curve, axis=0)
    tangent /= np.hypot(*tangent.T)[:, None]
    away = points - curve
    offset = away[:, 0] * tangent[:, 1] - away[:, 1] * tangent[:, 0]  # normal: (ty, −tx)
    s = arc_along(curve)
    at = np.arange(int(s[-1]) + 1)
    return np.stack([np.interp(at, s, values) for values in (*curve.T, offset)])


def _assembled(lines, kept, rows) -> Centrelines:
    """The rows as `Centrelines`, with the frames and whiskers of the lines `kept`."""
    *points, offset = np.concatenate([np.empty((3, 0)), *rows], axis=1).astype(np.float32)
    counts = [row.shape[1] for row in rows]
    return Centrelines.of_points(
        lines.names, lines.frame[kept], lines.whisker[kept], counts, points,
        se_px=np.zeros_like(offset), confidence=lines.confidence[kept], offset_px=offset,
        thickness_px=np.full_like(offset, np.nan),
    )  # fmt: skip


def _noise(lines) -> np.ndarray:
    """Standard deviation of a whisker's points across it, as if they were independent [px]."""
    out = np.full(len(lines.names), USUAL_NOISE_PX)
    for k in range(len(out)):
        rows = np.flatnonzero(lines.whisker == k)
        rows = rows[:: 1 + len(rows) // NOISY_ROWS]
        variances = [v for v in (_row_variance(lines, i) for i in rows) if v is not None]
        if variances:
            out[k] = max(np.sqrt(np.median(variances)), LEAST_NOISE_PX)
    return out


def _row_variance(lines, i):
    """Noise variance of one row, by its block means about a polynomial; None: too short."""
    part = slice(lines.offsets[i], lines.offsets[i + 1])
    points = lines.row(i).astype(float)
    blocks = len(points) // BLOCK_PX
    if blocks < NOISE_DEGREE + 1 + FREE_BLOCKS:
        return None
    tangent = np.gradient(points, axis=0)
    tangent /= np.hypot(*tangent.T)[:, None]
    normal = np.stack([tangent[:, 1], -tangent[:, 0]], axis=1)
    raw = points + lines.offset_px[part][:, None] * normal
    u = np.linspace(-1, 1, len(points))
    basis, _ = np.linalg.qr(np.polynomial.legendre.legvander(u, NOISE_DEGREE))
    away = np.sum((raw - basis @ (basis.T @ raw)) * normal, axis=1)
    n = blocks * BLOCK_PX
    means = away[:n].reshape(blocks, -1).mean(axis=1)
    taken = BLOCK_PX * np.sum(basis[:n].reshape(blocks, BLOCK_PX, -1).mean(axis=1) ** 2)
    return BLOCK_PX * np.sum(means**2) / chdtri(blocks - taken, 0.5)  # so its median is right


def sample_of(lines: Centrelines, most: int = 48) -> Centrelines:
    """Return up to `most` rows of each whisker, evenly spread over the video."""
    rows = []
    for k in range(len(lines.names)):
        own = np.flatnonzero(lines.whisker == k)
        rows.append(own[evenly(len(own), most)])
    return lines.rows(np.concatenate([np.empty(0, int), *rows]))


def chunks_of(lines: Centrelines, frames: int):
    """Yield the lines in chunks of so many frames, by frame."""
    lines = lines.rows(np.argsort(lines.frame, kind="stable"))
    stop = int(lines.frame[-1]) + 1 if len(lines) else 0
    for start in range(0, max(stop, 1), frames):
        first, last = np.searchsorted(lines.frame, [start, start + frames])
        yield lines.rows(np.arange(first, last))
