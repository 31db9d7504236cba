"""Visible lengths of whiskers, to be compared with session.toml: lengths or scale may be wrong.

Lines are traced no farther than the given lengths allow. Where lines reach that limit, or none is
found at all, whiskers are looked for once more in fewer frames, with limits that suit the picture.
"""

from typing import NamedTuple

import numpy as np

from pipeline.numerics.runs import evenly
from pipeline.session.plausibility import MOST_MM
from pipeline.tracking.registry import find_templates
from pipeline.tracking.whiskers import ENOUGH_FRAMES, options_for_picture, tracing_options

AT_THE_LIMIT = 0.97  # of the longest line that a length allows: the whisker may go on
LONGER = 1.3  # times the length given: the length or the scale is wrong
LEAST_MM = 2.5  # that a whisker is seen


class SeenLength(NamedTuple):
    """Length at which a whisker is seen [px]; `name` is None where it is not known which."""

    px: float
    name: str | None = None


def odd_length(indices, frames, epochs, templates, settings) -> SeenLength | None:
    """The whisker whose length in the picture contradicts the settings; None: none does.

    Parameters
    ----------
    indices, frames : from the whole video, in which the templates were found
    epochs : the video's epochs
    templates : its `WhiskerTemplate`s
    settings : `Settings`
    """
    recording, shape = settings.recording.si(), frames.shape[1:]
    limited = [s for s in templates if s.visible_px > AT_THE_LIMIT * s.longest_px]
    odd = None
    if limited or not templates:
        options = options_for_picture(recording, shape, settings.advanced)
        few = evenly(len(frames), ENOUGH_FRAMES)
        again = find_templates(frames[few], epochs, options, indices=np.asarray(indices)[few])
        shortest_px = tracing_options(settings, shape).shortest_px
        odd = _longer(limited, again) if templates else _too_short(again, shortest_px)
    return odd or _implausible(templates, recording.pixels_per_mm)


def _longer(limited, again):
    """Of the templates at the limit, the one that is too long by most; None: hardly any is."""
    seen = [(template, _nearest(template, again).visible_px) for template in limited if again]
    ratios = [px / template.longest_px for template, px in seen]
    if max(ratios, default=0) < LONGER:
        return None
    template, px = seen[int(np.argmax(ratios))]
    return SeenLength(px, template.name)


def _nearest(template, others):
    """The template whose base is nearest to that of another."""
    return min(others, key=lambda other: np.hypot(*(other.base_xy - template.base_xy)))


def _too_short(again, shortest_px):
    """The longest whisker, if it is too short for the given lengths, else None."""
    longest = max((template.visible_px for template in again), default=np.inf)
    return SeenLength(longest) if longest < shortest_px else None


def _implausible(templates, pixels_per_mm):
    """The longest whisker, if no real one is so short or so long, else None."""
    longest = max(templates, key=lambda template: template.visible_px, default=None)
    if longest is None or LEAST_MM < longest.visible_px / pixels_per_mm < MOST_MM:
        return None
    return SeenLength(longest.visible_px, longest.name)
