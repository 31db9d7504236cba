"""Where a whisker begins and ends along its centreline, to a fraction of a pixel.

The darkness across the whisker, in units of its width, is α + β (s − e) inside the end e and 0
beyond, blurred; it is fitted over a short stretch about the end.
"""

from typing import NamedTuple

import numpy as np
from scipy.ndimage import binary_dilation, median_filter
from scipy.optimize import least_squares
from scipy.special import ndtr

from pipeline.calibrate.cross_sections import BEYOND_PX, Sections, Straightened, profile_of
from pipeline.numerics.robust import MAD_TO_SD, robust_sd

INSIDE_PX = 60  # of the whisker that is fitted, or, of one that ends gradually, more
END_SE_PX = 0.1  # what ends are off by where pictures are rendered exactly
GRADUAL = 40  # px of length per px of half-width at the end
LEAST_RADIUS_PX = 0.35  # of the profile by which the darkness is weighed
FLANK_PX = 12.0  # of ground beside the whisker
DUST_PX = 61  # over which specks stand out from the whisker's width
DUST_SDS, WILD_SDS, DUST_SHARE = 5.0, 4.0, 0.1
SOFT_SDS = 2.5  # from which residuals count less
EDGE_PX = 3.0  # a whisker that ends nearer to the picture's border goes on beyond it


class End(NamedTuple):
    """An end of a whisker [px] along the centreline, and its standard error."""

    s: float
    se: float


def find_end(straight: Straightened, sections: Sections, cone, last: bool) -> End:
    """Find one end of a whisker.

    Parameters
    ----------
    straight, sections : of the whisker
    cone : half-width [px] at `s` [px], a function, roughly
    last : the end at the largest `s`, else that at the smallest
    """
    s = straight.s if last else -straight.s[::-1]
    grey = straight.grey if last else straight.grey[::-1]
    near = s[-1] - BEYOND_PX
    radius = np.maximum(cone(s if last else -s), LEAST_RADIUS_PX)
    reach = int(np.clip(GRADUAL * (6 - cone(near if last else -near)), INSIDE_PX, len(s) // 6))
    rows = s > near - reach
    profile = profile_of(radius[rows], straight.u, sections.blur)
    contrast = sections.contrast[-1 if last else 0]
    width, sd = _widths(grey[rows], straight.u, radius[rows], profile, contrast)
    clean = np.abs(width - median_filter(width, DUST_PX)) < WILD_SDS * sd + DUST_SHARE * width
    end = _fit_end(s[rows][clean] - near, width[clean], sd, sections.blur)
    return End(near + end.s if last else -(near + end.s), end.se)


def leaves_the_picture(straight: Straightened, s, shape) -> bool:
    """Whether a whisker reaches the border of a picture of this shape at `s` [px]."""
    x, y = straight.place(s, 0.0)
    height, width = shape
    return bool(min(x, y, width - 1 - x, height - 1 - y) < EDGE_PX)


def _widths(grey, u, radius, profile, contrast):
    """Width [px] equivalent to the darkness of every row, and the SD of its noise."""
    dark = _darkness(grey, profile, _ground_and_line(grey, u, radius))
    width = 2 * radius * dark / contrast
    beyond = width[-BEYOND_PX + 15 :]
    sd = float(robust_sd(beyond))
    return width, max(sd, 1e-4)


def _ground_and_line(grey, u, radius):
    """1 where a row shows the whisker or the background beside it, 0 far off and at dust."""
    beside = (np.abs(u) > radius[:, None] + 4) & (np.abs(u) < radius[:, None] + FLANK_PX)
    ground = np.where(beside, grey, np.nan)
    level = np.nanmedian(ground, axis=1, keepdims=True)
    sd = MAD_TO_SD * np.nanmedian(np.abs(ground - level))
    dust = binary_dilation(beside & (np.abs(grey - level) > DUST_SDS * sd), iterations=2)
    near = np.abs(u) < radius[:, None] + FLANK_PX
    return (near & ~dust).astype(float)


def _darkness(grey, profile, window):
    """Least squares in every row: a sloping background minus a multiple of the profile."""
    u = np.linspace(-1, 1, grey.shape[1]) + 0 * grey
    basis = np.stack([np.ones_like(grey), u, -profile], axis=-1)
    weighed = basis * window[..., None]
    matrix = weighed.transpose(0, 2, 1) @ basis + 1e-6 * np.eye(3)
    rhs = np.einsum("nuk,nu->nk", weighed, grey)
    return np.linalg.solve(matrix, rhs[..., None])[:, 2, 0]


def _fit_end(s, width, sd, blur):
    """Least squares of the end e, the width there and its slope; s from the traced end."""

    def inside(q):
        end, at_end, slope = q
        gone = ndtr((end - s) / blur)
        return np.maximum(at_end + slope * (end - s), 0) * gone

    # a grid of ends first: the sum of squares has more than one hollow
    ends = np.arange(s[0] + 25, s[-1] - 5, 1.0)
    starts = [_linear_start(s, width, e) for e in ends]
    cost = [np.hypot(1, (inside(q) - width) / (SOFT_SDS * sd)).sum() for q in starts]
    best = starts[int(np.argmin(cost))]
    bounds = ([s[0], 0.0, -np.inf], [s[-1], np.inf, np.inf])
    best[1] = max(best[1], 1e-6)
    solved = least_squares(
        lambda q: (inside(q) - width) / sd, best, bounds=bounds, loss="soft_l1",
        f_scale=SOFT_SDS,
        x_scale=[1.0, 0.1, 0.01],
    )  # fmt: skip
    spread = max(1.0, float(robust_sd(solved.fun, about=0.0)))
    covariance = np.linalg.pinv(solved.jac.T @ solved.jac) * _together(solved.fun)
    se = np.hypot(spread * np.sqrt(covariance[0, 0]), END_SE_PX)
    return End(float(solved.x[0]), float(se))


def _linear_start(s, width, end):
    """End, width and slope there, from a line through the widths inside `end`."""
    rows = s < end
    basis = np.column_stack([np.ones(rows.sum()), end - s[rows]])
    (at_end, slope), *_ = np.linalg.lstsq(basis, width[rows], rcond=None)
    return np.array([end, max(at_end, 0.0), slope])


def _together(residual):
    """How much larger the variance of a mean of these residuals is than of independent ones."""
    centred = residual - residual.mean()
    power = float(centred @ centred) or 1.0
    lags = [float(centred[k:] @ centred[:-k]) / power for k in range(1, 5)]
    return max(1.0 + 2 * sum(lags), 1.0)
