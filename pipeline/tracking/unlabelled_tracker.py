"""Follow the lines of whiskers that stand close together, not knowing which is which.

Every line that leaves the face and is strong enough gets a track of its own, with a number that
no other track ever has; where a line is lost, its track ends. Which tracks are which whisker's is
decided when the whole video has been seen (`pipeline.identity`).
"""

import itertools
import math

import numpy as np

from pipeline.detection import detect, line_choice, one_or_two
from pipeline.detection.image_model import lines_in_background
from pipeline.detection.line import Line
from pipeline.numerics import polyline
from pipeline.session.quantities import frames_in
from pipeline.tracking import row_rotation, two_sides
from pipeline.tracking.matching import crowded
from pipeline.tracking.registry import WhiskerTemplate, usual_strength
from pipeline.tracking.track_state import Track, moved_on, predicted
from pipeline.tracking.tracker import DOUBLE_SHARE, Tracker


class UnlabelledTracker(Tracker):
    """Follow all lines of a crowd through consecutive frames of one static scene."""

    crowded = True

    def __init__(self, scene, templates, options):
        super().__init__(scene, templates, options)
        params = options.params.tracking
        self.faintest = params.faint_share * min(
            usual_strength(template.samples) for template in templates
        )
        self.template = WhiskerTemplate(
            "", np.zeros(2), options.shortest_px, longest_px=options.longest_px
        )
        self.number = itertools.count()
        self.tracks = []
        self.first_frames = frames_in(params.first_frames_s, options.frames_per_second)
        self.pivot = options.px(params.crowd_pivot_mm)
        self.along = np.asarray(self.ruler.along, float)
        self.cuts = two_sides.cuts_between(templates, self.along, options.params.identity)
        self.astray_sd = np.radians(params.astray_deg)
        self.young = max(frames_in(params.young_s, options.frames_per_second), 1)
        self.rest = max(frames_in(params.rest_s, options.frames_per_second), 1)
        few = len(templates) < row_rotation.FEWEST_TOGETHER
        self.seldom = self.search_every if few else self.rest  # a few seldom hide another one
        self.looks_back = frames_in(params.look_back_s, options.frames_per_second)
        self.unchanged = 0  # frames since a track began or ended

    def step(self, image) -> list[Track]:
        """Advance by one frame; return the tracks of all lines that are seen."""
        self.frame_number += 1
        frame, relit = self._lit(image)
        before = len(self.tracks)
        with lines_in_background(self.model):
            self._follow_all(frame)
            self.tracks = [t for t in self.tracks if t.line is not None]
            self.unchanged = 0 if relit or len(self.tracks) != before else self.unchanged + 1
            if self.unchanged < self.rest or self.unchanged % self.seldom == 0:
                self._search_all(frame)
            self._merge(frame)
        return self.tracks

    def settle_in(self, frames) -> None:
        """Learn how the lines move in the first frames, there and back, before these are tracked.

        A row that is seen in one frame alone fits the next one nearly as well when it has moved
        on by a whisker.
        """
        for image in (*frames, *frames[-2:0:-1]):
            self.unchanged = 0  # every frame is searched
            self.step(image)
        second = {t.number: t.line.copy() for t in self.tracks}
        self.step(frames[0])
        lines = [t.line for t in self.tracks]
        turn = [
            row_rotation.turned(second[t.number], t.line) if t.number in second else np.nan
            for t in self.tracks
        ]
        turn = self.even_turns(lines, np.array(turn))
        for track, angle in zip(self.tracks, turn, strict=True):
            track.line, track.before = (self._turned_back(track.line, k * angle) for k in (1, 2))
        self.frame_number, self.unchanged = -1, 0

    def _turned_back(self, line, angle) -> Line:
        """A copy of the line, turned against the row's turn."""
        back = moved_on(line, None)
        row_rotation.turn_line(back, -angle, self.pivot)
        return back

    def change_scene(self, scene) -> None:
        """As of `Tracker`."""
        super().change_scene(scene)
        self.near_face = detect.near_face(self.model, self.options)

    def _search_all(self, frame) -> None:
        """Begin a track for every line that has none."""
        lines = [t.line for t in self.tracks]
        self.model.held.hold(lines)
        wanted = detect.Wanted(least=self.faintest, part=self.near_face)
        for line in detect.detect_crowded(frame, lines, wanted):
            track = Track(self.template, number=next(self.number))
            track.take(line)
            self.tracks.append(track)
            self.unchanged = 0

    def _predict_turns(self, present, frame) -> None:
        """Predict the tracks of a row by the turn that it makes, surer than each one's own motion.

        A few lines are no row: one that slips off the pole moves unlike the others.
        """
        for track in present:
            track.turn = (0.0, 0.0)
        for row in self._rows([track.line for track in present]):
            if len(row) >= row_rotation.FEWEST_TOGETHER:
                self._predict_row([present[k] for k in row], frame)

    def _predict_row(self, row, frame) -> None:
        """`_predict_turns` of the tracks of one row."""
        lines = [moved_on(track.line, None) for track in row]
        last = np.array([track.turned_to(track.line) for track in row])
        turn = row_rotation.even_turns(row_rotation.places(lines), last)
        for line, angle in zip(lines, turn, strict=True):
            row_rotation.turn_line(line, angle, self.pivot)
        turn += row_rotation.common_turns(frame.picture, lines, self.pivot)
        for track, angle in zip(row, turn, strict=True):
            track.turn, track.before = (float(angle), self.pivot), None

    def _merge(self, frame) -> None:
        """Let one line stand for two that run together, where it explains as much."""
        lines = [t.line for t in self.tracks]
        self.model.held.hold(lines)
        near = polyline.near_pairs(lines, self.shared_px, polyline.FINE)
        for i, j in np.argwhere(np.triu(near)):
            pair = self.tracks[i], self.tracks[j]
            if any(_run_together(*two) for two in (pair, pair[::-1])):
                self._merge_two(*sorted(pair, key=self._claim), frame)
        self.tracks = [t for t in self.tracks if t.line is not None]

    def _merge_two(self, faint, other, frame) -> None:
        """`_merge` of two tracks, of which `faint` is the less sure one."""
        if not _run_together(faint, other):
            return
        lines, held = (faint.line, other.line), self.model.held
        for line in lines:
            held.take_out(line)
        one = one_or_two.one_for_two(frame, *lines)
        if one is not None:
            other.take(one, other.before)
            faint.lose()
        for track in (faint, other):
            if track.line is not None:
                held.put_in(track.line)

    def _drop_ghosts(self, present) -> None:
        """Give up what is another whisker's blur; a line that has lasted is none."""
        params = self.options.params.detection
        tracks = [t for t in present if t.line is not None]
        near = polyline.near_pairs([t.line for t in tracks], line_choice.ghost_reach(params))
        for track, beside in zip(tracks, near, strict=True):
            if track.age < self.established:
                others = [tracks[k].line for k in np.flatnonzero(beside) if tracks[k].line]
                if line_choice.is_ghost(track.line, others, params):
                    track.lose()

    def found_before(self, line, turn, frame, beside) -> Line | None:
        """A line of one frame in the frame before it, `beside` others; None where it is not seen.

        turn : by how much it is likely to have turned [rad]
        """
        track = Track(self.template, turn=(float(turn), self.pivot))
        track.take(line)
        with lines_in_background(self.model, beside):
            self._follow(track, frame, predicted(track, False))
        return track.line

    def even_turns(self, lines, turn) -> np.ndarray:
        """Turns of all lines as in `row_rotation.even_turns`, of each side's row by itself."""
        even = np.zeros(len(lines))
        for row in self._rows(lines):
            places = row_rotation.places([lines[k] for k in row])
            even[row] = row_rotation.even_turns(places, turn[row])
        return even

    def _rows(self, lines) -> list[np.ndarray]:
        """Indices of the lines of each side of the face: the sides turn against each other."""
        bases = np.array([(line.x[0], line.y[0]) for line in lines]).reshape(-1, 2)
        side = two_sides.side_of(bases @ self.along, self.cuts)
        return [own for k in range(len(self.cuts) + 1) if len(own := np.flatnonzero(side == k))]

    def _follow(self, track, frame, line) -> None:
        track.expected = None
        if track.before is None:  # predicted by the row: surer than by its own motion
            track.expected = line.shortened()
        track.age += 1
        super()._follow(track, frame, line)

    def _worth(self, line, track) -> float:
        """The less, the more it is turned or bent against what is expected of it."""
        worth = super()._worth(line, track)
        if worth <= 0 or track.expected is None:
            return worth
        turn, bend = (of(line, track.expected) for of in (row_rotation.turned, row_rotation.bent))
        return worth * math.exp(-0.5 * (turn**2 + bend**2) / self.astray_sd**2)

    def _claim(self, track) -> float:
        return self._worth(track.line, track) * (1 - 0.5 ** ((track.age + 1) / self.young))


def _run_together(faint, other) -> bool:
    """Whether most of a track's line lies on that of another track; not where one is lost."""
    if faint.line is None or other.line is None:
        return False
    reach = line_choice.reach(other.line)
    return line_choice.shared_fraction(faint.line, other.line, reach) >= DOUBLE_SHARE


def is_crowd(templates, options) -> bool:
    """Whether lines get their names in the end: where whiskers pass for each other.

    Without given lengths there may also be others, beside those of the templates.
    """
    if not options.visible_px:
        return len(templates) > 0
    return crowded([template.signature for template in templates], options)
