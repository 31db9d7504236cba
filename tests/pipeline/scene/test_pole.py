import cv2
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.special import erf

from pipeline.scene.circle_fit import Disc, _misfit, blurred_edge, measure_disc, rays
from pipeline.scene.pole_search import PoleCheck, find_pole

CENTRE = 0.03  # px
RADIUS = 0.05  # px
ONE_FRAME = 0.06  # px, where noise of a single frame hides the rod's faintest shade
HALF_HIDDEN = 0.15  # px, in a single frame with a fifth of the edge left free by rod and whisker
FINE = 8  # sub-pixels per pixel in the reference renders


def disc(shape, x, y, radius, blur):
    """Share of the light behind a blurred disc, by brute force on a fine grid; 0 is dark."""
    light, reach = np.ones(shape, np.float32), radius + 5 * blur + 2  # beyond, all is light
    top, left = max(int(y - reach), 0), max(int(x - reach), 0)
    bottom, right = min(int(y + reach) + 2, shape[0]), min(int(x + reach) + 2, shape[1])
    rows, columns = np.ogrid[top * FINE : bottom * FINE, left * FINE : right * FINE]
    px, py = (columns + 0.5) / FINE - 0.5, (rows + 0.5) / FINE - 0.5
    clear = (np.hypot(px - x, py - y) > radius).astype(np.float32)
    clear = cv2.GaussianBlur(clear, (0, 0), blur * FINE)
    near = light[top:bottom, left:right]
    near[:] = cv2.resize(clear, near.shape[::-1], interpolation=cv2.INTER_AREA)
    return light


def rod(shape, x, y, direction, half_width, blur):
    """Share of the light behind a rod that begins under the disc at (x, y), blurred [px]."""
    rows, columns = np.mgrid[: shape[0], : shape[1]]
    along = (columns - x) * np.cos(direction) + (rows - y) * np.sin(direction)
    across = (rows - y) * np.cos(direction) - (columns - x) * np.sin(direction)
    scale = np.sqrt(2) * blur
    inside = 0.5 * (erf((across + half_width) / scale) - erf((across - half_width) / scale))
    start, soft = 0.3 * half_width, 0.3 * half_width
    return 1 - inside * (0.5 + 0.5 * erf((along - start) / (np.sqrt(2) * soft)))


def scene(
    x, y, radius, direction=0.8, blur=0.7, shape=(120, 160), rod_blur=3.0, noise=0.0, seed=0
):
    """Disc on a rod in slightly uneven light, as a share of the light."""
    image = disc(shape, x, y, radius, blur) * rod(shape, x, y, direction, 1.05 * radius, rod_blur)
    rows, columns = np.mgrid[: shape[0], : shape[1]]
    image = 0.02 + 0.98 * image * (1 + 1e-4 * (columns - 80) - 1e-4 * (rows - 60))
    return (image + np.random.default_rng(seed).normal(0, noise, shape)).astype(np.float32)


@pytest.mark.parametrize("parameter", range(len(Disc._fields)))
def test_slopes_are_those_of_the_light(parameter):
    model = np.array([20.3, 19.6, 7.0, 1.2, 0.1, 0.9])
    py, px = (grid.ravel().astype(float) for grid in np.mgrid[:40, :40])
    step = 1e-5 * np.eye(len(model))[parameter]
    more, less = (Disc(*model + by).light(px, py) for by in (step, -step))
    slopes = Disc(*model).slopes(px, py)[:, parameter]
    assert slopes == pytest.approx((more - less) / 2e-5, abs=1e-8)


def test_a_disc_whose_edge_is_not_in_the_picture_fits_nothing():
    away = Disc(x=-40.0, y=60.0, radius=10.0, blur=0.7, inside=0.0, outside=1.0)
    assert _misfit(away, scene(80, 60, 10), np.ones(len(rays()), bool)) == np.inf


@pytest.mark.slow
@pytest.mark.parametrize("direction", np.arange(0, 6.2, 0.9))
@pytest.mark.parametrize("radius", [4.5, 6.25, 14.6])  # 0.5 mm at 18, 25, 58 px/mm
def test_pole_on_a_rod_is_found_and_measured(direction, radius):
    x, y = 83.37, 59.81
    pole = find_pole(scene(x, y, radius, direction), radius)
    small = 2 if radius < 5 else 1.0  # few pixels, and the rod's soft end covers more of them
    assert np.hypot(pole.x_px - x, pole.y_px - y) < small * CENTRE
    assert abs(pole.radius_px - radius) < RADIUS
    assert 0.55 < pole.arc < 0.8


@pytest.mark.slow
@settings(deadline=None, max_examples=20)
@given(seed=st.integers(0, 2**32 - 1), radius=st.floats(3.5, 7.0))
@example(seed=1350, radius=4.0)  # these hold sharp dust as large as the pole, 80 % dark
@example(seed=712743028, radius=4.0)
@example(seed=1452407145, radius=4.0)
def test_dust_is_no_pole(seed, radius):
    rng = np.random.default_rng(seed)
    image = scene(83.37, 59.81, radius, direction=rng.uniform(0, 2 * np.pi))
    for x, y in [(25, 20), (25, 60), (25, 100), (140, 20), (140, 60), (140, 100)]:
        x, y = x + rng.uniform(-4, 4), y + rng.uniform(-4, 4)
        speck = disc(image.shape, x, y, radius * rng.uniform(0.5, 1.2), rng.uniform(0.7, 2.0))
        image *= 1 - rng.uniform(0.2, 0.8) * (1 - speck)
    pole = find_pole(image, radius)
    assert np.hypot(pole.x_px - 83.37, pole.y_px - 59.81) < 0.5  # px; the rod may cross dust


def test_a_paler_speck_all_of_whose_edge_is_seen_is_no_likelier_pole():
    image = scene(83.37, 59.81, 3.0, 4.0, rod_blur=2.0) * (
        1 - 0.85 * (1 - disc((120, 160), 30, 90, 3.0, 0.7))
    )
    pole = find_pole(image, 3.0)
    assert np.hypot(pole.x_px - 83.37, pole.y_px - 59.81) < 0.5


@pytest.mark.parametrize("direction", [3.8, 4.8, 5.3])
def test_a_speck_is_no_pole_where_a_broad_rod_hides_much_of_the_pole(direction):
    shape, x, y, radius = (120, 160), 83.37, 59.81, 4.6
    speck = 1 - 0.75 * (1 - disc(shape, 30, 90, 0.9 * radius, 1.6))
    broad = rod(shape, x, y, direction, 1.4 * radius, 1.2)
    image = (0.02 + 0.98 * disc(shape, x, y, radius, 1.2) * broad * speck).astype(np.float32)
    pole = find_pole(image, 0.88 * radius)
    assert np.hypot(pole.x_px - x, pole.y_px - y) < 0.5


@pytest.mark.slow
@settings(deadline=None, max_examples=20)
@given(
    x=st.floats(60, 100),
    y=st.floats(45, 75),
    radius=st.floats(4.0, 12.0),
    blur=st.floats(0.5, 1.5),
)
def test_free_disc_is_measured_wherever_it_lies_in_the_pixel_grid(x, y, radius, blur):
    image = disc((120, 160), x, y, radius, blur)
    pole = measure_disc(image, x + 0.7, y - 0.6, 1.1 * radius, 1.05 * radius)
    assert np.hypot(pole.x_px - x, pole.y_px - y) < CENTRE
    assert abs(pole.radius_px - radius) < RADIUS
    assert pole.arc == 1.0


def test_noise_of_one_frame():
    errors = []
    for seed in range(8):
        pole = find_pole(scene(83.37, 59.81, 6.25, noise=0.014, seed=seed), 6.25)
        errors.append([pole.x_px - 83.37, pole.y_px - 59.81, pole.radius_px - 6.25])
    assert np.mean(errors, axis=0) == pytest.approx(0, abs=ONE_FRAME)
    assert np.std(errors, axis=0) == pytest.approx(0, abs=ONE_FRAME)


@pytest.mark.slow
@pytest.mark.parametrize("factor", [0.8, 0.9, 1.1, 1.25])
def test_scale_may_be_a_little_off(factor):
    pole = find_pole(scene(83.37, 59.81, 6.25), factor * 6.25)
    assert abs(pole.radius_px - 6.25) < RADIUS


def test_a_whisker_that_rests_on_the_pole_does_not_pull_it():
    image = scene(83.37, 59.81, 6.25, direction=-1.2)
    line = cv2.line(np.ones_like(image), (0, 67), (159, 68), 0.3, 2, cv2.LINE_AA)
    pole = find_pole(image * cv2.GaussianBlur(line, (0, 0), 0.7), 6.25)
    assert np.hypot(pole.x_px - 83.37, pole.y_px - 59.81) < HALF_HIDDEN
    assert abs(pole.radius_px - 6.25) < HALF_HIDDEN


@pytest.mark.slow
@pytest.mark.parametrize("direction", np.arange(0, 6.2, 0.7))
def test_a_whisker_that_never_leaves_the_pole_is_no_part_of_it(direction):
    x, y, radius, half_width, opacity = 83.37, 59.81, 10.0, 0.6, 0.9
    image = scene(x, y, radius, direction + np.pi)
    rows, columns = np.mgrid[: image.shape[0], : image.shape[1]]
    away = (columns - x) * np.cos(direction) + (rows - y) * np.sin(direction)
    off, scale = away - radius - half_width, np.sqrt(2) * 0.76  # px, blur and pixel
    whisker = 0.5 * (erf((off + half_width) / scale) - erf((off - half_width) / scale))
    pole = find_pole(image * (1 - opacity * whisker).astype(np.float32), radius)
    assert np.hypot(pole.x_px - x, pole.y_px - y) < HALF_HIDDEN
    assert abs(pole.radius_px - radius) < HALF_HIDDEN


@pytest.mark.parametrize(("dark", "chosen"), [(0.95, (30, 90)), (0.7, (83.37, 59.81))])
def test_whiskers_that_pass_over_a_pole_make_only_a_likely_disc_the_pole(dark, chosen):
    image = scene(83.37, 59.81, 6.25, direction=-1.2)
    image *= 1 - dark * (1 - disc(image.shape, 30, 90, 6.25, 0.7))
    pole = find_pole(image, 6.25, passed_over=lambda x, y, radius: x > 60)
    assert np.hypot(pole.x_px - chosen[0], pole.y_px - chosen[1]) < 0.5


def test_given_place_chooses_among_poles():
    image = disc((120, 160), 40.2, 60.3, 6.0, 0.7) * disc((120, 160), 120.6, 50.1, 6.0, 0.7)
    pole = find_pole(image, 6.0, near_xy=(118, 52))
    assert np.hypot(pole.x_px - 120.6, pole.y_px - 50.1) < CENTRE


class TestNoPole:
    def test_empty_picture(self):
        assert find_pole(np.ones((120, 160), np.float32), 6.25) is None

    def test_rod_alone(self):
        assert find_pole(rod((120, 160), -50, 20, 0.4, 7.0, 1.0), 6.25) is None

    def test_corner(self):
        image = np.ones((120, 160), np.float32)
        image[:60, :80] = 0.02
        assert find_pole(cv2.GaussianBlur(image, (0, 0), 0.8), 6.25) is None

    def test_disc_of_another_size(self):
        assert find_pole(scene(83.37, 59.81, 14.0), 6.25) is None

    def test_where_the_face_is(self):
        image = scene(83.37, 59.81, 6.25)
        assert find_pole(image, 6.25, exclude=np.ones(image.shape, bool)) is None

    def test_impossible_radius(self):
        with pytest.raises(ValueError, match="radius_px must be > 0, got 0"):
            find_pole(np.ones((9, 9)), 0)


def test_half_level_of_a_blurred_disc_lies_inside_its_radius():
    """The model against brute force, in the middle of the edge and in its flanks."""
    image = disc((61, 61), 30, 30, 8.0, 1.2)
    distance = np.arange(5.0, 12.0)
    width = np.hypot(1.2, np.sqrt(1 / 12))  # a pixel averages over its area
    expected = blurred_edge(distance, 8.0, width, 0.0, 1.0)
    assert image[30, 30 + distance.astype(int)] == pytest.approx(expected, abs=0.01)


class TestPoleCheck:
    @pytest.mark.parametrize("shift", [2.5, -4.0])
    def test_pole_that_is_away_or_moves_is_noticed(self, shift):
        present = (255 * scene(83.37, 59.81, 6.25)).astype(np.uint8)
        away = np.full(present.shape, 250, np.uint8)
        moved = scene(83.37 + shift * np.cos(0.8), 59.81 + shift * np.sin(0.8), 6.25)
        moved = (255 * moved).astype(np.uint8)  # along its rod
        check = PoleCheck(83.37, 59.81, 6.25, present.astype(np.float32))
        seen = [check.in_place(frame) for frame in (away, present, moved, present)]
        assert seen == [False, True, False, True]

    def test_flicker_noise_and_whiskers_do_not_hide_the_pole(self):
        rng = np.random.default_rng(0)
        pole = 255 * scene(83.37, 59.81, 6.25)
        check = PoleCheck(83.37, 59.81, 6.25, pole)
        for gain in (0.8, 1.0, 1.15):
            frame = gain * pole + rng.normal(0, 4, pole.shape)
            cv2.line(frame, (0, 67), (159, 68), 40, 3)
            assert check.in_place(np.clip(frame, 0, 255).astype(np.uint8))


class TestGreyPoles:
    """Poles that let light through, as poles of glass or out of focus do."""

    def grey(self, contrast, noise=0.003):
        rng = np.random.default_rng(1)
        image = 1 - contrast * (1 - disc((120, 160), 83.37, 59.81, 6.25, 0.9))
        return (image + rng.normal(0, noise, image.shape)).astype(np.float32)

    @pytest.mark.parametrize("contrast", [0.25, 0.35, 0.6])
    def test_are_found(self, contrast):
        pole = find_pole(self.grey(contrast), 6.25)
        assert np.hypot(pole.x_px - 83.37, pole.y_px - 59.81) < ONE_FRAME
        assert abs(pole.radius_px - 6.25) < RADIUS

    def test_faint_ones_are_believed_where_they_are_said_to_be(self):
        image = self.grey(0.12)
        assert find_pole(image, 6.25) is None
        pole = find_pole(image, 6.25, near_xy=(83.0, 60.0))
        assert (pole.x_px, pole.y_px, pole.radius_px) == (83.0, 60.0, 6.25)

    def test_where_nothing_is_there_is_no_pole(self):
        assert find_pole(self.grey(0.12), 6.25, near_xy=(40.0, 60.0)) is None
