"""Following the lines of whiskers that stand close together, whichever whisker each is.

Every line that leaves the face and is strong enough gets a track of its own, with a number that
no other track ever has; where a line is lost, its track ends. Which tracks are which whisker's is
decided when the whole video has been seen (`whole_video`).
"""

import itertools

import numpy as np

from pipeline import common_turn, detection
from pipeline.identities import crowded
from pipeline.roster import Slot
from pipeline.tracing import FEWEST_TOGETHER, PIVOT, SEARCH_EVERY, Tracer, Track, chord_angle, foretold, turning_range

SPARE = 6  # tracks at most beside one for each whisker: some lines are nobody's
FAINT = 0.5  # of the faintest whisker's length × absorbance: less is a hair of the fur
BASE_M = 6e-3  # from the face
ASTRAY_SD = np.radians(4.0)
MOST_BENT = np.radians(32)  # over that: what bends more goes from the fur's edge onto a whisker
SEARCH_EVERY_CROWDED = 5  # frames between two full detections while lines are missing


class CrowdTracer(Tracer):
    """Follow all lines of a crowd through consecutive frames of one static scene."""

    crowded = True

    def __init__(self, scene, roster, options):
        super().__init__(scene, roster, options)
        self.most = len(roster) + SPARE
        self.usual = len(roster)
        self.faintest = FAINT * min(_strength(slot) for slot in roster)
        self.slot = Slot("", np.zeros(2), options.shortest_px, longest_px=options.longest_px)
        self.number = itertools.count()
        self.tracks = []
        self.lost_at = -2
        self.base = int(BASE_M * options.pixels_per_m)

    def step(self, image) -> list[Track]:
        """Advance by one frame; return the tracks of all lines that are seen."""
        self.frame += 1
        gain = self.model.gain(image)
        self._follow_all(image, gain)
        before = len(self.tracks)
        self.tracks = [t for t in self.tracks if t.line is not None]
        if len(self.tracks) < before:
            self.lost_at = self.frame
        self.since_search += 1
        every = SEARCH_EVERY_CROWDED if len(self.tracks) < self.usual else SEARCH_EVERY
        if self.frame - self.lost_at < 2 or self.since_search >= every:
            self._search_all(image, gain)
            self.since_search = 0
        return self.tracks

    def _search_all(self, image, gain) -> None:
        """Begin a track for every line that has none."""
        lines = [t.line for t in self.tracks]
        found = detection.detect_crowded(
            image, self.model, gain, self.options, self.workspace, lines
        )
        for line in found:  # the strongest first
            if len(self.tracks) >= self.most:
                break
            if self._is_bent(line):
                continue
            if detection.contrast_length(line) >= self.faintest:
                track = Track(self.slot, number=next(self.number))
                track.take(line)
                self.tracks.append(track)

    def _worth(self, line, expected) -> float:
        off = chord_angle(line, expected.n) - chord_angle(expected, line.n)
        return super()._worth(line, expected) * np.exp(-0.5 * (off / ASTRAY_SD) ** 2)

    def _follow(self, track, image, gain, line) -> None:
        expected = line.copy()
        super()._follow(track, image, gain, line)
        track.age += 1
        track.worth = self._worth(track.line, expected) * (1 - 0.5 ** (track.age / 5)) if track.line is not None else 0.0

    def _right(self, track) -> float:
        return track.worth

    def _turn_together(self, present, image, gain) -> None:
        """Tell the tracks how the whole row turns, which is surer than one line's own motion."""
        lines = [foretold(t.line, None) for t in present]
        last = np.array([
            chord_angle(t.line, t.before.n) - chord_angle(t.before, t.line.n) if t.before is not None else np.nan
            for t in present
        ])
        place = np.array([chord_angle(line) for line in lines])
        turn = _smooth(place, last)
        for line, angle in zip(lines, turn, strict=True):
            common_turn.turn_line(line, angle, PIVOT)
        m = self.model
        if len(lines) >= FEWEST_TOGETHER:
            turn = turn + common_turn.common_turns(image, m.background, m.weight, gain, lines, PIVOT)
        for track, angle in zip(present, turn, strict=True):
            track.turns = (float(angle), float(angle))
            track.before = None

    def _give_up_if_poor(self, track: Track) -> None:
        super()._give_up_if_poor(track)
        if track.line is not None and self._is_bent(track.line):
            track.lose()

    def _is_bent(self, line) -> bool:
        return turning_range(line.x, line.y, min(line.n, self.base)) > MOST_BENT


def _smooth(place, turn):
    """Turns of all lines at their places, from those known, as of a straight line through them."""
    known = np.isfinite(turn)
    if known.sum() < FEWEST_TOGETHER:
        return np.full(len(turn), np.median(turn[known]) if known.any() else 0.0)
    keep = known.copy()
    for _ in range(4):
        slope, at = np.polyfit(place[keep], turn[keep], 1) if np.ptp(place[keep]) > 0.2 else (0.0, np.median(turn[keep]))
        off = np.abs(turn - at - slope * place)
        limit = max(2.5 * 1.48 * np.median(off[known]), np.radians(0.5))
        keep = known & (off < limit)
        if keep.sum() < FEWEST_TOGETHER:
            keep = known
            break
    return at + slope * place


def is_crowd(roster, options) -> bool:
    """Whether a roster's whiskers stand so close that they pass for each other."""
    return crowded([slot.signature for slot in roster], options)


def _strength(slot) -> float:
    """Length × absorbance of a roster's whisker [px]; 0 where it was never seen."""
    return float(np.median([detection.contrast_length(line) for line in slot.samples] or [0.0]))
