"""Lengths by which lines are looked for and followed."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pipeline.detection import line_fit
from pipeline.session.parameters import DEFAULTS, Parameters
from pipeline.session.quantities import pixels_in


@dataclass(frozen=True)
class TracingOptions:
    """Lengths in pixels, derived from the recording's scale by `options_for`.

    `longest_px` is the largest visible length of an expected whisker (inf where unknown),
    `visible_px` the largest ones of all (empty where unknown),
    `hidden_px` their hidden lengths (empty where unknown);
    `ends`: the thickness beyond lines' ends is measured, which only forces need;
    `snout` is the picture's side that the snout is nearest to, None where not known;
    `params` are the `Parameters` of all rooms.
    """

    spacing_px: float
    shortest_px: float
    base_gap_px: float
    bridge_px: int
    longest_px: float = np.inf
    visible_px: tuple[float, ...] = ()
    hidden_px: tuple[float, ...] = ()
    pixels_per_m: float = 25e3
    frames_per_second: float = 1000.0
    ends: bool = True
    snout: str | None = None
    params: Parameters = DEFAULTS

    def fit(self, model, farthest=np.inf, widths=False, steps=line_fit.MOST_STEPS) -> line_fit.Fit:
        """How a line is fitted in an `ImageModel`; the others as in `Fit`."""
        return line_fit.Fit(
            self.bridge_px, float(self.longest_px), float(farthest), widths, model.faintest,
            self._unseen_px, model.half, steps,
        )  # fmt: skip

    @cached_property
    def _unseen_px(self):
        return round(pixels_in(self.params.detection.unseen_gap_mm, self.pixels_per_m))

    def px(self, length_mm: float) -> float:
        """A length in pixels."""
        return length_mm / 1e3 * self.pixels_per_m
