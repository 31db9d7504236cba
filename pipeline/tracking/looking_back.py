"""Follow lines back in time, into the last frames before they were found.

Where whiskers part again, or come out of the fur, they are found some frames late. From there they
can be followed back, often to where they had been lost: then the track goes on under its number.
"""

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from pipeline.detection import line_choice
from pipeline.detection.line import Line
from pipeline.detection.line_end import end_thickness
from pipeline.tracking import row_rotation
from pipeline.tracking.close_tracks import DOUBLE_SHARE

APART = 0.4  # part of a line that may lie along another one, if it is another whisker


@dataclass
class TrackedFrame:
    """A frame, the light in it, the trust in its scene, and its lines by their tracks' numbers."""

    image: np.ndarray
    gain: float
    trust: float
    lines: dict[int, Line]


class RecentFrames:
    """The frames that a tracker has gone through last, before they are handed on."""

    def __init__(self, tracker):
        self.tracker = tracker
        self.frames = deque()

    def add(self, image, trust) -> Iterator[TrackedFrame]:
        """Note the frame that the tracker has just gone through; hand on those of long ago."""
        tracker = self.tracker
        lines = {t.number: t.line for t in tracker.tracks}
        picture = tracker.model.picture(image, tracker.gain)
        kept = {number: self._kept(line, picture) for number, line in lines.items()}
        self.frames.append(TrackedFrame(image, tracker.gain, trust, kept))
        self._follow_back(lines)
        yield from self.hand_on(tracker.looks_back)

    def hand_on(self, but: int = 0) -> Iterator[TrackedFrame]:
        """Hand on all frames `but` the last ones."""
        while len(self.frames) > but:
            yield self.frames.popleft()

    def _follow_back(self, lines) -> None:
        """Follow the tracks that begin in the last frame back, until they are lost or meet one.

        lines : of the last frame, by their tracks' numbers, with room to be lengthened
        """
        for later, seen in pairwise(reversed(self.frames)):
            going = sorted(set(lines) - set(seen.lines))
            if not going:
                return
            turns = self._turns_back(later.lines, seen.lines)
            found = {k: self._line_before(lines[k], k, turns[k], later, seen) for k in going}
            lines = {number: line for number, line in found.items() if line is not None}

    def _turns_back(self, later, earlier) -> dict[int, float]:
        """By how much lines turn from a frame to the one before [rad], all as the row does."""
        turned = [
            row_rotation.turned(earlier[number], line) if number in earlier else np.nan
            for number, line in later.items()
        ]
        even = self.tracker.rows.even_turns(list(later.values()), np.array(turned))
        return dict(zip(later, even, strict=True))

    def _line_before(self, line, number, turn, later, seen) -> Line | None:
        """A track's line in the frame before, where it goes back as one that is no other's."""
        lines = seen.lines
        beside = [each for other, each in lines.items() if other in later.lines]
        frame = self.tracker.frame_of(seen.image, seen.gain)
        line = self.tracker.found_before(line, turn, frame, beside)
        if line is None:
            return None
        met = [other for other in lines if _share(line, lines[other]) > APART]
        if not met:
            lines[number] = self._kept(line, frame.picture)
            return line
        if len(met) == 1 and met[0] not in later.lines and _is_same(line, lines[met[0]]):
            self._go_on_as(number, met[0])
        return None

    def _kept(self, line, picture) -> Line:
        """A copy of a line to hand on; its end is measured while its pixels are in the cache."""
        kept = line.shortened()
        if self.tracker.options.ends:
            kept.end = end_thickness(picture, line.values, line.n)
        return kept

    def _go_on_as(self, number, before) -> None:
        """Let a track go on under the number of the one that ended where it begins."""
        for seen in self.frames:
            if number in seen.lines:
                seen.lines[before] = seen.lines.pop(number)
        for track in self.tracker.tracks:
            if track.number == number:
                track.number = before


def _is_same(line, other) -> bool:
    """Whether two lines of a frame are one whisker's.

    They may lie farther apart than doubles (`close_tracks`): one was followed back to where
    whiskers blur into each other.
    """
    return min(_share(line, other), _share(other, line)) > DOUBLE_SHARE


def _share(line, other) -> float:
    """Part of a line that lies along another one."""
    return line_choice.shared_fraction(line, other, line_choice.reach(other))
