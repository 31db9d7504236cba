"""Whether one line or two explain what is seen: of a broad line, of several, of two neighbours."""

from pipeline.detection import line_profile, new_lines, splitting
from pipeline.detection.frame import Frame
from pipeline.detection.image_model import lines_in_background
from pipeline.detection.line import Line
from pipeline.detection.line_choice import contrast_length, is_whisker, reach, shared_fraction
from pipeline.detection.line_fit import SHORTEST
from pipeline.detection.refinement import refine

ALONG = 0.8  # of a line: so much of it lies along the one that it was fitted from


def with_blurred(frame: Frame, sharp, broad) -> list[Line]:
    """Lines found at both scales: a broad one in place of several sharp ones that it explains.

    The two edges of a whisker that moves while the shutter is open pass for two whiskers; one
    broad line takes nearly as much light as they do, the part `one_line` at least. Of two whiskers
    it would not. What other lines explain counts for neither.
    """
    out, one_line = list(sharp), frame.options.params.detection.one_line
    for line in broad:
        along = [s for s in out if shared_fraction(s, line, reach(line)) > 0.5]
        others = [s for s in out if all(s is not each for each in along)]
        with lines_in_background(frame.model, others):
            gained, lost = (_explained(frame, line, each) for each in ([line], along))
        if gained > one_line * lost:
            out = [line, *others]
    return sorted(out, key=lambda line: -contrast_length(line))


def _explained(frame, strip, lines) -> float:
    """By how much `lines` lessen the misfit of the pixels about the line `strip`."""
    about = strip.x, strip.y, strip.n, strip.sigma
    before = line_profile.strip_misfit(frame.picture, *about)
    with lines_in_background(frame.model, lines):
        return before - line_profile.strip_misfit(frame.picture, *about)


def without_broad(frame: Frame, lines, others, usual) -> list[Line]:
    """The same lines, but two in the place of each that is as broad as two `usual` whiskers.

    others : lines of the frame that are not in the background yet
    """
    if usual is None:
        return lines
    out, own = [], frame.options.params.detection
    thickest_px = frame.options.px(own.thickest_radius_mm)
    for k, line in enumerate(lines):
        if splitting.is_broad(line, usual, own.broad, thickest_px):
            with lines_in_background(frame.model, [*others, *out, *lines[k + 1 :]]):
                out += _one_or_two(frame, line, usual)
        else:
            out.append(line)
    return out


def _one_or_two(frame, line, usual) -> list[Line]:
    """What a broad line is: two whiskers, a slim one, one broad by itself, or nothing."""

    def fit(one, more):
        with lines_in_background(frame.model, more):
            refine(frame, one)

    pair = splitting.split(
        line, usual, fit, lambda one: is_whisker(one, frame.model, frame.options)
    )
    if pair is not None:
        return pair
    narrow = splitting.narrowed(line, usual)  # on the darker of two
    fit(narrow, [])
    broad, slim = (_explained(frame, line, [each]) for each in (line, narrow))
    if slim > frame.options.params.detection.one_line * broad:
        line = narrow
    return [line] if line.n else []


def one_for_two(frame: Frame, faint, other) -> Line | None:
    """A line in the place of two that run together, or None where two explain more.

    Two lines lie on one whisker that motion has made broad: one as broad takes as much light as
    they do about the one that is less sure, `faint`, the part `one_line` at least, and lies along
    the `other` one. Neither of them is in the background.
    """
    fit = frame.options.fit(frame.model, widths=True, steps=1)
    one = new_lines.initialise_line(frame.picture, other.points, fit, frame.workspace)
    if one.n < SHORTEST or shared_fraction(one, other, reach(other)) < ALONG:
        return None
    both, alone = (_explained(frame, faint, lines) for lines in ([faint, other], [one]))
    return one if alone > frame.options.params.detection.one_line * both else None
