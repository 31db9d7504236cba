import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from pipeline.scene.background import (
    estimate_background,
    sort_over_time,
    thin_dark_lines,
    without_whiskers,
)
from pipeline.scene.illumination import fill, frame_gains, light_without_objects
from pipeline.scene.noise_model import spatial_noise
from pipeline.session.parameters import DEFAULTS

SCALE = 20.0  # px/mm
HEIGHT, WIDTH = 200, 300
FLOOR, GAIN = 1.0, 0.02  # variance of the frames' noise: floor + gain × grey

# tolerances
BACKGROUND = 0.4  # grey levels, median absolute error of 32 frames with noise SD 2
BURNED_IN = 2.0  # grey levels, at a whisker's place; the whisker itself is 80 grey levels deep
NOISE_SD = 0.06  # relative
LIGHT = 0.04  # relative
FLANKS = 0.06  # grey levels, mean error where a whisker passes in half of the frames


def still_scene():
    """Uneven light, a face on the right with hairs, a rod from the left, grey levels."""
    rows, columns = np.mgrid[:HEIGHT, :WIDTH].astype(np.float32)
    light = 180 - 60 * ((columns - 120) / WIDTH) ** 2 - 50 * ((rows - 90) / HEIGHT) ** 2
    clear = 1 / (1 + np.exp((columns - 250 - 4 * np.sin(rows / 15)) / 1.5))
    for row in range(10, HEIGHT, 14):  # fur hairs, 1 mm long
        cv2.line(clear, (228 + row % 7, row + 4), (252, row), 0.3, 1, cv2.LINE_AA)
    rod = np.ones_like(light)
    cv2.line(rod, (0, 30), (70, 60), 0.0, 12)
    clear = clear * cv2.GaussianBlur(rod, (0, 0), 2.5)
    return (6 + light * clear).astype(np.float32), light + 6


def with_whisker(scene, angle, depth=0.5):
    """Multiply a whisker into a scene: from the face on the right, turned by `angle` [rad]."""
    line = np.ones(scene.shape, np.float32)
    x, y = 250, 120
    tip = (int(16 * (x - 180 * np.cos(angle))), int(16 * (y - 180 * np.sin(angle))))
    cv2.line(line, (16 * x, 16 * y), tip, 1 - depth, 2, cv2.LINE_AA, 4)
    return scene * cv2.GaussianBlur(line, (0, 0), 0.7)


def expose(image, rng, floor=FLOOR, gain=GAIN):
    noisy = image + rng.normal(size=image.shape) * np.sqrt(floor + gain * image)
    return np.clip(np.rint(noisy), 0, 255).astype(np.uint8)


def movie(angles, flicker=0.0, seed=0, **noise):
    rng = np.random.default_rng(seed)
    scene, _ = still_scene()
    return np.stack(
        [
            expose((1 + flicker * rng.normal()) * with_whisker(scene, angle), rng, **noise)
            for angle in angles
        ]
    )


def face_of(scene):
    return np.broadcast_to(np.arange(WIDTH) > 252, scene.shape)


def place_of_whisker(angle):
    return with_whisker(np.ones((HEIGHT, WIDTH), np.float32), angle) < 0.9


class TestOverTime:
    def test_moving_whisker_leaves_no_trace(self):
        scene, _ = still_scene()
        angles = 0.3 * np.sin(np.arange(32) * 0.7)
        background = estimate_background(movie(angles), SCALE, DEFAULTS.scene)
        error = background.image - scene
        assert np.median(np.abs(error)) < BACKGROUND
        assert abs(np.mean(error)) < 0.1
        for angle in angles:
            assert abs(error[place_of_whisker(angle) & (scene > 60)].mean()) < BURNED_IN

    def test_flanks_of_a_whisker_that_passes_leave_no_shade(self):
        scene, _ = still_scene()
        angles = 0.06 * np.sin(np.arange(32) * 0.7)
        background = estimate_background(movie(angles), SCALE, DEFAULTS.scene)
        places = [place_of_whisker(angle).astype(np.uint8) for angle in angles]
        passed = np.mean([cv2.dilate(place, np.ones((5, 5))) for place in places], axis=0)
        often = (passed > 0.4) & (passed < 0.85)
        often[:, 225:] = False  # fur
        assert often.sum() > 800
        assert abs((background.image - scene)[often].mean()) < FLANKS

    @pytest.mark.parametrize("turn", [0.02, 0.03])
    def test_whisker_that_moves_by_little_leaves_no_shade(self, turn):
        scene, _ = still_scene()
        angles = 0.1 + turn * np.sin(np.arange(32) * 0.7)
        background = estimate_background(movie(angles), SCALE, DEFAULTS.scene)
        places = np.any([place_of_whisker(angle) for angle in angles], axis=0)
        places[:, 150:] = False  # there it moves by less than its width
        error = cv2.blur(background.image - scene, (3, 3))[places]
        assert np.sqrt(np.mean(error**2)) < BURNED_IN / 2

    def test_rim_of_a_dark_thing_stays_dark_where_a_codec_errs(self):
        rows, columns = np.mgrid[:HEIGHT, :WIDTH]
        away = np.hypot(columns - 150, rows - 100)
        disc = 8 + 190 / (1 + np.exp((6 - away) / 0.6))
        rng, error = np.random.default_rng(0), np.where(np.abs(away - 6) < 1.6, 8, 1)  # SD, grey
        frames = [
            expose(disc + error * rng.normal(size=disc.shape), rng, gain=0) for _ in range(40)
        ]
        background = estimate_background(np.array(frames), SCALE, DEFAULTS.scene)
        assert np.abs(background.image - disc)[disc < 80].max() < 90  # grey, of 190

    @pytest.mark.parametrize("share", [0.5, 0.8])
    def test_whisker_that_rests_most_of_the_time(self, share):
        scene, _ = still_scene()
        resting = int(32 * share)
        angles = np.r_[np.full(resting, 0.1), np.linspace(-0.3, -0.05, 32 - resting)]
        background = estimate_background(movie(angles), SCALE, DEFAULTS.scene)
        # near the follicle, it covers the same pixels at all angles
        at_rest = place_of_whisker(0.1) & (scene > 60) & (np.arange(WIDTH) < 190)
        assert abs((background.image - scene)[at_rest].mean()) < BURNED_IN

    def test_hairs_and_edges_stay(self):
        scene, _ = still_scene()
        background = estimate_background(
            movie(0.3 * np.sin(np.arange(32.0))), SCALE, DEFAULTS.scene
        )
        near_face = np.s_[:100, 220:256]
        assert np.abs(background.image - scene)[near_face].max() < 8 * BACKGROUND

    def test_flicker_is_taken_out(self):
        scene, _ = still_scene()
        frames = movie(0.3 * np.sin(np.arange(32.0)), flicker=0.05)
        background = estimate_background(frames, SCALE, DEFAULTS.scene)
        ratio = np.median(background.image[scene > 60] / scene[scene > 60])
        error = background.image - ratio * scene
        assert ratio == pytest.approx(1, abs=0.03)
        assert np.median(np.abs(error)) < BACKGROUND
        assert noise_sd(background, 150) == pytest.approx(true_sd(150), rel=3 * NOISE_SD)

    def test_gains_of_flicker(self):
        scene, _ = still_scene()
        rng = np.random.default_rng(1)
        gains = np.array([0.9, 1.0, 1.0, 1.05, 1.1])
        frames = np.stack([expose(g * with_whisker(scene, g - 1), rng) for g in gains])
        assert frame_gains(frames) == pytest.approx(gains, abs=0.01)

    @pytest.mark.parametrize(("floor", "gain"), [(1.0, 0.02), (4.0, 0.0), (0.3, 0.05)])
    def test_noise_model(self, floor, gain):
        frames = movie(0.3 * np.sin(np.arange(32.0)), floor=floor, gain=gain)
        background = estimate_background(frames, SCALE, DEFAULTS.scene)
        for grey in (10, 80, 180):
            true = np.sqrt(floor + gain * grey + 1 / 12)  # with rounding to grey levels
            tolerance = NOISE_SD if grey > 50 else 3 * NOISE_SD  # little is that dark
            assert noise_sd(background, grey) == pytest.approx(true, rel=tolerance)

    @settings(deadline=None, max_examples=40)
    @given(hnp.arrays(np.uint8, st.tuples(st.integers(1, 40), st.integers(1, 40), st.just(3))))
    def test_sorting_network_sorts(self, frames):
        assert np.array_equal(sort_over_time(frames.copy()), np.sort(frames, axis=0))


def noise_sd(background, grey):
    return np.sqrt(background.noise_floor + background.noise_gain * grey)


def true_sd(grey):
    return np.sqrt(FLOOR + GAIN * grey + 1 / 12)


class TestOneFrame:
    def test_whisker_is_removed_and_all_else_stays(self):
        scene, _ = still_scene()
        background = estimate_background(movie([0.1]), SCALE, DEFAULTS.scene)
        image = without_whiskers(background, face_of(scene), SCALE, DEFAULTS.scene)
        whisker = place_of_whisker(0.1) & (scene > 80) & (np.arange(WIDTH) < 215)
        assert abs((image - scene)[whisker].mean()) < BURNED_IN
        assert np.abs(image - scene)[whisker].max() < 5 * BURNED_IN
        other = cv2.dilate(whisker.astype(np.uint8), np.ones((9, 9))) == 0
        assert np.median(np.abs(image - scene)[other]) < BACKGROUND
        rod = scene[:, :80] < 40
        assert np.abs(image - scene)[:, :80][rod].mean() < 2

    def test_noise_from_one_frame(self):
        background = estimate_background(movie([0.1]), SCALE, DEFAULTS.scene)
        assert noise_sd(background, 150) == pytest.approx(true_sd(150), rel=2 * NOISE_SD)

    def test_noise_of_pure_noise(self):
        rng = np.random.default_rng(0)
        image = (100 + rng.normal(0, 3, (200, 200))).astype(np.float32)
        floor, gain = spatial_noise(image)
        assert np.sqrt(floor + 100 * gain) == pytest.approx(3, rel=NOISE_SD)

    def test_video_in_which_nothing_ever_moves(self):
        scene, _ = still_scene()
        background = estimate_background(movie([0.1] * 12), SCALE, DEFAULTS.scene)
        image = without_whiskers(background, face_of(scene), SCALE, DEFAULTS.scene)
        whisker = place_of_whisker(0.1) & (scene > 80) & (np.arange(WIDTH) < 215)
        assert abs((image - scene)[whisker].mean()) < BURNED_IN

    @pytest.mark.parametrize("n_frames", [1, 3, 12])
    def test_the_base_of_a_still_whisker_is_removed_and_the_fur_about_it_stays(self, n_frames):
        scene, _ = still_scene()
        background = estimate_background(movie([0.1] * n_frames), SCALE, DEFAULTS.scene)
        image = without_whiskers(background, face_of(scene), SCALE, DEFAULTS.scene)
        columns, whisker = np.arange(WIDTH), place_of_whisker(0.1)
        base = whisker & (columns > 225) & (columns < 240)
        assert abs((image - scene)[base].mean()) < 3 * BURNED_IN
        assert (background.image - scene)[base].mean() < -10 * BURNED_IN
        fur = (
            (columns > 225)
            & (columns < 240)
            & ~cv2.dilate(whisker.astype(np.uint8), np.ones((25, 25))).astype(bool)
        )
        assert np.abs(image - scene)[fur].mean() < BURNED_IN

    def test_a_whisker_that_rests_on_a_pole_is_removed_beyond_it_too(self):
        clean, _ = still_scene()
        whisker = place_of_whisker(0.1)
        rows, columns = np.mgrid[:HEIGHT, :WIDTH]
        lowest = rows[whisker & (columns == 160)].max()
        pole = np.hypot(columns - 160, rows - lowest - 5) <= 7  # px; it hides some
        clean[pole] = 6
        rng = np.random.default_rng(0)
        frames = np.stack([expose(with_whisker(clean, 0.1), rng) for _ in range(12)])
        background = estimate_background(frames, SCALE, DEFAULTS.scene)
        beyond = whisker & (columns > 90) & (columns < 140)
        image = without_whiskers(background, face_of(clean), SCALE, DEFAULTS.scene, True, pole)
        assert abs((clean - image)[beyond].mean()) < BURNED_IN
        # a line of its own
        image = without_whiskers(background, face_of(clean), SCALE, DEFAULTS.scene)
        assert (clean - image)[beyond].mean() > 10 * BURNED_IN

    def test_a_tube_between_face_and_apparatus_is_no_resting_whisker(self):
        background = estimate_background(movie([0.1] * 32), SCALE, DEFAULTS.scene)
        whisker = background.image - without_whiskers(
            background, face_of(still_scene()[0]), SCALE, DEFAULTS.scene
        )
        apparatus = np.zeros(whisker.shape, bool)
        apparatus[90:150, 50:80] = True  # about its far end
        image = without_whiskers(
            background, face_of(still_scene()[0]), SCALE, DEFAULTS.scene, things=apparatus
        )
        assert np.abs(whisker).max() > 10 * BURNED_IN
        assert np.abs(image - background.image).max() < BURNED_IN

    def test_short_hairs_and_lines_away_from_the_face_stay(self):
        scene, _ = still_scene()
        cv2.line(scene, (100, 180), (200, 170), 60, 2, cv2.LINE_AA)  # a scratch
        rng = np.random.default_rng(0)
        background = estimate_background(np.stack([expose(scene, rng)] * 3), SCALE, DEFAULTS.scene)
        image = without_whiskers(background, face_of(scene), SCALE, DEFAULTS.scene)
        assert np.abs(image - background.image)[:, :250].max() < BURNED_IN


class TestLight:
    def test_light_is_seen_past_objects(self):
        scene, light = still_scene()
        black, found = light_without_objects(scene, SCALE, None, DEFAULTS.scene)
        assert black == pytest.approx(6, abs=1)
        far_from_face = np.s_[:, :235]
        assert np.abs(found / light - 1)[far_from_face].max() < 3 * LIGHT
        assert np.abs(found / light - 1)[far_from_face].mean() < LIGHT

    def test_dark_corners_are_no_objects(self):
        rows, columns = np.mgrid[:HEIGHT, :WIDTH]
        light = 200 * np.exp(-(((columns - 60) / 170) ** 2) - ((rows - 180) / 180) ** 2)
        image = np.where(columns + rows > 400, 5, light + 5).astype(np.float32)
        _, found = light_without_objects(image, SCALE, None, DEFAULTS.scene)
        outside = columns + rows < 380
        transmission = (image - 5) / np.maximum(found - 5, 1)
        assert light[outside].min() < 0.1 * light.max()
        assert transmission[outside].min() > 0.6

    @pytest.mark.parametrize(("zoom", "softer"), [(1, 12), (2, 8)])
    def test_pale_fur_whose_edge_is_soft_in_one_place_is_an_object(self, zoom, softer):
        rows, columns = np.mgrid[:HEIGHT, :WIDTH]
        softness = 3 + softer * np.exp(-(((rows - 120) / 12) ** 2))
        fur = 1 / (1 + np.exp((60 - columns) / softness))
        image = (60 + 90 * fur).astype(np.float32)
        image[:40, :40] = 15
        image = cv2.resize(image, None, fx=zoom, fy=zoom)
        black, light = light_without_objects(image, zoom * SCALE, None, DEFAULTS.scene)
        transmission = (image - black) / (light - black)
        assert transmission[:, : 20 * zoom].max() < 0.45
        assert transmission[:, 120 * zoom :].min() > 0.9

    def test_fur_is_no_light_where_it_is_palest(self):
        image = np.full((HEIGHT, WIDTH), 150, np.float32)
        image[:, :100] = 65  # fur
        image[80:120, 40:70] = 85  # its palest part
        image[:40, :40] = 15
        _, light = light_without_objects(image, SCALE, None, DEFAULTS.scene)
        assert (image / light)[:, 20:80].max() < 0.65

    @pytest.mark.parametrize("clear", [0.5, 0.3])
    def test_haze_does_not_make_dark_things_pale(self, clear):
        scene, _ = still_scene()
        haze = 150 * (1 - clear)
        black, _ = light_without_objects(haze + clear * scene, SCALE, None, DEFAULTS.scene)
        assert black == pytest.approx(haze + clear * 6, abs=1)

    @pytest.mark.parametrize("darkest", [0.65, 0.8])
    def test_shade_is_no_thing(self, darkest):
        columns = np.mgrid[:HEIGHT, :WIDTH][1]
        shade = darkest + (1 - darkest) * np.sin(columns / WIDTH * np.pi) ** 2
        black, _ = light_without_objects(
            (150 * shade).astype(np.float32), SCALE, None, DEFAULTS.scene
        )
        assert black < 40

    def test_picture_without_any_dark_thing(self):
        image = np.full((HEIGHT, WIDTH), 150, np.float32)
        black, light = light_without_objects(image, SCALE, None, DEFAULTS.scene)
        assert black < 40
        assert light == pytest.approx(np.full(image.shape, 150), abs=1)


class TestThinLines:
    def test_lines_are_found_and_rods_and_edges_not(self):
        scene, _ = still_scene()
        image = with_whisker(scene, 0.1)
        (thin,) = thin_dark_lines(image, SCALE, (0.01, 0.0), DEFAULTS.scene)
        whisker = place_of_whisker(0.1) & (scene > 80) & (np.arange(WIDTH) < 215)
        assert thin[whisker].mean() > 0.95
        assert thin[:, :80][scene[:, :80] < 60].mean() < 0.02
        assert thin[140:190, 90:200].mean() < 0.01

    def test_fill_bridges_holes_of_any_size(self):
        image = np.add.outer(np.arange(60.0), np.arange(80.0)).astype(np.float32)
        holes = np.zeros(image.shape, bool)
        holes[20:40, 30:50] = True
        damaged = np.where(holes, -1000, image)
        assert np.abs(fill(damaged, holes) - image).max() < 12
        assert np.array_equal(fill(image, np.zeros_like(holes)), image)

    def test_nothing_but_holes(self):
        filled = fill(np.ones((20, 20), np.float32), np.ones((20, 20), bool))
        assert np.isfinite(filled).all()


def test_impossible_frames():
    with pytest.raises(ValueError, match=r"frames must be .* got \(0, 20, 20\)"):
        estimate_background(np.zeros((0, 20, 20), np.uint8), SCALE, DEFAULTS.scene)
