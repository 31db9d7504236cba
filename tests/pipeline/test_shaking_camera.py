"""A shaking camera: what is found is what one at rest shows, moved by the shake."""

import cv2
import numpy as np
import pytest
from rendered_frames import rendered_frames

import pipeline.run
from pipeline.run import analyse
from pipeline.scene.shake import Still, still_of
from pipeline.session.session_file import settings_from
from pipeline.tables.centrelines import Centrelines
from pipeline.video.arrays import ArrayVideo
from pipeline.video.base import RandomAccessVideo

N_FRAMES = 40
NOISE = 1.5  # grey levels
SHIFT_PX = 0.1  # error of a frame's shift
SAME_PX = 0.2  # between lines and follicles
POLE_PX = 0.3
BEYOND_FUR = slice(10, 100)  # nodes of a line
SHAKES = np.random.default_rng(7).uniform(-4, 4, (N_FRAMES, 2))


def moved(image, shift):
    move = np.float32([[1, 0, shift[0]], [0, 1, shift[1]]])
    return cv2.warpAffine(image, move, image.shape[::-1], borderMode=cv2.BORDER_REFLECT)


class Rendered(RandomAccessVideo):
    """A rendered whisker before a shaking camera, or one at rest."""

    def __init__(self, shakes=None):
        self._images, self._shakes = rendered_frames("single", N_FRAMES), shakes
        super().__init__("rendered", *self._images.shape[:0:-1], N_FRAMES)

    def _load(self, index):
        frame = self._images[index].copy()
        return frame if self._shakes is None else moved(frame, self._shakes[index])


def traced(monkeypatch, video):
    """Centrelines and analysis of a video."""
    recording = {"frames_per_second": 1000.0, "pixels_per_mm": 25.0, "face": "left"}
    monkeypatch.setattr(pipeline.run, "open_video", lambda *_: video)
    return analyse(
        "rendered", settings_from({"recording": recording, "whisker": [{"name": "C2"}]})
    )


def fine(row):
    """The same line with ten points for one."""
    at = np.linspace(0, len(row) - 1, 10 * len(row))
    return np.column_stack([np.interp(at, np.arange(len(row)), each) for each in row.T])


def rows(analysis) -> dict[int, np.ndarray]:
    (lines,) = analysis.lines
    return {int(frame): lines.row(i) for i, frame in enumerate(lines.frame)}


@pytest.mark.e2e
def test_whiskers_and_pole_are_where_the_shaken_frames_show_them(monkeypatch):
    still, shaken = (traced(monkeypatch, Rendered(shakes)) for shakes in (None, SHAKES))
    expected = {k: row + SHAKES[k] for k, row in rows(still).items()}
    assert rows(shaken).keys() == expected.keys()
    for k, row in rows(shaken).items():
        apart = row[BEYOND_FUR, None] - fine(expected[k])
        assert np.hypot(*apart.T).min(axis=0).max() < SAME_PX
    place, places = (np.column_stack([a.pole.x_px, a.pole.y_px]) for a in (still, shaken))
    assert np.abs(places - place[-1] - SHAKES).max() < POLE_PX
    follicle = ["follicle_x_px", "follicle_y_px"]
    away = shaken.frames[follicle].to_numpy() - still.frames[follicle].to_numpy() - SHAKES
    away -= np.median(away, axis=0)  # how far the follicle is in the face
    assert np.median(np.hypot(*away.T)) < SAME_PX


def streaks(rng):
    """A picture with long streaks, as of grained wood."""
    streaks = cv2.GaussianBlur(rng.normal(size=(300, 400)), (0, 0), sigmaX=12, sigmaY=1.2)
    return 150 + 15 * streaks / streaks.std()


def noisy(picture, rng):
    return np.clip(np.rint(picture + rng.normal(0, NOISE, picture.shape)), 0, 255).astype(np.uint8)


def test_a_frames_shift_is_found_in_other_light_and_where_some_of_it_moves():
    rng = np.random.default_rng(3)
    picture = streaks(rng)
    still = Still(noisy(picture, rng))
    for shift in SHAKES[:6]:
        frame = 0.9 * moved(picture, shift)
        frame[100:180, 100:180] = streaks(rng)[100:180, 100:180]
        found, misfit = still.shift(noisy(frame, rng))
        assert np.abs(found - shift).max() < SHIFT_PX
        assert misfit < 1


@pytest.mark.parametrize("amplitude", [0.0, 0.2])
def test_a_camera_at_rest_is_left_alone(amplitude):
    rng = np.random.default_rng(5)
    picture = streaks(rng)
    video = ArrayVideo(np.stack([noisy(moved(picture, amplitude * s / 4), rng) for s in SHAKES]))
    assert still_of(video.sample(16)[1]) is None


def test_lines_are_moved_with_their_frames():
    point = np.arange(5, dtype=np.float32)
    lines = Centrelines(
        ("a",), np.array([0, 2]), np.zeros(2, int), np.array([0, 3, 5]), point, 2 * point,
        np.ones(5, np.float32), np.ones(2, np.float32),
    )  # fmt: skip
    there = lines.moved([(1.0, -1.0), (9.0, 9.0), (0.5, 0.25)])
    assert there.x_px.tolist() == [1, 2, 3, 3.5, 4.5]
    assert there.y_px.tolist() == [-1, 1, 3, 6.25, 8.25]
