"""A line fitted to its whisker to subpixel accuracy, from rough or predicted nodes.

Gauss–Newton on the raw pixels (cross_sections.py) for a spline offset, until it hardly moves the
line; then its base, where it leaves the face, and its visible end. A line that is farther off is
first brought near by tracking/search.py.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from pipeline.detection import cross_sections, line_profile
from pipeline.detection.line import nodes_of, scratch_of
from pipeline.numerics import bsplines
from pipeline.numerics.polyline import bilinear, normals, resample

STIFFNESS = 40.0  # 1/px²: third differences of the line over three knots are about 0.15 px
STRAIGHTNESS = 4e4  # px, × ∫ κ² ds: a line is straight where fur or a neighbour hides the whisker
SHORTEST = 12  # nodes that a line needs to be one
MOST_STEPS = 4  # of Gauss–Newton
STILL_SEEN = 0.95  # part of a line in the next frame, where it lies just as predicted
SHORT_STEP = 0.1  # px: what this leaves out is some thousandths of a pixel's error
BEYOND_TIP, TIP_STEP = 30, 0.4  # nodes, px: where it moves more there, the tip is still sought, …
SAME_TIP = 1  # … unless it was within so many nodes where it is now the step before
WIDEST_GAP = 8  # bridges: longer stretches without pixels are not crossed
ALONG, STEEP = 8, 0.5  # off an edge steeply, seen over so many nodes to both sides: not along it
SLID = 0.25  # the same where a line begins: at some 15° off the face's edge whiskers do grow
SEEN_SD = 2.5  # standard errors by which a node is seen
FLOAT, HALF = np.float32, np.float32(0.5)


class Fit(NamedTuple):
    """How a line is fitted.

    Attributes
    ----------
    bridge : nodes without pixels that are crossed
    longest : nodes that the line may have
    farthest : largest first step [px]
    widths : whether `Scratch.sums` are filled for the half-width, too
    faintest : absorbance below which nothing is seen
    unseen : nodes in a row that may not be seen, though there are pixels
    half : half-width of the window of nodes that absorbance is measured over
    steps : of Gauss–Newton, at most
    """

    bridge: int
    longest: float
    farthest: float
    widths: bool
    faintest: float
    unseen: int
    half: int
    steps: int


@njit(cache=True)
def extend(x, y, n, backward, amount, fit):
    """Lengthen a line by `amount` nodes at its tip, or at its base where `backward`.

    The last `fit` nodes give direction and curvature; half the curvature is carried on, as a
    whisker that is pressed straightens beyond. Returns the new number of nodes.
    """
    fit = min(fit, n - 1)
    if fit < 4:
        return n
    if backward:
        a, m, b = fit, fit // 2, 0
    else:
        a, m, b = n - 1 - fit, n - 1 - fit // 2, n - 1
    d1x = x[m] - x[a]
    d1y = y[m] - y[a]
    d2x = x[b] - x[m]
    d2y = y[b] - y[m]
    first = np.arctan2(d1y, d1x)
    turn = np.arctan2(d1x * d2y - d1y * d2x, d1x * d2x + d1y * d2y)
    rate = turn / (0.5 * fit)
    angle = first + turn + rate * 0.25 * fit
    rate *= 0.5
    limit = len(x)
    if n + amount > limit:
        amount = limit - n
    if backward:
        for i in range(n - 1, -1, -1):
            x[i + amount] = x[i]
            y[i + amount] = y[i]
        for k in range(1, amount + 1):
            angle += rate
            x[amount - k] = x[amount - k + 1] + np.cos(angle)
            y[amount - k] = y[amount - k + 1] + np.sin(angle)
    else:
        for k in range(amount):
            angle += rate
            x[n + k] = x[n + k - 1] + np.cos(angle)
            y[n + k] = y[n + k - 1] + np.sin(angle)
    return n + amount


@njit(cache=True)
def carry_on(x, y, amplitude, n, whole_x, whole_y, whole_amplitude, m, weight, reach):
    """Lengthen a line whose tip goes behind something by what was seen beyond before.

    Nodes n … m − 1 of the `whole` line, turned and shifted, go on where the line ends, if within
    `reach` nodes of its end pixels without weight inside the picture hide it. Changes x, y and
    amplitude in place; returns the new number of nodes.
    """
    fit = min(40, n - 1)
    m = min(m, len(x))
    if m <= n or fit < 4:
        return n
    ux, uy = x[n - 1] - x[n - 1 - fit], y[n - 1] - y[n - 1 - fit]
    vx, vy = whole_x[n - 1] - whole_x[n - 1 - fit], whole_y[n - 1] - whole_y[n - 1 - fit]
    norm = max(np.sqrt((ux * ux + uy * uy) * (vx * vx + vy * vy)), 1e-9)
    cos, sin = (ux * vx + uy * vy) / norm, (vx * uy - vy * ux) / norm
    for i in range(n, m):
        dx, dy = whole_x[i] - whole_x[n - 1], whole_y[i] - whole_y[n - 1]
        x[i] = x[n - 1] + cos * dx - sin * dy
        y[i] = y[n - 1] + sin * dx + cos * dy
    height, width = weight.shape
    for i in range(n, min(n + reach, m)):
        column, row = int(np.floor(x[i] + 0.5)), int(np.floor(y[i] + 0.5))
        if 0 <= column < width and 0 <= row < height and weight[row, column] <= 0:
            amplitude[n:m] = whole_amplitude[n:m]
            return m
    return n


@njit(cache=True)
def drop_first(x, y, n, count):
    """Remove the first `count` nodes; return the new number."""
    for i in range(n - count):
        x[i] = x[i + count]
        y[i] = y[i + count]
    return n - count


@njit(cache=True)
def start_at_face(x, y, n, outside):
    """Cut or lengthen the line so that it begins where it leaves the face; return count.

    outside : float32 (height, width), signed distance from the fur's edge, > 0 outside [px].
    The first node is put on the edge itself.
    """
    distance = bilinear(outside, x[0], y[0])
    if distance > 0:
        before = n
        n = extend(x, y, n, True, min(int(1.5 * distance) + 6, 60), 40)
        if n == before:
            return n
    cut = 0
    # the last crossing from inside to outside on the proximal part; the tip may reach the body
    for i in range(min(n - 8, n // 2)):
        inside = bilinear(outside, x[i], y[i])
        if inside <= 0:
            cut = i + 1
        elif inside > 40:
            break
    if cut == 0:
        return n
    a = bilinear(outside, x[cut - 1], y[cut - 1])
    b = bilinear(outside, x[cut], y[cut])
    f = a / (a - b) if a < b else 0.0
    fx = x[cut - 1] + f * (x[cut] - x[cut - 1])
    fy = y[cut - 1] + f * (y[cut] - y[cut - 1])
    n = drop_first(x, y, n, cut - 1)
    x[0] = fx
    y[0] = fy
    return n


@njit(cache=True)
def is_clear(x, y, n, off_edges):
    """Whether a line does not run along an edge: half of its nodes do not.

    It may come out of the face or end at the animal's body: so it does where its distance from
    them changes. off_edges : (height, width) [px], above 0 far from edges
    """
    count = 0
    for i in range(n):
        count += not _is_along(x, y, i, n, off_edges)
        if 2 * count > n:
            return True
    return False


@njit(cache=True)
def without_edge(x, y, n, off_edges):
    """Number of nodes of a line without what runs along an edge at its end.

    A whisker that ends at the animal's body is not to go on along the body's outline.
    """
    end = n
    while end > 0 and _is_along(x, y, end - 1, n, off_edges):
        end -= 1
    return end if n - end > 2 * ALONG else n


@njit(cache=True, inline="always")
def _leave_out_edges(x, y, n, off_edges, scratch):
    """Let nodes of the near half that run along an edge say nothing of where the line lies.

    Where whisking skin moves out over the background, its edge is darker than many a whisker: a
    base would slide along it, step by step.
    """
    for i in range(n // 2):
        if _is_along(x, y, i, n, off_edges, SLID):
            scratch.information[i] = 0.0
            scratch.score[i] = 0.0


@njit(cache=True)
def _is_along(x, y, i, n, off_edges, steep=STEEP):
    """Whether node i of a line lies at an edge and the line runs along that edge there."""
    if bilinear(off_edges, x[i], y[i]) > 0:
        return False
    first, last = max(i - ALONG, 0), min(i + ALONG, n - 1)
    before, after = bilinear(off_edges, x[first], y[first]), bilinear(off_edges, x[last], y[last])
    return abs(after - before) <= steep * (last - first)


@njit(cache=True)
def _blocked(sums, i, n):
    """Whether no pixel is left around node `i`; a lone node may just share its row's column."""
    pixels = 0.0
    for j in range(max(i - 2, 0), min(i + 3, n)):
        pixels += sums[line_profile.G11, j]
    return pixels == 0


@njit(cache=True)
def visible_end(amplitude, amplitude_se, sums, n, bridge, fit):
    """Index one past the last node that is still seen; 0 where nothing is.

    The search starts at the clearest node of the proximal half, since fur may cover the first
    ones. A node is seen where its windowed absorbance is `SEEN_SD` standard errors above
    zero, and above `fit.faintest`; unseen stretches up to `bridge` nodes are crossed where pixels
    are missing (pole, border), up to `fit.unseen` where they are not. The more pixels are
    missing, the longer must be what is seen beyond.
    """
    first = 0
    clearest = 0.0
    for i in range((n + 1) // 2):
        clear = amplitude[i] / max(amplitude_se[i], 1e-9)
        if clear > clearest:
            clearest = clear
            first = i
    if clearest < SEEN_SD:
        return 0
    end = first
    unseen = 0  # nodes with pixels since the last one that was seen
    blind = 0  # nodes without pixels since then
    run = 0  # seen nodes in a row: after a gap, a few must agree
    for i in range(first, n):
        if sums[line_profile.G11, i] == 0 and _blocked(sums, i, n):
            blind += 1
            if blind > bridge:
                break
            continue
        if amplitude[i] > SEEN_SD * amplitude_se[i] and amplitude[i] > fit.faintest:
            run += 1
            if blind + unseen == 0 or run >= 8 + blind // 2:
                end = i + 1
                unseen = 0
                blind = 0
        else:
            run = 0
            unseen += 1
            if unseen > fit.unseen:
                break
    overshoot = fit.half // 2 + 1  # of the windowed absorbance over a line's end
    return max(end - overshoot, 0) if end < n else end


# Inlined, as the next ones are: else each call counts references to every array it is given.
@njit(cache=True, inline="always")
def measure(picture, nodes, n, fit, scratch):
    """Absorbance, information and score of a line where it lies now, into `scratch`.

    See cross_sections.py.
    """
    cap, sums, amplitude, baseline = scratch.cap, scratch.sums, scratch.amplitude, scratch.baseline
    cross_sections.accumulate(
        picture.image, picture.background, picture.weight, picture.gain, nodes.x, nodes.y, n, cap,
        nodes.sigma, 3.0, fit.widths, sums,
    )  # fmt: skip
    line_profile.window_amplitudes(
        sums, n, fit.half, amplitude, baseline, scratch.amplitude_se, scratch.misfit
    )
    for i in range(n):
        amplitude[i] = min(amplitude[i], cap[i])
    line_profile.offset_information(
        sums, n, amplitude, baseline, scratch.misfit, scratch.information, scratch.score
    )


@njit(cache=True, inline="always")
def fit_offset(x, y, n, scratch):
    """Gauss–Newton's spline offset along the normals, from the measured information and score."""
    nx, ny, offset, band, rhs = (
        scratch.normal_x, scratch.normal_y, scratch.offset, scratch.band, scratch.rhs,
    )  # fmt: skip
    spacing, at_nodes = scratch.spacing[0], scratch.at_nodes
    information, score = scratch.information, scratch.score
    k = bsplines.normal_equations(information, score, n, at_nodes, spacing, band, rhs)
    normals(x, y, n, nx, ny)
    smooth_x, smooth_y = scratch.smooth_x, scratch.smooth_y
    line, straightness = (smooth_x, smooth_y, nx, ny, n, spacing), STRAIGHTNESS / spacing**3
    bsplines.add_smoothness_prior(band, rhs, k, bsplines.THIRD, *line, STIFFNESS)
    bsplines.add_smoothness_prior(band, rhs, k, bsplines.SECOND, *line, straightness)
    for i in range(k):
        band[i, 0] += 1e-3
    bsplines.factorise(band, k)
    bsplines.solve_factorised(band, rhs, k)
    bsplines.evaluate(rhs, n, at_nodes, spacing, offset)
    for i in range(n):
        offset[i] = min(max(offset[i], -3.0), 3.0)


@njit(cache=True, inline="always")
def move(x, y, n, scratch):
    """Move nodes along the normals by the fitted offset, in place; `score` changes with it."""
    nx, ny, offset = scratch.normal_x, scratch.normal_y, scratch.offset
    information, score = scratch.information, scratch.score
    for i in range(n):
        x[i] += offset[i] * nx[i]
        y[i] += offset[i] * ny[i]
        score[i] -= information[i] * offset[i]


@njit(cache=True)
def largest(values, n):
    """Largest magnitude of the first `n` values; infinity of none."""
    most = 0.0 if n > 0 else np.inf
    for i in range(n):
        most = max(most, abs(values[i]))
    return most


@njit(cache=True)
def set_cap(amplitude, n, cap):
    """Largest believable absorbance: 1.5 times the line's own, at least 0.15, at most 1."""
    for i in range(n):
        cap[i] = min(max(1.5 * amplitude[i] + 0.05, 0.15), 1.0)


@njit(cache=True)
def refine(picture, values, n, fit, room):
    """Gauss–Newton steps on the nodes until they stay, then base, visible end and quality.

    Where the first step is larger than `fit.farthest`, or less of the line is seen than there
    was, the line is too far away: nothing is found, and the nodes' places mean nothing.

    The first `n` nodes are changed in place, but for sigma; returns their number and the quality:
    the part of the line's expected contrast that was found. The last step is so short that
    information stays and the score follows; nothing is measured again. values, room : those of
    a `Line` and a `Workspace`
    """
    if n < SHORTEST:
        return 0, 0.0
    nodes, work = nodes_of(values), scratch_of(room)
    x, y, amplitude = nodes.x, nodes.y, nodes.amplitude
    end, before, known = 0, 0, n
    n = start_at_face(x, y, n, picture.outside)
    n = extend(x, y, n, False, fit.bridge + 12, 40)
    set_cap(amplitude, n, work.cap)
    for step in range(fit.steps):
        bsplines.smooth(
            x, y, n, work.at_nodes, work.spacing[0], work.band, work.smooth_x, work.smooth_y
        )
        n = start_at_face(x, y, n, picture.outside)
        n = resample(x, y, n, work.room)
        if n < SHORTEST:
            return 0, 0.0
        measure(picture, nodes, n, fit, work)
        _leave_out_edges(x, y, n, picture.off_edges, work)
        seen = max(min(n, int(min(fit.longest, n))), 2)
        before = end
        bridge = WIDEST_GAP * fit.bridge
        end = visible_end(work.amplitude, work.amplitude_se, work.sums, seen, bridge, fit)
        fit_offset(x, y, n, work)
        move(x, y, n, work)
        tip = min(end + BEYOND_TIP, n)
        farthest = largest(work.offset, end)
        stays = step > 0 and abs(end - before) <= SAME_TIP
        if farthest < SHORT_STEP and (stays or largest(work.offset, tip) < TIP_STEP):
            break
        far = farthest > fit.farthest or end < STILL_SEEN * known
        if step == 0 and fit.farthest < np.inf and far:
            return 0, 0.0
    end = without_edge(x, y, end, picture.off_edges)
    if end < SHORTEST:
        return 0, 0.0
    return end, _keep_measured(nodes, end, work)


@njit(cache=True, inline="always")
def _keep_measured(nodes, end, work):
    """Take over what was measured last at the first `end` nodes; return the quality."""
    amplitude, sums = nodes.amplitude, work.sums
    nodes.information[:end] = work.information[:end]
    nodes.score[:end] = work.score[:end]
    found = 0.0
    expected = 1e-9
    for i in range(end):
        a = max(amplitude[i], 0.02)
        expected += a * a * sums[line_profile.GG, i]
        found += a * max(work.amplitude[i], 0.0) * sums[line_profile.GG, i]
        amplitude[i] = 0.7 * amplitude[i] + 0.3 * max(work.amplitude[i], 0.0)
        area = work.amplitude[i] * nodes.sigma[i] * line_profile.BELL_AREA
        nodes.thickness[i] = area if work.amplitude_se[i] < 0.05 else np.nan
    amplitude[end:] = amplitude[end - 1]
    return min(found / expected, 1.0)
