"""The two sides of a face: rows of whiskers that point away from each other, with own names."""

import numpy as np

from pipeline.detection import line_choice
from pipeline.session.schema import SIDES, UPRIGHT
from pipeline.tracking.given_lengths import GivenLengths
from pipeline.tracking.matching import Ruler
from pipeline.tracking.registry import named_as_given

FEWEST = 3  # whiskers on a side
MOST = 0.2, 0.8  # of the places on a side: between these lies what makes its width
TINY = 1e-9  # px: all at one place have no gap


def side_names(face_side: str) -> tuple[str, str]:
    """What the two sides of a face are called, in the order of the picture."""
    return SIDES if face_side in ("top", "bottom") else UPRIGHT


def names_by_side(names, face_side: str):
    """Names of each of the two sides, in their order; None where one belongs to no side.

    The whisker `left_C1` is one of the left side.
    """
    sides = side_names(face_side)
    if not names or not all(name.startswith(tuple(f"{s}_" for s in sides)) for name in names):
        return None
    return tuple([name for name in names if name.startswith(f"{side}_")] for side in sides)


def cuts_between(templates, along, params) -> tuple[float, ...]:
    """Place along the face [px] between the two sides' templates; none where there is one side.

    There are two where the bases form two groups far apart whose whiskers point away from each
    other.
    """
    ahead = directions(templates)
    places = np.array([template.base_xy @ along for template in templates])
    order = np.argsort(places)
    places = places[order]
    inner = range(FEWEST, len(places) - FEWEST + 1)
    gaps = {k: _gap(places, k) for k in inner}
    if not gaps or max(gaps.values()) < params.side_gap:
        return ()
    k = max(gaps, key=gaps.get)
    one, other = (ahead[part].mean(axis=0) for part in (order[:k], order[k:]))
    cosine = one @ other / max(np.hypot(*one) * np.hypot(*other), 1e-9)
    if cosine > np.cos(np.radians(params.sides_apart_deg)):
        return ()
    return (float(places[k - 1 : k + 1].mean()),)


def _gap(places, k) -> float:
    """Gap before the `k`-th of some places, in order, as a share of the width of most of them.

    Some hairs far behind, at the ears, do not make a row wider.
    """
    gap = places[k] - places[k - 1]
    widths = (np.ptp(np.quantile(part, MOST)) for part in (places[:k], places[k:]))
    return gap / max(gap + sum(widths), TINY)


def side_of(places, cuts) -> np.ndarray:
    """Number of the side on which each place along the face [px] lies (`cuts_between`)."""
    return np.searchsorted(cuts, places)


def sides_of(templates, along, cuts) -> list[list]:
    """The `WhiskerTemplate`s of each side, by where they stand along the face (`cuts_between`)."""
    side = side_of([template.base_xy @ along for template in templates], cuts)
    return [
        [template for template, own in zip(templates, side, strict=True) if own == k]
        for k in range(len(cuts) + 1)
    ]


def counted_names(templates, face_side, options) -> tuple[str, ...]:
    """Names for templates that have none: w1, w2, …, or left_w1, …, right_w1, … on two sides."""
    along = np.asarray(Ruler.of(face_side, options).along, float)
    cuts = cuts_between(templates, along, options.params.identity)
    first = [f"{side}_w" for side in side_names(face_side)] if cuts else ["w"]
    rows = sides_of(templates, along, cuts)
    return tuple(
        f"{start}{k + 1}" for start, row in zip(first, rows, strict=True) for k in range(len(row))
    )


def directions(templates) -> np.ndarray:
    """Unit vectors (whiskers, 2) from base to tip, of each whisker's sample lines."""
    chords = [
        np.sum([line.points[-1] - line.points[0] for line in s.samples], 0) for s in templates
    ]
    chords = np.array(chords, float).reshape(-1, 2)
    return chords / np.maximum(np.hypot(*chords.T), 1e-9)[:, None]


def row_directions(templates, outward) -> tuple[np.ndarray, np.ndarray]:
    """Unit vectors of one side's row: from the snout to the back of the head, and out of the fur.

    outward : direction out of the face as a whole, (x, y)
    """
    out = directions(templates).mean(axis=0)
    out /= np.hypot(*out)
    across = np.array([out[1], -out[0]])
    return -np.sign(outward @ across or 1.0) * across, out


def named_by_side(templates, names, face_side, options, given: GivenLengths):
    """The templates with names of their own side, anterior → posterior.

    On each side, those seen in most frames, and best, get the names by their order and lengths
    (`registry.named_as_given`). Also returns the templates of a side without names. None, and no
    templates, where there is one side only.

    Parameters
    ----------
    names : of the one side and of the other (`names_by_side`)
    options : `TracingOptions`
    given : visible lengths of the names for which they are known
    """
    ruler = Ruler.of(face_side, options)
    along, outward = np.asarray(ruler.along, float), np.asarray(ruler.outward, float)
    cuts = cuts_between(templates, along, options.params.identity)
    if not cuts:
        return None, ()
    named, other_side = [], ()
    for row, own in zip(sides_of(templates, along, cuts), names, strict=True):
        if not own:  # this side has no names
            other_side = row
            continue
        row = sorted(row, key=_seen, reverse=True)[: len(own)]
        across, _ = row_directions(row, outward)
        row.sort(key=lambda template, across=across: template.base_xy @ across)
        longest = {name: given.longest_px.get(name, np.inf) for name in own}
        named += named_as_given(row, GivenLengths(longest, given.tips_seen))
    return named, other_side


def _seen(template) -> float:
    """How often and how well a whisker is seen."""
    return len(template.samples) * np.sqrt(line_choice.usual_strength(template.samples))
