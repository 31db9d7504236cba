"""All whiskers in one frame, with no knowledge of the frames before."""

from typing import NamedTuple

import numpy as np
from numba import njit

from pipeline.detection import crossings, line_fit, new_lines, ridges, splitting
from pipeline.detection.frame import Frame
from pipeline.detection.image_model import ImageModel, absorbance_image, lines_in_background
from pipeline.detection.line import Line
from pipeline.detection.line_choice import (
    contrast_length,
    ends_at_face,
    is_ghost,
    is_turned,
    is_whisker,
    shared_fraction,
    without_doubles,
)
from pipeline.detection.one_or_two import with_blurred, without_broad
from pipeline.detection.refinement import refine_held
from pipeline.detection.tracing_options import TracingOptions
from pipeline.numerics import polyline
from pipeline.numerics.polyline import bilinear
from pipeline.numerics.rectangles import WHOLE
from pipeline.session.quantities import pixels_in

WORTH_FITTING = 0.5  # of the darkness wanted of a line, along the ridge that leads to it
KNOWN_SHARE = 0.7  # of a ridge that lies along a known line: it is what that one has left
KNOWN_STEP = 2  # every how many-th node of the known lines is looked at
NEAR_FACE = 2  # times the shortest line: so far from where lines begin ridges lead to new ones
WIDE_PX = 32  # to whole ones of these, that part of the picture is rounded up
MOST_LOOKS = 3  # at a frame with many whiskers


class Wanted(NamedTuple):
    """Which lines of a frame are looked for.

    enough : so many are found: no further look at a crowd
    least : length × absorbance [px], below which a line is left out
    part : slices of rows and columns, as in `near_face`
    """

    enough: float = np.inf
    least: float = 0.0
    part: tuple[slice, slice] = WHOLE


ALL = Wanted()


class Search(NamedTuple):
    """How lines are looked for in a frame.

    scale : of the ridges [px]
    near_px : lines nearer to each other than this are one
    wanted : which lines are looked for
    known : nodes of lines in the background, as in `polyline.end_to_end`: no ridge along them is
        followed
    """

    scale: float
    near_px: float
    wanted: Wanted = ALL
    known: tuple[np.ndarray, ...] = polyline.end_to_end((), KNOWN_STEP)


def detect(frame: Frame, search: Search | None = None) -> list[Line]:
    """Find all whiskers in one frame, best first.

    A whisker comes out of the face and is visible over at least `shortest_px` of the options.
    Without a `Search`, sharp ones are looked for in the whole frame.
    """
    if search is None:
        scale = frame.options.params.detection.sharp_sd_px
        search = Search(scale, _apart_px(frame.options))
    lines = without_doubles(_lines_at(frame, search), search.near_px)
    return _uncrossed_anew(frame, lines)


def _apart_px(options: TracingOptions) -> float:
    """How near to each other lines of one whisker are, where whiskers stand apart [px]."""
    return pixels_in(options.params.detection.same_whisker_mm, options.pixels_per_m)


def _detect_blurred(frame, search) -> list[Line]:
    """Find lines that motion has made broad, best first; sharp ones are found as well."""
    scale, near_px = frame.options.params.detection.blurred_sd_px, _apart_px(frame.options)
    lines = _lines_at(frame, search._replace(scale=scale, near_px=near_px))
    return without_doubles(lines, near_px)


def _lines_at(frame, search: Search) -> list[Line]:
    """Lines fitted along the ridges of one scale, those that may be whiskers, best first."""
    model, options, lines = frame.model, frame.options, []
    part = search.wanted.part
    absorbance = absorbance_image(frame.image, model, frame.gain, part)
    fit, own = options.fit(model, widths=True, steps=1), options.params.detection
    least = search.wanted.least
    limits = 0.6 * options.shortest_px, float(options.base_gap_px), WORTH_FITTING * least
    curves = ridges.curves_in(part, absorbance, model.noise, search.scale)
    senses = _senses(*curves, absorbance, model.outside, model.off_edges, limits)
    _leave_out_known(*curves, *search.known, same_px(options), senses)
    for k in np.flatnonzero(senses):
        rooted = curves.curve(k)[:: senses[k]]
        line = new_lines.initialise_line(frame.picture, rooted, fit, frame.workspace)
        if ends_at_face(line, model, options) and is_turned(line, model.outward, own.thickens):
            line = new_lines.initialise_line(frame.picture, rooted[::-1], fit, frame.workspace)
        if contrast_length(line) >= least and is_whisker(line, model, options):
            lines.append(line)
    return sorted(lines, key=lambda line: -contrast_length(line))


@njit(cache=True)
def _senses(places, offsets, absorbance, outside, off_edges, limits):
    """Of all curves, end to end, what `_sense` says of each, int8 (curves,)."""
    senses = np.empty(len(offsets) - 1, np.int8)
    for k in range(len(senses)):
        curve = places[offsets[k] : offsets[k + 1]]
        senses[k] = _sense(curve, absorbance, outside, off_edges, limits)
    return senses


@njit(cache=True)
def _sense(curve, absorbance, outside, off_edges, limits):
    """1 where a curve (n, 2) is worth fitting, −1 where it is from its last point on, else 0.

    It begins at the face. limits : least length [px], farthest base from the face [px], least
    length × absorbance [px]
    """
    shortest, base_gap, darkness = limits
    if _length(curve) < shortest:
        return 0
    begin, end = curve[0], curve[len(curve) - 1]
    first, last = bilinear(outside, begin[0], begin[1]), bilinear(outside, end[0], end[1])
    if min(first, last) >= base_gap:
        return 0
    if not line_fit.is_clear(curve[:, 0], curve[:, 1], len(curve), off_edges):
        return 0
    if _darkness(absorbance, curve) < darkness:
        return 0
    return -1 if last < first else 1


@njit(cache=True)
def _leave_out_known(places, offsets, x, y, starts, near_px, senses):
    """Set the senses (curves,) to 0 of curves that lie along a known line, within `near_px`.

    x, y, starts : nodes of the known lines, as in `polyline.end_to_end`
    """
    for k in np.flatnonzero(senses):
        curve = places[offsets[k] : offsets[k + 1]]
        for j in range(len(starts) - 1):
            nodes = slice(starts[j], starts[j + 1])
            lines = curve[:, 0], curve[:, 1], len(curve), x[nodes], y[nodes], len(x[nodes])
            if polyline.share_near(*lines, near_px, (3, 1)) >= KNOWN_SHARE:
                senses[k] = 0
                break


@njit(cache=True)
def _darkness(absorbance, curve):
    """Absorbance summed along a curve (n, 2) [px]."""
    height, width = absorbance.shape
    total, length = 0.0, 0.0
    for i in range(len(curve)):
        column = min(max(int(curve[i, 0] + 0.5), 0), width - 1)
        row = min(max(int(curve[i, 1] + 0.5), 0), height - 1)
        if i > 0:
            length = np.hypot(curve[i, 0] - curve[i - 1, 0], curve[i, 1] - curve[i - 1, 1])
        total += length * max(absorbance[row, column], 0.0)
    return total


def same_px(options: TracingOptions) -> float:
    """How near to each other lines of one whisker are, in a crowd [px]."""
    return min(max(options.px(options.params.detection.same_whisker_mm), 1.2), 3.0)


def detect_crowded(frame: Frame, known=(), wanted=ALL) -> list[Line]:
    """As `detect`, for whiskers that lie close together: those found hide no others.

    What was found is held in the background, and the frame about it, where it may have hidden
    others, looked at again, until nothing new is found, or enough lines are; then every line is
    fitted beside the others. `known` lines are not looked for, nor those that are not `Wanted`.
    Blurred ones are looked for where no line is known: what is followed already gets broader.
    """
    nodes = polyline.end_to_end(known, KNOWN_STEP)
    scale = frame.options.params.detection.fine_sd_px
    search = Search(scale, same_px(frame.options), wanted, nodes)
    with lines_in_background(frame.model, known):
        lines = _detect_repeatedly(frame, known, search)
    lines.sort(key=lambda line: -contrast_length(line))
    return without_doubles(lines, search.near_px)


def near_face(model: ImageModel, options: TracingOptions) -> tuple[slice, slice]:
    """Rows and columns of the picture in which a line that leaves the face is noticed.

    From there it is fitted, and followed from frame to frame, as far as it is seen.
    """
    farthest = options.base_gap_px + NEAR_FACE * options.shortest_px
    near = model.usable & (model.outside < farthest)
    return tuple(_range_of(np.flatnonzero(near.any(axis=axis))) for axis in (1, 0))


def _range_of(places) -> slice:
    """All from the first to the last of the places, in whole WIDE_PX; everything where none is."""
    if not len(places):
        return slice(None)
    return slice(int(places[0]) // WIDE_PX * WIDE_PX, (int(places[-1]) // WIDE_PX + 1) * WIDE_PX)


def _detect_repeatedly(frame, known, search) -> list[Line]:
    """Lines of `detect_crowded`, with doubles; the `known` ones are in the background."""
    model, options, lines = frame.model, frame.options, []
    near_px, wanted, own = search.near_px, search.wanted, options.params.detection
    for look in range(MOST_LOOKS):
        with lines_in_background(model, lines):
            more = detect(frame, search)
            if look == 0 and not known:
                more = with_blurred(frame, more, _detect_blurred(frame, search))
        others = *known, *lines
        more = [
            line
            for line in more
            if all(shared_fraction(line, other, near_px) < 0.5 for other in others)
            and not is_ghost(line, others, own)
        ]
        if not more:
            break
        usual = splitting.usual_sigma([*more, *others])
        lines += without_broad(frame, more, lines, usual)
        if len(lines) >= wanted.enough:
            break
        with lines_in_background(model, lines):
            for line in lines:
                refine_held(frame, line)
        lines = [line for line in lines if is_whisker(line, model, options)]
        if not lines:
            break
        about = wanted._replace(part=_about(lines, options.shortest_px))
        search = search._replace(wanted=about)
    return _uncrossed_anew(frame, lines)


def _about(lines, margin_px) -> tuple[slice, slice]:
    """Rows and columns of a picture that some lines lie in, and so many pixels about them."""
    x, y = (np.concatenate([getattr(line, k)[: line.n] for line in lines]) for k in "xy")
    return tuple(
        slice(max(int(v.min() - margin_px), 0), max(int(v.max() + margin_px), 0) + 1)
        for v in (y, x)
    )


def _uncrossed_anew(frame, lines) -> list[Line]:
    """The same lines, of which crossing ones that have changed far parts are fitted again.

    Whiskers that cross at a small angle need it (test_detect): without it, 341 rather than 355 of
    360 rendered whiskers that cross were found in single frames.
    """
    changed = uncrossed(lines, frame.options)
    if not changed:
        return lines
    with lines_in_background(frame.model, lines):
        for line, _ in changed:
            refine_held(frame, line)
    return [line for line in lines if is_whisker(line, frame.model, frame.options)]


def uncrossed(lines, options: TracingOptions) -> list[tuple[Line, Line]]:
    """Give crossing lines their own far parts back, in place.

    Returns those that have changed, each with a copy of what it was.
    """
    reach = crossings.Reach.of(options.params.detection, options.pixels_per_m)
    near = polyline.near_pairs(lines, reach.near)
    changed, pairs = {}, ((a, b) for a in range(len(lines)) for b in range(a))
    for k, j in pairs:
        before = crossings.uncross(lines[k], lines[j], reach) if near[k, j] else None
        if before is None:
            continue
        near[k] = near[j] = near[k] | near[j]
        for line, was in zip((lines[k], lines[j]), before, strict=True):
            changed.setdefault(id(line), (line, was))
    return list(changed.values())


@njit(cache=True)
def _length(curve):
    """Length of a curve (n, 2)."""
    total = 0.0
    for i in range(1, len(curve)):
        total += np.hypot(curve[i, 0] - curve[i - 1, 0], curve[i, 1] - curve[i - 1, 1])
    return total
