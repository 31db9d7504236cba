"""One line followed into the next frame: where it is predicted, or in strips about there."""

import math

import numpy as np
from numba import njit

from pipeline.detection import line_fit, new_lines
from pipeline.detection.frame import Frame
from pipeline.detection.line import Line, nodes_of
from pipeline.detection.tracing_options import TracingOptions
from pipeline.session.quantities import frames_in
from pipeline.tracking import row_rotation, search
from pipeline.tracking.bends import Bends, is_like_a_whisker
from pipeline.tracking.track_state import Track, predicted

NEAR_PREDICTION_PX = 1.0  # a line that is nearer to its prediction is fitted without a search


class Follower:
    """Follows single lines, by the room's parameters in pixels, frames and radians."""

    def __init__(self, options: TracingOptions):
        self.options, self.params = options, options.params.tracking
        params, scale = self.params, options.pixels_per_m
        self.narrow = int(np.clip(1e-3 * scale * params.narrow_strip_mm, 4, 10))
        self.wide = int(np.clip(1e-3 * scale * params.wide_strip_mm, 10, 30))
        hook = int(max(options.px(params.hook_mm), 30))
        turns = np.radians([params.largest_turn_deg, params.hook_deg])
        self.bends = Bends(float(turns[0]), hook, float(turns[1]))
        self.astray_sd = np.radians(params.astray_deg)
        self.young = max(frames_in(params.young_s, options.frames_per_second), 1)

    def follow(self, track: Track, line: Line, frame: Frame) -> None:
        """Find the track's whisker where it is predicted, else in narrow and wide strips about it.

        `line` is the predicted one, which is changed.
        """
        present = track.line
        # a row's prediction is surer than the line's own motion
        track.expected = line.shortened() if track.before is None else None
        track.age += 1
        best = None
        tries = (0, True), (self.narrow, True), (self.narrow, False), (self.wide, False)
        for half, with_velocity in tries:
            if half and with_velocity and track.before is None:
                continue  # the next one is the same
            if half:
                line = predicted(track, with_velocity)
            self._carry_on(line, track, frame)
            farthest = np.inf if half else NEAR_PREDICTION_PX
            fit = frame.options.fit(frame.model, farthest, widths=True)
            line.n, line.quality = _fitted(
                frame.picture, line.values, line.n, half, fit, frame.workspace.room
            )
            if best is None or self.worth(line, track) > self.worth(best, track):
                best = line
            if best.quality > self.params.good_quality and best.n > 0.8 * present.n:
                break
        track.before, track.line = present, best
        self.give_up_if_poor(track, frame)

    def worth(self, line: Line, track: Track) -> float:
        """How much a line shows of a track's whisker.

        The less, the more it is turned or bent against what is expected of it.
        """
        worth = line.n * line.quality
        if worth <= 0 or track.expected is None:
            return worth
        turn, bend = (of(line, track.expected) for of in (row_rotation.turned, row_rotation.bent))
        return worth * math.exp(-0.5 * (turn**2 + bend**2) / self.astray_sd**2)

    def claim(self, track: Track) -> float:
        """How rightly a track is on its line, to be compared with another one on the same."""
        return self.worth(track.line, track) * (1 - 0.5 ** ((track.age + 1) / self.young))

    def give_up_if_poor(self, track: Track, frame: Frame) -> None:
        """Call a whisker lost where hardly any of it was found, or it is none any more."""
        line, before, model = track.line, track.before, frame.model
        if before is None or before.n == 0:
            before = line
        if (
            line.n < 0.4 * self.options.shortest_px
            or line.quality < self.params.lost_quality
            or not is_like_a_whisker(
                line.values, line.n, before.values, before.n, model.outside, model.off_edges,
                self.options.base_gap_px, self.bends,
            )
        ):  # fmt: skip
            track.given_up = line
            track.lose()

    def _carry_on(self, line: Line, track: Track, frame: Frame) -> None:
        """Lengthen a track's predicted line by what something hides of it, if anything does.

        In front of a real rig, 23 of a mouse's 26 whiskers are found without it, 25 with it.
        """
        n, whole = line.n, track.whole
        if whole is not None and whole.n > n:
            line.n = line_fit.carry_on(
                line.x, line.y, line.amplitude, n, whole.x, whole.y, whole.amplitude, whole.n,
                frame.model.weight, self.options.bridge_px,
            )  # fmt: skip
        if line.n == n:
            track.whole = track.line


@njit(cache=True)
def _fitted(picture, values, n, half, fit, room):
    """Fit a line, and its half-width, where it lies or, of `half` above 0, in a strip about it.

    Returns the number of nodes and the quality.
    """
    if half > 0:
        n = search.capture(picture, values, n, half, room)
    n, quality = line_fit.refine(picture, values, n, fit, room)
    if n >= line_fit.SHORTEST:
        new_lines.fit_width(nodes_of(values).sigma, n, room)
    return n, quality
