"""All whiskers in one frame, with no knowledge of the frames before."""

from dataclasses import dataclass

import numpy as np
from numba import njit

from pipeline.detection import crossings, line_fit, line_profile, ridges, splitting
from pipeline.detection.image_model import ImageModel, absorbance_image, lines_in_background
from pipeline.detection.line import Line
from pipeline.numerics import polyline

FAINTEST = 0.012  # absorbance below which nothing is called seen
THINNEST_SIGMA, BROADEST_SIGMA = 0.6, 2.5  # px, of a line's half-width
SAME_MM = 0.12  # lines so near to each other, in a crowd, are of one whisker
GHOST_SHARE = 0.5  # of a line's darkness: what is fainter and runs along it (3 px) is its blur
MOST_LOOKS = 3  # at a frame with many whiskers
FINE_PX = 1.1  # SD of the differentiating Gaussian where whiskers lie close together


@dataclass(frozen=True)
class TracingOptions:
    """Lengths in pixels, derived from the recording's scale by `options_for`.

    `longest_px` is the largest visible length of an expected whisker (inf where unknown),
    `visible_px` the largest ones of all (empty where unknown),
    `hidden_px` and `cone_px` their hidden and cone lengths (empty where unknown).
    """

    spacing_px: float
    shortest_px: float
    base_gap_px: float
    bridge_px: int
    longest_px: float = np.inf
    visible_px: tuple[float, ...] = ()
    hidden_px: tuple[float, ...] = ()
    cone_px: tuple[float, ...] = ()
    pixels_per_m: float = 25e3


def detect(
    image, model: ImageModel, gain, options: TracingOptions, workspace,
    scale=ridges.SCALE_PX, near_px=3.0,
) -> list[Line]:  # fmt: skip
    """Find all whiskers in one frame, best first.

    A whisker comes out of the face and is visible over at least `options.shortest_px`. Ridges
    are those of one `scale` [px]; lines nearer to each other than `near_px` are one.
    """
    absorbance = absorbance_image(image, model, gain)
    index, points = ridges.ridge_points(absorbance, model.noise, scale)
    curves = ridges.join(ridges.link(index, points, shortest=10))
    lines = []
    for curve in curves:
        rooted = root(curve, model, options)
        if rooted is None:
            continue
        line = settle(image, model, gain, rooted, options, workspace)
        if _is_whisker(line, model, options):
            lines.append(line)
    lines.sort(key=lambda line: -contrast_length(line))
    lines = without_doubles(lines, near_px)
    return _uncrossed_anew(image, model, gain, options, workspace, lines)


def same_px(options: TracingOptions) -> float:
    """How near to each other lines of one whisker are, in a crowd [px]."""
    return float(np.clip(1e-3 * SAME_MM * options.pixels_per_m, 1.2, 3.0))


def detect_crowded(
    image, model: ImageModel, gain, options: TracingOptions, workspace, known=(), enough=np.inf
) -> list[Line]:
    """As `detect`, for whiskers that lie close together: those found hide no others.

    What was found is held in the background, and the frame looked at again, until nothing new
    is found, or `enough` lines are; then every line is fitted beside the others. `known` lines
    are not looked for.
    """
    lines: list[Line] = []
    near_px = same_px(options)
    for _ in range(MOST_LOOKS):
        with lines_in_background(model, [*known, *lines]):
            more = detect(image, model, gain, options, workspace, FINE_PX, near_px)
        others = (*known, *lines)
        more = [
            line
            for line in more
            if all(shared_fraction(line, other, near_px) < 0.5 for other in others)
            and not is_ghost(line, others)
        ]
        if not more:
            break
        lines += _without_broad(image, model, gain, options, workspace, more, others)
        if len(lines) >= enough:
            break
        for line in lines:
            with lines_in_background(
                model, [*known, *(other for other in lines if other is not line)]
            ):
                refine(image, model, gain, line, options, workspace)
        lines = [line for line in lines if _is_whisker(line, model, options)]
    lines = _uncrossed_anew(image, model, gain, options, workspace, lines, known)
    lines.sort(key=lambda line: -contrast_length(line))
    return without_doubles(lines, near_px)


def _uncrossed_anew(image, model, gain, options, workspace, lines, known=()) -> list[Line]:
    """The same lines, of which crossing ones that have changed far parts are fitted again."""
    changed = uncrossed(lines)
    if not changed:
        return lines
    for line in changed:
        with lines_in_background(
            model, [*known, *(other for other in lines if other is not line)]
        ):
            refine(image, model, gain, line, options, workspace)
    return [line for line in lines if _is_whisker(line, model, options)]


def uncrossed(lines) -> list[Line]:
    """Give crossing lines their own far parts back, in place; those that have changed."""
    changed = []
    for k, one in enumerate(lines):
        for other in lines[:k]:
            near = polyline.come_near(
                one.x, one.y, one.n, other.x, other.y, other.n, crossings.NEAR_PX
            )
            if near and crossings.uncross(one, other):
                changed += [line for line in (one, other) if all(line is not c for c in changed)]
    return changed


def _without_broad(image, model, gain, options, workspace, lines, others) -> list[Line]:
    """The same lines, but two in the place of each that is as broad as two whiskers."""
    usual = splitting.usual_sigma([*lines, *others])
    if usual is None:
        return lines
    out = []
    for k, line in enumerate(lines):
        if not splitting.is_broad(line, usual, options.pixels_per_m):
            out.append(line)
            continue
        beside = [*others, *out, *lines[k + 1 :]]

        def fit(one, more, beside=beside):
            with lines_in_background(model, [*beside, *more]):
                refine(image, model, gain, one, options, workspace)

        pair = splitting.split(line, usual, fit, lambda one: _is_whisker(one, model, options))
        if pair is None:
            pair = [splitting.narrowed(line, usual)]
            fit(pair[0], [])
        out += pair
    return out


def is_ghost(line: Line, others) -> bool:
    """Whether a line is what is left of a darker one that was not lines_in_background well."""
    strength = np.median(line.amplitude[: line.n])
    return any(
        _is_darker(other.amplitude[: line.n], strength / GHOST_SHARE)
        and shared_fraction(line, other) > 0.5
        for other in others
    )


@njit(cache=True)
def _is_darker(amplitude, than):
    return np.median(amplitude) > than


def _is_whisker(line: Line, model, options) -> bool:
    """Whether a line is long and clear and leaves the face."""
    long_and_clear = line.n >= options.shortest_px and line.quality > 0.3
    return long_and_clear and leaves_face(line, model.outside)


def leaves_face(line: Line, outside) -> bool:
    """Whether a line goes away from the face, and does not run along the fur's dark edge."""
    return line_fit.leaves_face(line.x, line.y, line.n, outside)


def contrast_length(line: Line) -> float:
    """Absorbance summed along the line: long dark whiskers come first [px]."""
    return float(line.amplitude[: line.n].sum())


def root(curve, model: ImageModel, options: TracingOptions):
    """Turn a curve so that it begins at the face; None where it does not come out of it."""
    if _length(curve) < 0.6 * options.shortest_px:
        return None
    height, width = model.outside.shape
    ends = np.clip(np.rint(curve[[0, -1]]).astype(int), 0, [width - 1, height - 1])
    distance = model.outside[ends[:, 1], ends[:, 0]]
    if distance[1] < distance[0]:
        curve, distance = curve[::-1], distance[::-1]
    return curve if distance[0] < options.base_gap_px else None


@njit(cache=True)
def _length(curve):
    """Length of a curve (n, 2)."""
    total = 0.0
    for i in range(1, len(curve)):
        total += np.hypot(curve[i, 0] - curve[i - 1, 0], curve[i, 1] - curve[i - 1, 1])
    return total


def settle(image, model: ImageModel, gain, curve, options: TracingOptions, workspace) -> Line:
    """Refine a rough curve into a line: centre, width, base and visible end."""
    line = Line.empty(workspace.limit)
    n = min(len(curve), workspace.limit)
    line.x[:n], line.y[:n] = curve[:n].T
    n = polyline.resample(line.x, line.y, n, workspace.work[8:10])
    line.amplitude[:] = 0.5
    line.n = n
    for _ in range(4):
        refine(image, model, gain, line, options, workspace, widths=True)
        if line.n < line_fit.SHORTEST:
            break
        fit_width(line, workspace)
        # no history to average with: the absorbance is what was measured last
        line.amplitude[: line.n] = np.maximum(workspace.work[2, : line.n], FAINTEST)
        line.amplitude[line.n :] = line.amplitude[line.n - 1]
    return line


def fit_width(line: Line, workspace) -> None:
    """Update the half-width σ along the line, linear in arc length, from its last measurement."""
    _fit_width(line.sigma, line.n, workspace.sums, workspace.work)


@njit(cache=True)
def _fit_width(sigma, n, sums, work):
    """Each half of the line has a width of its own; it does not grow towards the tip."""
    middle = n // 2
    near, far = middle / 2, (middle + n) / 2
    near_sigma = _corrected(sigma[int(near)], sums, work, 0, middle)
    far_sigma = _corrected(sigma[int(far)], sums, work, middle, n)
    slope = min((far_sigma - near_sigma) / max(far - near, 1.0), 0.0)
    for i in range(len(sigma)):
        sigma[i] = min(max(near_sigma + slope * (i - near), THINNEST_SIGMA), BROADEST_SIGMA)


@njit(cache=True)
def _corrected(sigma, sums, work, first, last):
    change = line_profile.width_correction(sums, work[2], first, last)
    corrected = sigma * np.exp(min(max(change, -0.3), 0.3))
    return min(max(corrected, THINNEST_SIGMA), BROADEST_SIGMA)


def refine(
    image, model: ImageModel, gain, line: Line, options: TracingOptions, workspace,
    farthest=np.inf, widths=False,
):  # fmt: skip
    """Gauss–Newton from the line's present nodes; base and tip found anew. In place.

    A line that is `farthest` [px] or more from them is not found. `widths`: for `fit_width`.
    """
    w = workspace
    line.n, line.quality = line_fit.refine(
        image, model.background, model.weight, model.outside, gain,
        line.x, line.y, line.n, line.amplitude, line.sigma, line.information, line.score,
        line.thickness,
        options.spacing_px, options.bridge_px, min(options.longest_px, line.longest), farthest,
        widths, w.sums, w.work, w.cap, w.band, w.rhs,
    )  # fmt: skip


def without_doubles(lines: list[Line], near_px: float = 3.0) -> list[Line]:
    """Drop every line that runs along a better one (within `near_px`) for half of its length."""
    kept: list[Line] = []
    for line in lines:
        if not any(shared_fraction(line, other, near_px) > 0.5 for other in kept):
            kept.append(line)
    return kept


def shared_fraction(line: Line, other: Line, near_px: float = 3.0) -> float:
    """Fraction of `line`'s nodes within `near_px` of `other`."""
    lines = line.x, line.y, line.n, other.x, other.y, other.n
    return polyline.share_near(*lines, near_px, (3, 2))
