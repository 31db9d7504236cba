"""Changed pictures: what was seen at a place is still there, and what is found is turned back."""

import json
from types import SimpleNamespace

import changed_pictures
import cv2
import numpy as np
import pandas as pd
import pytest
from changed_pictures import BY_NAME, CHANGES
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.runtime import Step
from pipeline.tables import Centrelines
from pipeline.video import open_video
from synthetic.encode import write_video
from synthetic.scene import Codec

HEIGHT, WIDTH = 90, 121  # px: odd, too
FRAMES = 4
DOT_PX = 3.0  # SD
NEAR_PX, NEAR_LOSSY_PX = 0.1, 0.6  # lossy: in noise, and as H.264 leaves the dot
MARGIN = 20  # px, within which no dot is: turned, it might leave the picture
GROUND, DOT = 60.0, 150.0  # grey levels

names = pytest.mark.parametrize("name", BY_NAME)
dots = st.tuples(st.floats(MARGIN, WIDTH - MARGIN), st.floats(MARGIN, HEIGHT - MARGIN))


def with_dot(x, y):
    """A frame with a bright dot at a place."""
    rows, columns = np.mgrid[:HEIGHT, :WIDTH]
    away = (columns - x) ** 2 + (rows - y) ** 2
    return changed_pictures.grey(GROUND + DOT * np.exp(-away / (2 * DOT_PX**2)))


def dot_in(frame):
    """Where a dot is in a frame: x, y [px]."""
    smooth = cv2.GaussianBlur(frame.astype(float), (0, 0), DOT_PX)
    light = np.maximum(smooth - (smooth.max() + np.median(smooth)) / 2, 0)
    rows, columns = np.mgrid[: frame.shape[0], : frame.shape[1]]
    return np.array([(light * columns).sum(), (light * rows).sum()]) / light.sum()


def lines_of_points(points):
    """`Centrelines` with a line of one point in each frame."""
    n = len(points)
    x, y = np.transpose(points)
    whisker, ones = np.zeros(n, int), np.ones(n)
    return Centrelines(("w",), np.arange(n), whisker, np.arange(n + 1), x, y, ones, ones)


def found_dots(frames, change, seed):
    """Dots of a changed video: their frames and places in the video as it is."""
    pictures = changed_pictures.changed(frames, change, seed)
    lines = lines_of_points([dot_in(frame) for frame in pictures])
    lines = changed_pictures.turned_back(lines, change.moves(WIDTH, HEIGHT), change.every)
    return lines.frame, np.column_stack([lines.x_px, lines.y_px])


@names
@settings(max_examples=5, deadline=None)
@given(places=st.lists(dots, min_size=FRAMES, max_size=FRAMES), seed=st.integers(0, 2**31 - 1))
def test_a_point_is_turned_back_to_where_it_was(name, places, seed):
    frames = np.stack([with_dot(*place) for place in places])
    numbers, found = found_dots(frames, BY_NAME[name], seed)
    assert numbers.tolist() == list(range(0, FRAMES, BY_NAME[name].every))
    away = np.hypot(*(found - np.array(places)[numbers]).T)
    lossy = name.startswith(("noise", "H.264"))
    assert away.max() < (NEAR_LOSSY_PX if lossy else NEAR_PX)


@names
def test_every_change_but_the_first_changes_the_video(name):
    frames = np.stack([with_dot(40 + 3 * k, 35) for k in range(FRAMES)])
    same = np.array_equal(changed_pictures.changed(frames, BY_NAME[name], 0), frames)
    assert same == (name == CHANGES[0].name)


@names
@pytest.mark.parametrize("face", changed_pictures.TOWARDS)
def test_the_face_is_on_the_side_that_is_said(name, face):
    frame = np.full((HEIGHT, WIDTH), 200, np.uint8)
    sides_of(frame)[face][:] = 40
    pictures = changed_pictures.changed(np.stack([frame] * 2), BY_NAME[name], 0)
    side = changed_pictures.side_after(face, BY_NAME[name].moves(WIDTH, HEIGHT))
    light = {each: half.mean() for each, half in sides_of(pictures[0]).items()}
    assert min(light, key=light.get) == side


def sides_of(frame):
    """Views of the four halves of a frame."""
    down, along = (size // 2 for size in frame.shape)
    return {
        "left": frame[:, :along],
        "right": frame[:, along:],
        "top": frame[:down],
        "bottom": frame[down:],
    }


@names
def test_the_scale_is_that_of_the_changed_picture(name):
    places = np.array([[30.0, 40.0], [75.0, 50.0]])
    frames = np.stack([with_dot(*place) for place in np.repeat(places, 2, axis=0)])
    pictures = changed_pictures.changed(frames, BY_NAME[name], 0)
    apart = np.hypot(*(dot_in(pictures[-1]) - dot_in(pictures[0])))
    scale = changed_pictures.scale_after(16.0, BY_NAME[name].moves(WIDTH, HEIGHT))
    assert apart / scale == pytest.approx(np.hypot(*(places[1] - places[0])) / 16, rel=0.03)


def test_noise_has_its_sd_and_comes_from_the_seed():
    frames = np.full((2, 200, 200), 128, np.uint8)
    for sd in (4, 8):
        change = BY_NAME[f"noise of SD {sd}"]
        one, again, other = (changed_pictures.changed(frames, change, seed) for seed in (1, 1, 2))
        assert one.std() == pytest.approx(sd, rel=0.03)
        assert np.array_equal(one, again)
        assert np.corrcoef(one.ravel(), other.ravel())[0, 1] < 0.1
        assert np.corrcoef(one[0].ravel(), one[1].ravel())[0, 1] < 0.1


def test_a_seed_is_drawn_unless_it_is_given():
    drawn = {changed_pictures.arguments(["a.mp4:top"]).seed for _ in range(3)}
    assert len(drawn) > 1
    assert changed_pictures.arguments(["a.mp4:top", "--seed", "0"]).seed == 0


def follow_bright_row(video, settings, keep, progress):
    """What `analyse` would find: the bright row or column of every frame, a known line."""
    assert settings.recording.pixels_per_mm == 12
    with open_video(video) as source:
        frames = list(source.frames())
    follow_bright_row.given.append((settings.recording.face, settings.recording.frames_per_second))
    points = [np.argwhere(frame > 128)[:, ::-1] for frame in frames]
    x, y = np.concatenate(points).T.astype(np.float32)
    n, sizes = len(frames), [len(each) for each in points]
    offsets = np.append(0, np.cumsum(sizes))
    progress(Step("following", 1, n))
    progress(Step("forces"))
    keep(
        Centrelines(("w",), np.arange(n), np.zeros(n, int), offsets, x, y, 0 * x, np.full(n, 0.9))
    )
    return SimpleNamespace(frames=pd.DataFrame(), n_frames=n)


def test_the_table(tmp_path, monkeypatch, capsys):
    frames = np.zeros((FRAMES, 64, 128), np.uint8)
    for k, frame in enumerate(frames):
        frame[10 + k] = 255  # the whisker moves down
    write_video(tmp_path / "a.avi", iter(frames), Codec("ffv1"))
    entries = [
        {"video": "a", "frame": k, "whiskers": [{"kind": "clear", "xy": [[0, y], [127, y]]}]}
        for k, y in ((2, 12), (3, 40))  # in frame 3, something that is not found
    ]
    (tmp_path / "labels.json").write_text(json.dumps(entries), "utf-8")
    page = tmp_path / "page.md"
    page.write_text("<!-- changed pictures: begin --><!-- changed pictures: end -->", "utf-8")
    follow_bright_row.given = []
    monkeypatch.setattr(changed_pictures.real_recordings, "analyse", follow_bright_row)
    monkeypatch.setattr(changed_pictures.measuring, "limit_threads", lambda: None)
    argv = [f"{tmp_path / 'a.avi'}:top", "--labels", str(tmp_path / "labels.json")]
    argv += ["--scale", "12", "--seed", "7", "--frames-per-second", "500", "--write", str(page)]
    argv += ["--only", "upside down", "every second frame"]
    assert changed_pictures.main(argv) == 0
    assert follow_bright_row.given == [("bottom", 500.0), ("top", 250.0)]
    said = capsys.readouterr().out
    assert "seed 7" in said
    assert said.strip() in page.read_text("utf-8")
    table = [[c.strip() for c in line.split("|")[1:-1]] for line in said.splitlines()]
    table = [row for row in table if row]
    upside_down, second = (dict(zip(table[0], row, strict=True)) for row in table[2:])
    same = {"video": "a", "faint": "–", "distance": "0.00", "lines / frame": "1.0"}
    same |= {"known": "100%"}
    missed = {"change": "upside down", "clear": "1 of 2 (50%)", "wrong / frame": "0.50"}
    assert upside_down == same | missed
    even = {"change": "every second frame", "clear": "1 of 1 (100%)", "wrong / frame": "0.00"}
    assert second == same | even
