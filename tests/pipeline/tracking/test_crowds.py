"""Lines from frame to frame: of a crowd that moves by more than its spacing, of one whisker."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from dense_row import dense_row, whisker_at
from usual_parameters import options_for

from pipeline.detection import new_lines, ridges
from pipeline.detection.image_model import lines_in_background
from pipeline.detection.static_scene import StaticScene
from pipeline.numerics.angles import wrap_angle
from pipeline.session.recording import Recording
from pipeline.tracking import close_tracks, row_rotation
from pipeline.tracking.registry import find_templates
from pipeline.tracking.track_state import Track
from pipeline.tracking.track_video import track
from pipeline.tracking.tracker import Tracker

pytestmark = pytest.mark.slow

FRAMES = range(100, 180)


@pytest.fixture(scope="module")
def crowd():
    row = dense_row(FRAMES)
    return row.trial, row.scene, row.templates, row.options, row.images


def test_tracks_stay_with_their_whiskers_in_fast_whisking(crowd):
    trial, scene, templates, options, images = crowd
    tracker = Tracker(scene, templates, options)
    last, same, other = {}, 0, 0
    for frame, image in zip(FRAMES, images, strict=True):
        now = {t.number: whisker_at(trial, frame, t.line) for t in tracker.step(image)}
        for number, whisker in now.items():
            if min(whisker, last.get(number, -1)) >= 0:
                same += whisker == last[number]
                other += whisker != last[number]
        last = now
    assert same > 0.8 * len(FRAMES) * len(trial.scene.hairs)
    assert other <= 0.003 * same


def test_it_goes_on_where_all_lines_are_lost_for_some_frames(crowd):
    _, scene, templates, options, images = crowd
    tracker = Tracker(scene, templates, options)
    empty = np.clip(scene.background, 0, 255).astype(np.uint8)
    seen = [
        len(tracker.step(image)) for image in (*images[:3], empty, empty, empty, *images[3:12])
    ]
    assert seen[5] == 0
    assert seen[-1] >= len(templates) - 2


def test_lines_that_are_given_up_and_found_again_at_once_go_on_with_their_tracks(crowd):
    trial, scene, templates, options, images = crowd
    tracker = Tracker(scene, templates, options)
    for image in images[:6]:
        before = {track.number: track.line for track in tracker.step(image)}
    tracker.follower.bends = tracker.follower.bends._replace(at_hook=-1.0)  # no line will do
    after = {track.number: track.line for track in tracker.step(images[6])}
    assert len(set(after) & set(before)) >= len(before) - 2
    for number in set(after) & set(before):
        was = whisker_at(trial, FRAMES[5], before[number])
        assert whisker_at(trial, FRAMES[6], after[number]) == was


def test_while_lines_rest_new_ones_are_looked_for_every_3_ms_and_found(crowd, monkeypatch):
    _, scene, templates, options, images = crowd
    tracker = Tracker(scene, templates, options)
    searched, search = [], tracker._search
    monkeypatch.setattr(tracker, "_search", lambda *at: (searched.append(at), search(*at)))
    empty = np.clip(scene.background, 0, 255).astype(np.uint8)
    for _ in range(20):
        assert tracker.step(empty) == []
    assert len(searched) == 2 + 6  # before it counts as rest, and then in every third frame
    seen = [len(tracker.step(images[0])) for _ in range(3)]
    assert seen[-1] >= len(templates) - 2


@pytest.mark.parametrize("start", [30, 45])
def test_lines_stay_with_their_whiskers_in_a_video_that_begins_amid_a_whisk(crowd, start):
    trial, scene, templates, options, images = crowd
    coarse = slice(start, start + 32, 4)  # a quarter of the frame rate
    lines = next(track(images[coarse], scene, templates, options))
    seen = {}
    for row, (frame, number) in enumerate(zip(lines.frame, lines.whisker, strict=True)):
        line = SimpleNamespace(points=lines.row(row).astype(float), n=len(lines.row(row)))
        true = whisker_at(trial, FRAMES[coarse][frame], line)
        if frame < 6 and true >= 0:
            seen.setdefault(number, set()).add(true)
    assert len(seen) >= len(trial.scene.hairs) - 1
    assert all(len(whiskers) == 1 for whiskers in seen.values())


def test_a_line_that_goes_on_as_its_neighbour_halfway_is_worth_less(crowd):
    _, scene, templates, options, images = crowd
    tracker = Tracker(scene, templates, options)
    for image in images[:3]:
        tracks = tracker.step(image)
    longest = max(tracks, key=lambda track: track.line.n)
    line, k = longest.line.copy(), longest.line.n // 2
    own = tracker.follower.worth(line, longest)
    x, y = line.x[k:] - line.x[k], line.y[k:] - line.y[k]
    turn = np.radians(8)
    line.x[k:] = line.x[k] + x * np.cos(turn) - y * np.sin(turn)
    line.y[k:] = line.y[k] + x * np.sin(turn) + y * np.cos(turn)
    assert tracker.follower.worth(line, longest) < 0.5 * own


SNOUT = 180, 320, 280  # its columns, and the row to which it reaches [px]
SPACING, TURN = np.radians([9.0, 7.0])  # of whiskers, and of each side's in a frame
FAN = np.arange(-3, 4) * SPACING
LEFT, RIGHT = np.radians([160.0, 20.0])  # mean directions: the row of both has none


def snout_with_whiskers(turn):
    """A dark snout, and the directions [rad, from +x to +y] of the whiskers that leave it.

    The left side's whiskers are turned by `turn`, the right side's as much the other way.
    """
    image, shadow = np.full((400, 500), 200.0), np.zeros((400, 500))
    rows, columns = np.mgrid[:400, :500]
    left, right = LEFT + FAN + turn, RIGHT + FAN - turn
    bases = [(SNOUT[0], 150 - 12 * k) for k in range(-3, 4)]
    bases += [(SNOUT[1], 150 + 12 * k) for k in range(-3, 4)]
    for (x, y), angle in zip(bases, [*left, *right], strict=True):
        along = (columns - x) * np.cos(angle) + (rows - y) * np.sin(angle)
        across = (columns - x) * np.sin(angle) - (rows - y) * np.cos(angle)
        shadow += 0.3 * np.exp(-0.5 * across**2) * ((along >= 0) & (along < 130))
    image *= np.exp(-shadow)
    image[: SNOUT[2], SNOUT[0] : SNOUT[1]] = 20
    return image.astype(np.uint8), np.array([*left, *right])


def test_the_sides_of_a_face_turn_against_each_other():
    face = np.zeros((400, 500), bool)
    face[: SNOUT[2], SNOUT[0] : SNOUT[1]] = True
    empty = np.where(face, 20, 200).astype(np.float32)
    scene = StaticScene(empty, 0.0, 4.0, face, np.zeros_like(face), None, "top")
    turns = np.cumsum([0, 0, 1, 1, 1, 1]) * TURN - 2 * TURN
    drawn = [snout_with_whiskers(turn) for turn in turns]
    options = options_for(Recording(500.0, 12.0, "top"))
    first = np.array([drawn[0][0]] * 3)
    tracker = Tracker(scene, find_templates(first, scene, options), options)
    seen = []
    for image, directions in drawn:
        tracks = tracker.step(image)
        off = [np.abs(wrap_angle(row_rotation.direction(t.line) - directions)) for t in tracks]
        seen.append({t.number: int(np.argmin(o)) for t, o in zip(tracks, off, strict=True)})
    assert len(seen[0]) == 14
    assert seen[-1] == seen[0]


FAR_FACE = 40  # columns of a face at the left edge of a wide picture
LONG = 420  # px, of the whisker that leaves it


def long_whisker(amplitude=0.3):
    """A wide picture with one long whisker that leaves a face at the left edge; row 100."""
    rows, columns = np.mgrid[:200, :600]
    seen = (columns >= FAR_FACE) & (columns < FAR_FACE + LONG)
    image = 200 * np.exp(-amplitude * np.exp(-0.5 * (rows - 100.0) ** 2) * seen)
    image[:, :FAR_FACE] = 20
    return image.astype(np.uint8)


def scene_of_long_whisker():
    face = np.zeros((200, 600), bool)
    face[:, :FAR_FACE] = True
    empty = np.where(face, 20, 200).astype(np.float32)
    return StaticScene(empty, 0.0, 4.0, face, np.zeros_like(face), None, "left")


def test_new_lines_are_looked_for_near_the_face_and_followed_to_their_far_ends(monkeypatch):
    scene, options = scene_of_long_whisker(), options_for(Recording(500.0, 12.0, "left"))
    image, looked = long_whisker(), []
    tracker = Tracker(scene, find_templates(np.array([image] * 3), scene, options), options)
    curves_in = ridges.curves_in
    monkeypatch.setattr(ridges, "curves_in", lambda *at: looked.append(at[0]) or curves_in(*at))
    seen = [tracker.step(image)[0].line.n for _ in range(20)]
    columns = looked[0][1]
    assert columns.stop < 0.5 * LONG
    assert seen[0] > columns.stop - FAR_FACE
    assert seen[-1] == pytest.approx(LONG, abs=6)


def lone_tracker(whiskers=1):
    """A tracker of so many whiskers, which has followed the long one for three frames."""
    scene, options = scene_of_long_whisker(), options_for(Recording(500.0, 12.0, "left"))
    image = long_whisker()
    templates = find_templates(np.array([image] * 3), scene, options)
    tracker = Tracker(scene, templates * whiskers, options)
    for _ in range(3):
        tracker.step(image)
    return tracker


def test_a_lone_whisker_may_turn_and_bend_at_once_as_where_it_slips_off_a_pole():
    tracker = lone_tracker()
    (track,) = tracker.tracks
    line, own = track.line.copy(), tracker.follower.worth(track.line, track)
    line.y[: line.n] += 60 * (np.arange(line.n) / line.n) ** 2  # px
    assert tracker.follower.worth(line, track) == pytest.approx(own)


@pytest.mark.parametrize(("whiskers", "every"), [(1, 200), (2, 20)])
def test_lines_at_rest_are_followed_with_few_searches(monkeypatch, whiskers, every):
    tracker, searched = lone_tracker(whiskers), []
    monkeypatch.setattr(tracker, "_search", lambda *at: searched.append(tracker.frame_number))
    for _ in range(600):
        tracker.step(long_whisker())
    assert (np.diff(searched[-3:]) == every).all()  # frames: as of a video of 1000 frames/s


def test_a_lone_whisker_is_found_as_soon_as_the_light_is_on():
    tracker, image = lone_tracker(), long_whisker()
    for _ in range(4):
        for _ in range(9):
            assert tracker.step(np.zeros_like(image)) == []
        assert len(tracker.step(image)) == 1


def test_what_a_known_line_leaves_beside_it_is_not_fitted_again(monkeypatch):
    scene, options = scene_of_long_whisker(), options_for(Recording(500.0, 12.0, "left"))
    image, fitted = long_whisker(), []
    tracker = Tracker(scene, find_templates(np.array([image] * 3), scene, options), options)
    (track,) = tracker.step(image)
    track.line.amplitude *= 0.5  # as if it had got darker: half of its darkness is left
    initialise = new_lines.initialise_line
    monkeypatch.setattr(
        new_lines, "initialise_line", lambda *at: fitted.append(at) or initialise(*at)
    )
    tracker._search(tracker.frame_of(image, 1.0), [])
    assert fitted == []
    tracker.tracks.clear()
    tracker._search(tracker.frame_of(image, 1.0), [])
    assert len(fitted) > 0


@pytest.mark.parametrize("age", [0, 30])
def test_of_two_lines_on_one_whisker_the_surer_one_goes_on_and_lies_on_it(age):
    scene, options = scene_of_long_whisker(), options_for(Recording(500.0, 12.0, "left"))
    image = long_whisker()
    tracker = Tracker(scene, find_templates(np.array([image] * 3), scene, options), options)
    (track,) = tracker.step(image)
    track.age = 60
    beside = Track(track.line.copy(), number=99, age=age)
    for line, off in ((track.line, -0.8), (beside.line, 0.8)):  # px: on its two edges
        line.y += off
        line.amplitude *= 0.6
    tracker.tracks.append(beside)
    with lines_in_background(tracker.model):
        frame = tracker.frame_of(image, 1.0)
        close_tracks.merge(tracker.tracks, tracker.shared_px, frame, tracker.follower)
    assert close_tracks.seen(tracker.tracks) == [track]
    assert np.abs(track.line.points[:, 1] - 100).max() < 0.1  # px


def test_a_line_that_begins_far_from_the_face_is_lost():
    scene, options = scene_of_long_whisker(), options_for(Recording(500.0, 12.0, "left"))
    image = long_whisker()
    tracker = Tracker(scene, find_templates(np.array([image] * 3), scene, options), options)
    (track,) = tracker.step(image)
    tracker.follower.give_up_if_poor(track, tracker.frame_of(image, 1.0))
    assert track.line is not None
    track.line.x += options.base_gap_px + 2
    track.before = track.line.copy()
    tracker.follower.give_up_if_poor(track, tracker.frame_of(image, 1.0))
    assert track.line is None


def test_no_line_is_followed_farther_than_the_longest_whisker_may_reach():
    scene, image = scene_of_long_whisker(), long_whisker()
    options = replace(options_for(Recording(500.0, 12.0, "left")), longest_px=90.0)
    tracker = Tracker(scene, find_templates(np.array([image] * 3), scene, options), options)
    followed = [track.line.n for _ in range(5) for track in tracker.step(image)]
    assert followed == [90] * 5
