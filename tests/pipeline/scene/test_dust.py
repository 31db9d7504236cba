import numpy as np
import pytest
from still_scene import scene_from_frames

import pipeline.run
from pipeline.kinematics.stations import Stations, lies_across
from pipeline.scene.dust import is_passed_over
from pipeline.session.recording import Recording
from pipeline.session.session_file import settings_from
from pipeline.video.base import RandomAccessVideo

pytestmark = pytest.mark.slow

SHAPE, LIGHT, NOISE_SD = (240, 320), 180.0, 2.0  # px, grey
FACE_PX, BASE = 40.0, (40.0, 120.0)
NEAR = 0.5  # px
DUST = (160.0, 126.0, 6.25)  # x, y, radius [px]
POLE = (150.0, 60.0, 6.25)


def discs(*places):
    """Light with a face on the left and opaque discs, float64 (height, width)."""
    rows, columns = np.mgrid[: SHAPE[0], : SHAPE[1]]
    light = np.where(columns < FACE_PX, 8.0, LIGHT)
    for x, y, radius in places:
        light *= 1 - 0.95 / (1 + np.exp(2.5 * (np.hypot(columns - x, rows - y) - radius)))
    return light


def with_rod(light, place, direction):
    """The same with a blurred rod behind a disc."""
    rows, columns = np.mgrid[: SHAPE[0], : SHAPE[1]]
    along = (columns - place[0]) * np.cos(direction) + (rows - place[1]) * np.sin(direction)
    across = (rows - place[1]) * np.cos(direction) - (columns - place[0]) * np.sin(direction)
    return light * (1 - 0.9 * (along > 0) / (1 + np.exp(np.abs(across) - place[2])))


def frames(light, angles, opacity=0.6, seed=0):
    """Frames of a straight whisker that turns about BASE, uint8 (k, height, width)."""
    rng = np.random.default_rng(seed)
    rows, columns = np.mgrid[: SHAPE[0], : SHAPE[1]]
    out = []
    for angle in angles:
        off = (rows - BASE[1]) * np.cos(angle) - (columns - BASE[0]) * np.sin(angle)
        seen = np.clip(1.2 - np.hypot(columns - BASE[0], rows - BASE[1]) / 230, 0, 1)
        image = light * (1 - opacity * seen * np.exp(-0.5 * off**2))
        out.append(np.clip(np.rint(image + NOISE_SD * rng.normal(size=SHAPE)), 0, 255))
    return np.array(out, np.uint8)


@pytest.mark.parametrize("opacity", [0.15, 0.6])
def test_a_whisker_across_the_disc_is_distinguished_from_one_beside(opacity):
    light = discs(DUST)
    noise = (NOISE_SD**2, 0.0)
    through = np.arctan2(DUST[1] - BASE[1], DUST[0] - BASE[0])
    beside = through + (DUST[2] + 1.5) / np.hypot(DUST[0] - BASE[0], DUST[1] - BASE[1])
    for angle, passes in ((through, True), (beside, False)):
        video = frames(light, np.full(4, angle), opacity)
        assert is_passed_over(*DUST, light.astype(np.float32), noise, video) == passes


def test_the_pole_is_not_the_round_speck_that_whiskers_pass_over():
    light = with_rod(discs(DUST, POLE), POLE, -1.2)
    recording = Recording(1000.0, 25.0, "left")
    sweep = 0.25 * np.sin(0.7 * np.arange(32)) + 0.05  # rad; stays off the pole
    scene = scene_from_frames(frames(light, sweep), recording, 0.5e-3)
    assert np.hypot(scene.pole.x_px[0] - POLE[0], scene.pole.y_px[0] - POLE[1]) < NEAR
    away = 0.05 * np.sin(0.7 * np.arange(32)) + 0.5  # rad; the speck alone is never passed over
    scene = scene_from_frames(frames(discs(DUST), away), recording, 0.5e-3)
    assert np.hypot(scene.pole.x_px[0] - DUST[0], scene.pole.y_px[0] - DUST[1]) < NEAR


def test_lies_across_wants_the_middle_and_both_sides():
    radius = 0.25e-3
    distance = np.array([-0.2e-3, -0.05e-3, 0.1e-3, -0.2e-3, -0.2e-3, np.nan])
    n = len(distance)
    rest = {name: np.zeros(n) for name in ("frame", "whisker", "x", "y", "information", "origin")}
    rest |= {name: np.zeros(n) for name in ("pole_x", "pole_y", "side", "interpolated", "end_px")}
    places = Stations(
        names=("C2",),
        spacing=np.ones(1),
        first=np.full(n, 1e-3),
        last=np.array([9e-3, 9e-3, 9e-3, 6.1e-3, 9e-3, 9e-3]),
        nearest=np.full(n, 6e-3),
        distance=distance,
        extended=np.array([False, False, False, False, True, False]),
        pole_radius=radius,
        pixel=40e-6,
        **rest,
    )
    assert lies_across(places).tolist() == [True, False, False, False, False, False]


class Passing(RandomAccessVideo):
    """A speck that a whisker quickly passes over, twice."""

    def __init__(self):
        self.angles = np.full(300, 0.45) + 0.01 * np.sin(0.05 * np.arange(300))  # rad
        for start in (97, 203):
            self.angles[start : start + 16] -= 0.35 * (1 - np.cos(np.linspace(0, 2 * np.pi, 16)))
        super().__init__("made up", *SHAPE[::-1], len(self.angles))

    def _load(self, index):
        return frames(discs(DUST), self.angles[index : index + 1], seed=index)[0]


def test_a_speck_taken_for_the_pole_is_reported_and_not_touched(monkeypatch):
    monkeypatch.setattr(pipeline.run, "open_video", lambda *_: Passing())
    recording = {"frames_per_second": 1000.0, "pixels_per_mm": 25.0, "face": "left"}
    whisker = {"name": "C2", "length_mm": 10.5, "cone_length_mm": 12.0, "base_radius_um": 30.0}
    settings = settings_from({"recording": recording, "whisker": [whisker]})
    analysis = pipeline.run.analyse("made up", settings)
    assert len(analysis.contacts) == 0
    (message,) = analysis.messages
    assert "C2 passes over the pole at (160, 126) px in 4 frames" in message
