"""Lines of a rendered row followed back into frames in which they were not looked for."""

import pytest
from dense_row import dense_row, whisker_at

from pipeline.tracking.looking_back import RecentFrames
from pipeline.tracking.track_video import _tracked
from pipeline.tracking.tracker import Tracker

pytestmark = pytest.mark.slow

FRAMES = range(100, 124)
LOST = range(8, 14)  # frames in which a whisker's track is lost, and nothing is looked for


@pytest.fixture(scope="module")
def row():
    return dense_row(FRAMES)


class LosingTracker(Tracker):
    """It loses a track at the first of the frames LOST, in which it looks for no others."""

    lost = 4

    def step(self, image):
        super().step(image)
        if self.frame_number == LOST[0]:
            self.tracks = [track for track in self.tracks if track.number != self.lost]
        return self.tracks

    def _search(self, frame, given_up):
        if self.frame_number not in LOST:
            super()._search(frame, given_up)


def followed(row, scenes=None, **changed):
    """The tracker, and the frames that are handed on."""
    tracker = LosingTracker(row.scene, row.templates, row.options)
    tracker.first_frames = 0
    for name, value in changed.items():
        setattr(tracker, name, value)
    return list(_tracked(row.images, scenes or {0: (row.scene, 1.0)}, tracker))


@pytest.mark.parametrize("lost", [0, 3, 5, 8])
def test_a_track_that_was_lost_goes_on_under_its_number_through_the_gap(row, lost):
    frames = followed(row, lost=lost)
    seen = {whisker_at(row.trial, FRAMES[k], each.lines[lost]) for k, each in enumerate(frames)}
    assert len(frames) == len(FRAMES)
    assert len(seen) == 1
    assert -1 not in seen


def test_without_looking_back_the_gap_stays_and_the_track_gets_another_number(row):
    frames = followed(row, looks_back=0)
    assert all((4 in seen.lines) == (k < LOST[0]) for k, seen in enumerate(frames))


def test_it_looks_back_through_so_many_frames(row):
    frames = followed(row, looks_back=4)  # the gap's first ones are handed on by then
    whisker = whisker_at(row.trial, FRAMES[0], frames[0].lines[4])
    seen = [
        whisker in {whisker_at(row.trial, FRAMES[k], line) for line in frames[k].lines.values()}
        for k in LOST
    ]
    assert seen == [False] * (len(LOST) - 3) + [True] * 3


def test_it_does_not_look_back_past_a_change_of_the_scene(row):
    changed = LOST[-1]
    frames = followed(row, {0: (row.scene, 1.0), changed: (row.scene, 0.5)})
    assert all(4 not in seen.lines for seen in frames[LOST[0] :])
    assert [seen.trust for seen in frames] == [1.0] * changed + [0.5] * (len(FRAMES) - changed)


def test_lines_that_are_followed_back_lie_on_no_other_line(row):
    tracker, image = Tracker(row.scene, row.templates, row.options), row.images[0]
    tracker.step(image)
    tracks, tracker.tracks = tracker.tracks, []
    recent = RecentFrames(tracker)
    list(recent.add(image, 1.0))
    for track in tracks:  # the same whiskers once more, as if found later
        tracker.tracks = [track]
        list(recent.add(image, 1.0))
    found = [whisker_at(row.trial, FRAMES[0], line) for line in recent.frames[0].lines.values()]
    assert len(found) >= len(row.templates) - 2
    assert len(set(found)) == len(found)


def test_frames_are_kept_without_the_room_that_lines_have_to_grow(row):
    tracker = Tracker(row.scene, row.templates, row.options)
    recent = RecentFrames(tracker)
    for image in row.images[:2]:
        tracker.step(image)
        list(recent.add(image, 1.0))
    for track in tracker.tracks:
        kept = recent.frames[-1].lines[track.number]
        assert kept.values.shape[1] == kept.n < track.line.values.shape[1]
        assert (kept.points == track.line.points).all()
