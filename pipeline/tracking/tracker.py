"""Whiskers followed from frame to frame, identities kept: `Tracker` holds the state."""

import numpy as np
from scipy.optimize import linear_sum_assignment

from pipeline.detection import detect, line_choice, line_fit, neighbours, new_lines, tails
from pipeline.detection.frame import Frame
from pipeline.detection.image_model import ImageModel, lines_in_background
from pipeline.detection.line import Line, Workspace
from pipeline.detection.refinement import refine, refine_held
from pipeline.detection.static_scene import StaticScene
from pipeline.detection.tracing_options import TracingOptions
from pipeline.numerics import polyline
from pipeline.session.quantities import frames_in, pixels_in
from pipeline.tracking import matching, search
from pipeline.tracking.bends import Bends, is_like_a_whisker, turning_range
from pipeline.tracking.matching import Ruler
from pipeline.tracking.registry import WhiskerTemplate, usual_absorbance
from pipeline.tracking.track_state import Track, moved_on, predicted

NEAR_PREDICTION_PX = 1.0  # a line that is nearer to its prediction is fitted without a search
DOUBLE_SHARE = 0.6  # part of two lines that may coincide before one of them is given up
NEAR_SHIFTS = np.radians([-8, -4, 0, 4, 8])  # of all angles, where some whiskers are followed
KEPT = 0.95  # part of two lines that must still be found when they have exchanged far parts
RELIT = 0.3  # change of the light from one frame to the next: what was too dark may be seen


class Tracker:
    """Follow the whiskers of the templates through consecutive frames of one static scene."""

    crowded = False  # whether whiskers stand so close that they pass for each other
    looks_back = 0  # frames through which new tracks are followed back in time

    def __init__(
        self, scene: StaticScene, templates: list[WhiskerTemplate], options: TracingOptions
    ):
        self.options = options
        self.names = tuple(template.name for template in templates)
        self.tracks = [Track(template, number=k) for k, template in enumerate(templates)]
        self.workspace = Workspace.for_picture(scene.background.shape, options.spacing_px)
        samples = [line for template in templates for line in template.samples]
        self.absorbed = usual_absorbance(samples)
        self.change_scene(scene)
        self.params = options.params.tracking
        self._set_limits(options)
        self.since_search = self.search_every
        self.gain = 1.0
        self.frame_number = -1
        self.ruler = Ruler.of(scene.face_side, options)

    def _set_limits(self, options):
        """The room's parameters in pixels, frames and radians."""
        params, scale = self.params, options.pixels_per_m
        self.narrow = int(np.clip(1e-3 * scale * params.narrow_strip_mm, 4, 10))
        self.wide = int(np.clip(1e-3 * scale * params.wide_strip_mm, 10, 30))
        self.neighbour_px = pixels_in(params.neighbour_mm, scale)
        self.shared_px = pixels_in(params.shared_pixels_mm, scale)
        self.same_px = pixels_in(params.same_line_mm, scale)
        hook = int(max(options.px(params.hook_mm), 30))
        turns = np.radians([params.largest_turn_deg, params.hook_deg])
        self.bends = Bends(float(turns[0]), hook, float(turns[1]))
        times = params.search_every_s, params.established_s
        frames = [max(frames_in(time, options.frames_per_second), 1) for time in times]
        self.search_every, self.established = frames

    def change_scene(self, scene: StaticScene) -> None:
        """Go on with another background: something large has moved."""
        params = self.options.params.detection
        self.model = ImageModel.from_scene(scene, params, absorbed=self.absorbed)

    def step(self, image) -> list[Track]:
        """Advance by one frame; return the tracks, `line` None where a whisker is lost."""
        self.frame_number += 1
        frame, relit = self._lit(image)
        with lines_in_background(self.model):
            self._follow_all(frame)
            missing = [t for t in self.tracks if t.line is None]
            self.since_search += 1
            just_lost = any(t.lost_for in (1, 2) for t in missing)
            if missing and (just_lost or relit or self.since_search >= self.search_every):
                self._search(missing, frame)
                self.since_search = 0
        return self.tracks

    def _lit(self, image) -> tuple[Frame, bool]:
        """The `Frame` of an image, and whether the light has just changed."""
        gain, before = self.model.gain(image), self.gain
        self.gain = gain
        return self.frame_of(image, gain), abs(gain - before) > RELIT * max(gain, before)

    def frame_of(self, image, gain) -> Frame:
        """An image, `gain` times as bright as the background, as a frame of the present scene."""
        return Frame(image, self.model, gain, self.options, self.workspace)

    def _follow_all(self, frame) -> None:
        """Follow every present whisker, each against a background that holds its neighbours.

        Afterwards it still holds them.
        """
        present = [t for t in self.tracks if t.line is not None]
        self._predict_turns(present, frame)
        lines = [predicted(track, True) for track in present]
        beside = polyline.near_pairs(lines, self.neighbour_px).any(axis=1)
        held = self.model.held
        held.hold([lines[k] for k in np.flatnonzero(beside)])
        for k, track in enumerate(present):
            if beside[k]:
                held.take_out(lines[k])
            self._follow(track, frame, lines[k])
            lines[k] = track.line or moved_on(track.before, None)
            if beside[k]:
                held.put_in(lines[k])
        # again beside those whose lines are known now, where their pixels are shared
        sharing = polyline.near_pairs(lines, self.shared_px, polyline.FINE)
        for k in np.flatnonzero(sharing.any(axis=1)):
            held.put_in(lines[k])

        def fit(k):
            self._refine_shared(present[k], lines, sharing[k], frame)

        neighbours.fit_together(lines, sharing, fit)
        self._drop_doubles(present)
        if sharing.any():
            self._uncross(present, frame)
        self._drop_ghosts(present)

    def _refine_shared(self, track: Track, lines: list[Line], sharing, frame) -> None:
        """Fit a track's line beside the others, with some of which it shares pixels.

        lines : all of the frame, held in the background; sharing : (lines,) bool
        """
        if track.line is None:
            return
        refine_held(frame, track.line)
        if not self.crowded:  # there, whiskers do lie upon each other
            self._untangle(track, [lines[k] for k in np.flatnonzero(sharing)], frame)
        self._give_up_if_poor(track)

    def _untangle(self, track: Track, beside: list[Line], frame) -> None:
        """Take a line back from another whisker's far part, onto which it went at a crossing.

        Without it, a rendered row's line stays there for up to ten frames (test_tracker).
        """
        line, known, held = track.line, track.before, self.model.held
        for other in beside:
            start = tails.shared_tail(line.x, line.y, line.n, other.x, other.y, other.n)
            if known is None or line.n - start < tails.LEAST:
                continue
            n = tails.regrow(line.x, line.y, line.n, start, known.x, known.y, known.n)
            if n > 0:
                line.n = n
                refine_held(frame, line)
                again = tails.shared_tail(line.x, line.y, line.n, other.x, other.y, other.n)
                if line.n - again >= tails.LEAST:
                    held.take_out(line)
                    line.n = max(again, 1)
                    held.put_in(line)

    def _predict_turns(self, present: list[Track], frame) -> None:
        """Set what the tracks turn by, where more is known than each line's own motion."""

    def _drop_ghosts(self, present: list[Track]) -> None:
        """Give up what is another whisker's blur, where whiskers stand close together."""

    def _drop_doubles(self, present: list[Track]) -> None:
        """Of two tracks on one whisker, give up the one that fits worse."""
        tracks = [t for t in present if t.line is not None]
        near = self.same_px
        for i, j in np.argwhere(np.triu(polyline.near_pairs([t.line for t in tracks], near))):
            a, b = tracks[i], tracks[j]
            if a.line is None or b.line is None:
                continue
            both = (a.line, b.line), (b.line, a.line)
            if all(_near(one, other, near) > DOUBLE_SHARE for one, other in both):
                min((a, b), key=self._claim).lose()

    def _claim(self, track: Track) -> float:
        """How rightly a track is on its line, to be compared with another one on the same."""
        return track.line.quality * track.line.n / track.template.visible_px

    def _uncross(self, present: list[Track], frame) -> None:
        """Let lines that have turned off onto each other go on with their own far parts.

        Rows of real whiskers need it: without it, fewer of the whiskers that a person has
        followed are found (24 in place of 25 of a mouse's 26, 8 in place of 10 of a rat's 12
        faint ones).
        """
        tracks = [t for t in present if t.line is not None]
        changed = detect.uncrossed([t.line for t in tracks], self.options)
        if not changed:
            return
        known = {id(line): before for line, before in changed}
        held = self.model.held
        held.hold([t.line for t in tracks if id(t.line) not in known])
        held.hold([t.line for t in tracks])
        for line, _ in changed:
            refine_held(frame, line)
        pairs = [(t, known[id(t.line)]) for t in tracks if id(t.line) in known]
        if sum(t.line.n * t.line.quality - KEPT * k.n * k.quality for t, k in pairs) < 0:
            for track, line in pairs:  # less is found of them so: they had their own
                track.line = line
            return
        reassign_lines([track for track, _ in pairs])
        for track, _ in pairs:
            track.before = None  # the far part's motion is unknown
            self._give_up_if_poor(track)

    def _follow(self, track: Track, frame, line: Line) -> None:
        """Find the track's whisker where it is predicted, else in narrow and wide strips about it.

        `line` is the predicted one, which is changed.
        """
        present = track.line
        best = None
        tries = (0, True), (self.narrow, True), (self.narrow, False), (self.wide, False)
        for half, with_velocity in tries:
            if half and with_velocity and track.before is None:
                continue  # the next one is the same
            if half:
                line = predicted(track, with_velocity)
            self._carry_on(line, track)
            if half:
                self._capture(line, frame, half)
            farthest = np.inf if half else NEAR_PREDICTION_PX
            refine(frame, line, farthest, widths=self.crowded)
            if self.crowded and line.n >= line_fit.SHORTEST:
                new_lines.fit_width(line, self.workspace)
            if best is None or self._worth(line, track) > self._worth(best, track):
                best = line
            if best.quality > self.params.good_quality and best.n > 0.8 * present.n:
                break
        track.before, track.line, track.lost_for = present, best, 0
        self._give_up_if_poor(track)

    def _worth(self, line: Line, track: Track) -> float:
        """How much a line that was found shows of the track's whisker."""
        return line.n * line.quality

    def _carry_on(self, line: Line, track: Track) -> None:
        """Lengthen a track's predicted line by what something hides of it, if anything does.

        In front of a real rig, 23 of a mouse's 26 whiskers are found without it, 25 with it.
        """
        n, whole = line.n, track.whole
        if whole is not None and whole.n > n:
            line.n = line_fit.carry_on(
                line.x, line.y, line.amplitude, n, whole.x, whole.y, whole.amplitude, whole.n,
                self.model.weight, self.options.bridge_px,
            )  # fmt: skip
        if line.n == n:
            track.whole = track.line

    def _give_up_if_poor(self, track: Track) -> None:
        """Call a whisker lost where hardly any of it was found, or it is none any more."""
        line, before, model = track.line, track.before, self.model
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
            track.lose()

    def _capture(self, line: Line, frame, half) -> None:
        """Move a line onto the best path of a strip of `half` px to both sides."""
        line.n = search.capture(frame.picture, line.values, line.n, half, self.workspace.room)

    def _search(self, missing: list[Track], frame) -> None:
        """Look at the whole frame for the missing whiskers."""
        for track in missing:
            track.lost_for += 1
        present = [t for t in self.tracks if t.line is not None]
        lines = [t.line for t in present]
        found = self._unknown(lines, frame)
        if 0 < len(found) < len(missing):
            found += self._unknown([*lines, *found], frame)
        if not found:
            return
        got = matching.match(
            self.ruler.signatures(found),
            np.array([t.template.signature for t in missing]),
            self.ruler.sd,
            *self._expected_shift(present),
        )
        for line, whisker in got.pairs:
            track = missing[whisker]
            track.take(found[line])
        if len(self.tracks) > 1 and got.pairs:
            self._uncross(self.tracks, frame)

    def _unknown(self, known: list[Line], frame) -> list[Line]:
        """Lines in the whole frame beside known ones, which would cut off those they cross."""
        self.model.held.hold([])
        with lines_in_background(self.model, known):
            found = detect.detect(frame)
        found = [c for c in found if all(line_choice.shared_fraction(c, p) < 0.4 for p in known)]
        own = self.options.params.detection
        found = [c for c in found if not line_choice.is_ghost(c, known, own)]
        return [c for c in found if turning_range(c.x, c.y, c.n) < self.bends.largest]

    def _expected_shift(self, present):
        """Shifts of all angles to try, and the one to try them around [rad]."""
        if not present:
            return matching.SHIFTS, 0.0
        return NEAR_SHIFTS, self._shift(present)

    def _shift(self, tracks) -> float:
        """By how much the angles of some present whiskers are off those of the templates [rad]."""
        seen = self.ruler.signatures([t.line for t in tracks])
        known = np.array([t.template.signature for t in tracks])
        return matching.common_turn(seen, known)


def reassign_lines(tracks: list[Track]) -> None:
    """Give the lines of some tracks to those whose lines before they are most like.

    Two lines that have exchanged far parts close to their bases have practically exchanged tracks.
    """
    lines = [t.line for t in tracks]
    turned = np.nan_to_num([[t.turned_to(line) for t in tracks] for line in lines])
    for line, track in zip(*linear_sum_assignment(np.square(turned)), strict=True):
        tracks[track].take(lines[line], tracks[track].before)


def _near(a: Line, b: Line, near_px: float) -> float:
    """Fraction of line `a` within `near_px` of line `b`."""
    return polyline.share_near(a.x, a.y, a.n, b.x, b.y, b.n, near_px, (4, 4))
