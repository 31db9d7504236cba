import cv2
import numpy as np
import pytest

from pipeline.errors import VideoError
from pipeline.scene.estimate import find_scenes
from pipeline.scene.states import Cells, Survey
from pipeline.session.parameters import DEFAULTS
from pipeline.session.recording import Recording
from pipeline.video.base import RandomAccessVideo

SCALE = 20.0  # px/mm
HEIGHT, WIDTH = 160, 240
RECORDING = Recording(frames_per_second=1000.0, pixels_per_mm=SCALE, face="right")
POLE = (80.4, 60.7)
RADIUS = 0.25 * SCALE

# tolerances
CENTRE = 0.05  # px
RADIUS_ERROR = 0.1  # px
CUT = 1  # frames


def soft(mask, blur):
    return cv2.GaussianBlur(mask.astype(np.float32), (0, 0), blur)


def light(pole=None, whisker=None, paw=None):
    """Light of one frame: a face on the right; pole on a rod from the left, whisker, paw."""
    rows, columns = np.mgrid[:HEIGHT, :WIDTH].astype(np.float32)
    image = 180 - 0.1 * np.abs(rows - 80) - 0.1 * np.abs(columns - 100)
    image *= 1 / (1 + np.exp((columns - 200) / 1.2))
    if pole is not None:
        x, y = pole
        rod = np.abs(rows - y - 0.3 * (columns - x)) < RADIUS
        image *= 1 - soft(rod & (columns < x - 0.5 * RADIUS), 1.5)
        image *= 1 / (1 + np.exp((RADIUS - np.hypot(columns - x, rows - y)) / 0.45))
    if whisker is not None:
        line = np.zeros_like(image)
        tip = int(16 * (200 - 150 * np.cos(whisker))), int(16 * (110 - 150 * np.sin(whisker)))
        cv2.line(line, (16 * 200, 16 * 110), tip, 0.7, 2, cv2.LINE_AA, 4)
        image *= 1 - soft(line, 0.6)
    if paw is not None:
        image *= 1 - soft(np.hypot(columns - paw, rows - HEIGHT) < 25, 3.0)
    return image + 6


class MadeUp(RandomAccessVideo):
    """A video of `n` frames: `picture(i)` gives frame i."""

    def __init__(self, n, picture, noise=1.5):
        super().__init__("made up", WIDTH, HEIGHT, n)
        self._picture, self._noise = picture, noise
        self.reads = 0

    def _load(self, index):
        self.reads += 1
        image = light(**self._picture(index))
        noise = np.random.default_rng(index).normal(0, self._noise, image.shape)
        return np.clip(image + noise + 0.5, 0, 255).astype(np.uint8)


def swing(i):
    return 0.35 * np.sin(i / 6)


def the_scene(*arguments, **options):
    """Scene of a video in which nothing large moves."""
    (epoch,) = find_scenes(*arguments, **options)
    return epoch.scene


def comes_and_goes(i):
    """Pole in its place from frame 130 on, until 270; in view, but moving, 8 frames around it."""
    back = 10.0 * max(130 - i, i - 269, 0)
    away = back > 85
    pole = None if away else (POLE[0] - back, POLE[1] - 0.3 * back)
    return {"pole": pole, "whisker": swing(i)}


class TestOneScene:
    def test_everything_is_found(self):
        video = MadeUp(200, lambda i: {"pole": POLE, "whisker": swing(i)})
        scene = the_scene(video, RECORDING)
        assert np.hypot(scene.pole.x_px[0] - POLE[0], scene.pole.y_px[0] - POLE[1]) < CENTRE
        assert abs(scene.pole.radius_px - RADIUS) < RADIUS_ERROR
        assert len(scene.pole.x_px) == 200
        assert scene.face_mask[:, 205:].all()
        assert not scene.face_mask[:, :195].any()
        rows, columns = np.ogrid[:HEIGHT, :WIDTH]
        assert scene.obstacle_mask[np.hypot(columns - POLE[0], rows - POLE[1]) < RADIUS].all()
        assert scene.obstacle_mask[:, 5].any()  # the rod, up to the border
        assert not (scene.obstacle_mask & scene.face_mask).any()
        assert not scene.obstacle_mask[90:, 20:].any()  # where the whisker swings
        error = scene.background - light(pole=POLE)
        assert np.median(np.abs(error)) < 0.5
        assert np.sqrt(scene.noise_floor + scene.noise_gain * 150) == pytest.approx(1.5, rel=0.1)

    def test_side_of_the_face_is_found(self):
        video = MadeUp(60, lambda i: {"pole": POLE, "whisker": swing(i)})
        assert the_scene(video, Recording(1000.0, SCALE, None)).face_side == "right"

    def test_single_frame(self):
        scene = the_scene(MadeUp(1, lambda i: {"pole": POLE, "whisker": 0.2}), RECORDING)
        assert np.hypot(scene.pole.x_px[0] - POLE[0], scene.pole.y_px[0] - POLE[1]) < 2 * CENTRE
        error = np.abs(scene.background - light(pole=POLE))[:, 20:195]
        assert np.quantile(error, 0.99) < 6

    def test_black_frames_before_the_lamp_is_on_are_no_scene(self):
        video = MadeUp(60, lambda i: {"whisker": swing(i)})
        lit = video._load
        video._load = lambda i: lit(i) if i >= 10 else np.zeros((HEIGHT, WIDTH), np.uint8)
        assert the_scene(video, RECORDING).background.max() > 100

    def test_a_video_that_is_black_throughout(self):
        video = MadeUp(60, lambda i: {})
        video._load = lambda i: np.zeros((HEIGHT, WIDTH), np.uint8)
        assert not the_scene(video, RECORDING).obstacle_mask.any()

    def test_no_pole_no_whisker(self):
        scene = the_scene(MadeUp(50, lambda i: {}), RECORDING)
        assert scene.pole is None
        assert not scene.obstacle_mask.any()

    def test_pole_is_not_looked_for(self):
        video = MadeUp(50, lambda i: {"pole": POLE})
        assert the_scene(video, RECORDING, pole_diameter_m=None).pole is None

    def test_a_pole_outside_of_the_picture_is_reported(self):
        with pytest.raises(
            VideoError, match=r"= 9999, 50 in session.toml is outside .* y_px from 0 to"
        ):
            find_scenes(MadeUp(40, lambda i: {}), RECORDING, pole_xy=(9999, 50))

    def test_a_camera_that_shakes_does_not_cut_the_video(self):
        class Shaking(MadeUp):
            def _load(self, index):
                return np.roll(super()._load(index), int(6 * np.sin(index**2)), axis=1)

        (epoch,) = find_scenes(Shaking(200, lambda i: {"whisker": swing(i)}), RECORDING)
        assert (epoch.start, epoch.stop) == (0, None)


class TestEpochs:
    def test_pole_that_comes_and_goes(self):
        video = MadeUp(400, comes_and_goes)
        epochs = find_scenes(video, RECORDING)
        assert [epoch.scene is None for epoch in epochs] == [False, True, False, True, False]
        cuts = [epoch.start for epoch in epochs]
        assert cuts[0] == 0
        assert np.abs(np.array(cuts[1:]) - [122, 130, 270, 278]).max() <= CUT
        assert [epoch.stop for epoch in epochs] == [*cuts[1:], None]
        before, during, after = (epoch.scene for epoch in epochs if epoch.scene)
        assert before is after
        assert before.pole is None
        assert np.hypot(during.pole.x_px[0] - POLE[0], during.pole.y_px[0] - POLE[1]) < CENTRE
        assert np.median(np.abs(before.background - light())) < 0.5
        assert np.median(np.abs(during.background - light(pole=POLE))) < 0.5
        assert video.reads < 120  # the samples, and the frames between two of them at each cut

    def test_a_paw_that_passes_by_makes_no_cut_and_leaves_no_trace(self):
        def picture(i):
            paw = 100 + i - 150 if 150 <= i < 165 else None
            return {"pole": POLE, "whisker": swing(i), "paw": paw}

        (epoch,) = find_scenes(MadeUp(300, picture), RECORDING)
        # at the follicle, the whisker covers the same pixels at all angles
        assert np.abs(epoch.scene.background - light(pole=POLE))[:, 20:170].max() < 5

    def test_two_places_of_a_pole(self):
        other = (120.2, 40.9)
        video = MadeUp(300, lambda i: {"pole": POLE if i < 140 else other, "whisker": swing(i)})
        first, second = find_scenes(video, RECORDING)
        assert abs(first.stop - 140) <= CUT
        assert np.hypot(second.scene.pole.x_px[0] - other[0], second.scene.pole.y_px[0] - 40.9) < (
            CENTRE
        )


def survey(frames):
    """States of frames and the frames kept of each."""
    taken = Survey((HEIGHT, WIDTH), SCALE, DEFAULTS.scene)
    for i, frame in enumerate(frames):
        taken.add(10 * i, np.clip(frame, 0, 255).astype(np.uint8))
    return taken.settled()


class TestSurvey:
    def test_whiskers_and_flicker_are_no_change(self):
        frames = [light(pole=POLE, whisker=swing(i)) * (1 + 0.1 * np.sin(i)) for i in range(20)]
        states, kept = survey(frames)
        assert set(states) == {0}
        assert [len(some) for some in kept] == [20]

    def test_few_frames_are_states_of_their_own(self):
        states, kept = survey([light(), light(pole=POLE)])
        assert list(states) == [0, 0] or len(kept) == 2

    def test_what_passes_by_is_no_state(self):
        paws = [None] * 6 + [80, 140] + [None] * 6
        states, kept = survey([light(paw=paw) for paw in paws])
        assert list(states) == [0] * 6 + [-1, -1] + [0] * 6
        assert [len(some) for some in kept] == [12]

    def test_what_is_about_to_come_to_rest_begins_no_state(self):
        def covered(share):
            frame = light()
            frame[60:100, 120:160] *= 1 - share
            return frame

        # 0.62 differs by less than CHANGE from 0.9, and by more from 0.94
        shares = [0.0] * 6 + [0.62] + [0.9, 0.94] * 6
        states, kept = survey([covered(share) for share in shares])
        assert list(states) == [0] * 6 + [1] * 13
        assert [len(some) for some in kept] == [6, 13]

    def test_a_whisker_beside_what_came_to_rest_begins_no_state(self):
        """It did, in every touch, where the first frame showed the pole still arriving."""

        def covered(share, shade=0.0):
            frame = light()
            frame[60:100, 120:160] *= 1 - share
            frame[110:150, 20:160] *= 1 - shade
            return frame

        later = [covered(0.9), covered(0.94, 0.2)] * 6
        states, kept = survey([covered(0.0)] * 6 + [covered(0.62)] + later)
        assert list(states) == [0] * 6 + [1] * 13
        assert [len(some) for some in kept] == [6, 13]

    def test_a_pole_that_is_still_arriving_is_left_out(self):
        near = POLE[0], POLE[1] - 0.3 * SCALE  # 0.3 mm: the cells do not resolve it
        poles = [None] * 6 + [near] * 2 + [POLE] * 6
        states, kept = survey([light(pole=pole) for pole in poles])
        assert list(states) == [0] * 6 + [-1] * 2 + [1] * 6
        assert [len(some) for some in kept] == [6, 6]

    def test_what_never_rests_is_one_state(self):
        states, kept = survey([light(paw=paw) for paw in range(0, 240, 8)])
        assert set(states) == {0}
        assert len(kept) == 1

    def test_kept_frames_are_few_and_evenly_spread(self):
        """However long the video: memory must not grow with it."""
        counts = []
        for n in (120, 480):
            _, (kept,) = survey([light(paw=100) + 12 * i / n for i in range(n)])
            level = kept[:, 80, 100].astype(float)
            assert np.ptp(level) > 0.9 * 12
            assert np.abs(np.diff(level, 2)).max() <= 1
            counts.append(len(kept))
        assert min(counts) > 15
        assert max(counts) < 60

    def test_sample_is_in_order_and_shows_every_state(self):
        taken = Survey((HEIGHT, WIDTH), SCALE, DEFAULTS.scene)
        pictures = [light(pole=POLE if i % 3 else None) for i in range(30)]
        for i, picture in enumerate(pictures):
            taken.add(7 * i, np.clip(picture, 0, 255).astype(np.uint8))
        indices, frames = taken.sample(10)
        assert len(indices) == 10
        assert np.all(np.diff(indices) > 0)
        assert {i % 3 == 0 for i in indices // 7} == {True, False}
        for index, frame in zip(indices, frames, strict=True):
            assert np.abs(frame - pictures[index // 7]).max() < 1
        assert len(taken.sample(100)[0]) == 30

    def test_cells_follow_the_scale(self):
        assert Cells((480, 640), 25.0, DEFAULTS.scene).size == (128, 96)
        assert Cells((480, 640), 50.0, DEFAULTS.scene).size == (64, 48)
