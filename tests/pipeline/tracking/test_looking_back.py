"""Lines of a rendered row followed back into frames in which they were not looked for."""

import numpy as np
import pytest

from pipeline.scene.estimate import scene_from_frames
from pipeline.session.recording import Recording
from pipeline.tracking.looking_back import RecentFrames
from pipeline.tracking.options import options_for
from pipeline.tracking.registry import find_templates
from pipeline.tracking.track_video import _tracked
from pipeline.tracking.unlabelled_tracker import UnlabelledTracker
from synthetic.presets import make_trial
from synthetic.render import Renderer

pytestmark = pytest.mark.slow

FRAMES = range(100, 124)
LOST = range(8, 14)  # frames in which a whisker's track is lost, and nothing is looked for
ON = 1.5  # px from a true centreline


@pytest.fixture(scope="module")
def row():
    trial = make_trial("dense_row", 0, 0)
    renderer, camera = Renderer(trial.scene, trial.motion), trial.scene.camera
    recording = Recording(camera.frames_per_second, camera.pixels_per_mm, trial.scene.face.side)
    wide = np.array([renderer.frame(i) for i in range(0, len(trial.motion), 25)])
    scene = scene_from_frames(wide, recording, 0.5e-3, None, len(trial.motion))
    options = options_for(recording)
    templates = find_templates(wide[::2], scene, options)
    return trial, scene, templates, options, [renderer.frame(i) for i in FRAMES]


class LosingTracker(UnlabelledTracker):
    """It loses a track at the first of the frames LOST, in which it looks for no others."""

    lost = 4

    def step(self, image):
        super().step(image)
        if self.frame == LOST[0]:
            self.tracks = [track for track in self.tracks if track.number != self.lost]
        return self.tracks

    def _search_all(self, image, gain):
        if self.frame not in LOST:
            super()._search_all(image, gain)


def followed(row, scenes=None, **changed):
    """The tracker, and the frames that are handed on."""
    _, scene, templates, options, images = row
    tracker = LosingTracker(scene, templates, options)
    tracker.first_frames = 0
    for name, value in changed.items():
        setattr(tracker, name, value)
    return list(_tracked(images, scenes or {0: (scene, 1.0)}, tracker))


def whisker_at(trial, frame, line):
    """True whisker that most of a line's middle lies on, −1 for none."""
    points = line.points[10 : line.n // 2 + 10]
    for hair in range(len(trial.scene.hairs)):
        x, y = trial.motion.centrelines(hair=hair, frames=slice(frame, frame + 1))
        if (np.hypot(points[:, :1] - x, points[:, 1:] - y).min(axis=1) < ON).mean() > 0.5:
            return hair
    return -1


@pytest.mark.parametrize("lost", [0, 3, 5, 8])
def test_a_track_that_was_lost_goes_on_under_its_number_through_the_gap(row, lost):
    frames = followed(row, lost=lost)
    seen = {whisker_at(row[0], FRAMES[k], each.lines[lost]) for k, each in enumerate(frames)}
    assert len(frames) == len(FRAMES)
    assert len(seen) == 1
    assert -1 not in seen


def test_without_looking_back_the_gap_stays_and_the_track_gets_another_number(row):
    frames = followed(row, looks_back=0)
    assert all((4 in seen.lines) == (k < LOST[0]) for k, seen in enumerate(frames))


def test_it_looks_back_through_so_many_frames(row):
    frames = followed(row, looks_back=4)  # the gap's first ones are handed on by then
    whisker = whisker_at(row[0], FRAMES[0], frames[0].lines[4])
    seen = [
        whisker in {whisker_at(row[0], FRAMES[k], line) for line in frames[k].lines.values()}
        for k in LOST
    ]
    assert seen == [False] * (len(LOST) - 3) + [True] * 3


def test_it_does_not_look_back_past_a_change_of_the_scene(row):
    changed = LOST[-1]
    frames = followed(row, {0: (row[1], 1.0), changed: (row[1], 0.5)})
    assert all(4 not in seen.lines for seen in frames[LOST[0] :])
    assert [seen.trust for seen in frames] == [1.0] * changed + [0.5] * (len(FRAMES) - changed)


def test_lines_that_are_followed_back_lie_on_no_other_line(row):
    trial, scene, templates, options, images = row
    tracker = UnlabelledTracker(scene, templates, options)
    tracker.step(images[0])
    tracks, tracker.tracks = tracker.tracks, []
    recent = RecentFrames(tracker)
    list(recent.add(images[0], 1.0))
    for track in tracks:  # the same whiskers once more, as if found later
        tracker.tracks = [track]
        list(recent.add(images[0], 1.0))
    found = [whisker_at(trial, FRAMES[0], line) for line in recent.frames[0].lines.values()]
    assert len(found) >= len(templates) - 2
    assert len(set(found)) == len(found)
