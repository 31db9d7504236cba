"""Whether one line or two explain what is seen: of a broad line, of several, of two neighbours."""

from pipeline.detection import line_profile, new_lines, splitting
from pipeline.detection.image_model import lines_in_background
from pipeline.detection.line import Line
from pipeline.detection.line_choice import contrast_length, is_whisker, reach, shared_fraction
from pipeline.detection.line_fit import SHORTEST
from pipeline.detection.refinement import refine

ALONG = 0.8  # of a line: so much of it lies along the one that it was fitted from


def with_blurred(sharp, broad, image, model, gain, one_line) -> list[Line]:
    """Lines found at both scales: a broad one in place of several sharp ones that it explains.

    The two edges of a whisker that moves while the shutter is open pass for two whiskers; one
    broad line takes nearly as much light as they do, the part `one_line` at least. Of two whiskers
    it would not.
    """
    out = list(sharp)
    for line in broad:
        along = [s for s in out if shared_fraction(s, line, reach(line)) > 0.5]
        mine = _explained(line, [line], image, model, gain)
        if mine > one_line * _explained(line, along, image, model, gain):
            out = [line, *(s for s in out if all(s is not other for other in along))]
    return sorted(out, key=lambda line: -contrast_length(line))


def _explained(strip, lines, image, model, gain) -> float:
    """By how much `lines` lessen the misfit of the pixels about the line `strip`."""
    about = strip.x, strip.y, strip.n, strip.sigma
    pixels = image, model.background, model.weight, gain
    before = line_profile.strip_misfit(*pixels, *about)
    with lines_in_background(model, lines):
        return before - line_profile.strip_misfit(*pixels, *about)


def without_broad(image, model, gain, options, workspace, lines, others, usual) -> list[Line]:
    """The same lines, but two in the place of each that is as broad as two `usual` whiskers.

    others : lines of the frame that are not in the background yet
    """
    own = options.params.detection
    if usual is None:
        return lines
    out = []
    for k, line in enumerate(lines):
        if splitting.is_broad(line, usual, own.broad, options.px(own.thickest_radius_mm)):
            with lines_in_background(model, [*others, *out, *lines[k + 1 :]]):
                out += _one_or_two(line, usual, image, model, gain, options, workspace)
        else:
            out.append(line)
    return out


def _one_or_two(line, usual, image, model, gain, options, workspace) -> list[Line]:
    """What a broad line is: two whiskers, a slim one, one broad by itself, or nothing."""

    def fit(one, more):
        with lines_in_background(model, more):
            refine(image, model, gain, one, options, workspace)

    pair = splitting.split(line, usual, fit, lambda one: is_whisker(one, model, options))
    if pair is not None:
        return pair
    narrow = splitting.narrowed(line, usual)  # on the darker of two
    fit(narrow, [])
    broad = _explained(line, [line], image, model, gain)
    slim = _explained(line, [narrow], image, model, gain)
    if slim > options.params.detection.one_line * broad:
        line = narrow
    return [line] if line.n else []


def one_for_two(faint, other, image, model, gain, options, workspace) -> Line | None:
    """A line in the place of two that run together, or None where two explain more.

    Two lines lie on one whisker that motion has made broad: one as broad takes as much light as
    they do about the one that is less sure, `faint`, the part `one_line` at least, and lies along
    the `other` one. Neither of them is in the background.
    """
    fit = options.fit(model, widths=True, steps=1)
    one = new_lines.initialise_line(model.picture(image, gain), other.points, fit, workspace)
    if one.n < SHORTEST or shared_fraction(one, other, reach(other)) < ALONG:
        return None
    both = _explained(faint, [faint, other], image, model, gain)
    alone = _explained(faint, [one], image, model, gain)
    return one if alone > options.params.detection.one_line * both else None
