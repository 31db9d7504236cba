"""Pictures against their truth: where the whisker is, what meets, what hides it, the noise."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter
from scipy.spatial import cKDTree

from synthetic.motion import Motion, solve_motion, still_pole
from synthetic.render import Renderer
from synthetic.scene import Camera, Face, Hair, Lights, Pole, Scene
from synthetic.staging import Setting, c2_scene, touching_motion
from synthetic.touches import Touch
from synthetic.truth import centreline_table, visibility_table
from whiskermodel.whisker import Whisker, mouse_c2

pytestmark = pytest.mark.slow

centre_tolerance = 0.01  # px, the promise of the renderer
composed_tolerance = 0.005  # share of the light
FINE = 10  # sub-pixels of the brute-force picture


def still_motion(scene, angles, n=2):
    """Motion of whiskers that stand still at these base angles, untouched."""
    nowhere = np.full(n, np.nan)
    hairs = [
        solve_motion(
            hair, (np.full(n, hair.follicle_x), np.full(n, hair.follicle_y), np.full(n, angle)),
            (nowhere, nowhere, 0.0), 1,
        )
        for hair, angle in zip(scene.hairs, angles, strict=True)
    ]  # fmt: skip
    return Motion(scene, hairs, *still_pole(scene, n))


@pytest.fixture(scope="module")
def touching():
    """A whisker bent by the pole, seen without noise."""
    setting = Setting("test", 1, 0, np.random.default_rng(2), 60)
    scene = c2_scene(setting, 8e-3, 0.05)
    return Renderer(scene, touching_motion(setting, scene, [Touch(20, 21, 25e-6)]))


def test_whisker_is_where_the_truth_says(touching):
    frame = 30
    share = 1 - touching.light(frame) / touching.without_whiskers(frame)
    x, y = touching.motion.centrelines(0, slice(frame, frame + 1))
    pole_x, _ = touching.scene.to_pixels(touching.motion.pole_x[frame], 0.0)
    rows = np.arange(share.shape[0])
    errors = []
    for column in range(int(x[0, 45]), int(x[0, -25])):
        if abs(column - pole_x) < 15:
            continue
        true = np.interp(column, x[0], y[0])
        window = np.abs(rows - true) < 7
        weight = share[window, column]
        errors.append(np.sum(weight * rows[window]) / weight.sum() - true)
    assert len(errors) > 300
    assert np.sqrt(np.mean(np.square(errors))) < centre_tolerance
    assert np.abs(errors).max() < 3 * centre_tolerance


def brute_force(scene, lines, discs, window):
    """Product of all objects on a fine grid, then blur and pixels; (rows, columns) of `window`.

    `lines` are (x, y, radius, opacity) with points close together, `discs` (x, y, radius).
    """
    top, left, height, width = window
    margin = 6
    shape = (height + 2 * margin) * FINE, (width + 2 * margin) * FINE
    row, column = np.mgrid[: shape[0], : shape[1]]
    px = (column + 0.5) / FINE - 0.5 + left - margin
    py = (row + 0.5) / FINE - 0.5 + top - margin
    light = np.ones(shape)
    for x, y, radius, opacity in lines:
        tree = cKDTree(np.column_stack([x, y]))
        places, reach = np.column_stack([px.ravel(), py.ravel()]), radius.max() + 1
        distance, nearest = tree.query(places, distance_upper_bound=reach)  # inf farther away
        wide = radius[np.minimum(nearest, len(radius) - 1)]
        inside = np.clip((wide - distance) * FINE + 0.5, 0, 1)
        light *= 1 - opacity * inside.reshape(shape)
    for x, y, radius in discs:
        inside = np.clip((radius - np.hypot(px - x, py - y)) * FINE + 0.5, 0, 1)
        light *= 1 - 0.99 * inside
    light = gaussian_filter(light, scene.camera.blur_px * FINE, truncate=6)
    light = light.reshape(height + 2 * margin, FINE, width + 2 * margin, FINE).mean((1, 3))
    return light[margin:-margin, margin:-margin]


def fine_line(motion, hair, frame):
    """Centreline, half-width and opacity with points 0.02 px apart."""
    x, y = (part[0] for part in motion.centrelines(hair, slice(frame, frame + 1)))
    s = np.linspace(0, 1, len(x))
    fine = np.linspace(0, 1, 50 * len(x))
    whisker = motion.scene.hairs[hair].whisker
    radius = whisker.radius(fine * whisker.length) * motion.scene.camera.pixels_per_m
    spline = [np.interp(fine, s, part) for part in (x, y)]
    return *spline, radius, motion.scene.hairs[hair].opacity


def test_touch_of_whisker_and_pole_is_composed_before_the_blur():
    setting = Setting("test", 1, 0, np.random.default_rng(2), 60)
    camera = Camera(exposure_s=0.0)
    scene = c2_scene(setting, 8e-3, 0.05, camera, pole={"rod_direction": None})
    renderer = Renderer(scene, touching_motion(setting, scene, [Touch(20, 21, 25e-6)]))
    frame, motion = 30, renderer.motion
    disc = *scene.to_pixels(motion.pole_x[frame], motion.pole_y[frame]), 0.25e-3 * 25e3
    window = int(disc[1]) - 14, int(disc[0]) - 18, 30, 36
    reference = brute_force(scene, [fine_line(motion, 0, frame)], [disc], window)
    view = np.s_[window[0] : window[0] + window[2], window[1] : window[1] + window[3]]
    picture = (renderer.light(frame) / renderer.opened(frame))[view]
    assert np.abs(picture - reference).max() < composed_tolerance


def test_crossing_whiskers_are_composed_before_the_blur():
    hairs = tuple(
        Hair(Whisker(18e-3, 18e-3 / 0.95, 37e-6, name=name), (0.0,), 2.3e-3, y)
        for name, y in (("A", -9.0e-3), ("B", -10.5e-3))
    )
    scene = Scene(Camera(exposure_s=0.0), Lights(), Face(pad=1.5e-3), hairs, None)
    renderer = Renderer(scene, still_motion(scene, (-0.05, 0.08)))
    x, y = 57.5 + 11.5e-3 * 25e3, 9.6e-3 * 25e3 + 0.0
    window = int(y) - 10, int(x) - 25, 20, 50
    lines = [fine_line(renderer.motion, h, 0) for h in (0, 1)]
    reference = brute_force(scene, lines, [], window)
    view = np.s_[window[0] : window[0] + window[2], window[1] : window[1] + window[3]]
    picture = (renderer.light(0) / renderer.opened(0))[view]
    assert picture.min() < 0.6  # both are in the window
    assert np.abs(picture - reference).max() < composed_tolerance


@pytest.mark.parametrize("side", ["left", "right", "top", "bottom"])
def test_face_stands_on_its_side_and_hides_the_base(side):
    axis = Face(side).axis
    follicle = 12e-3 - 9.5e-3 * np.cos(axis), -12e-3 - 9.5e-3 * np.sin(axis)
    hair = Hair(mouse_c2(), (0.0,), *follicle)
    scene = Scene(Camera(600, 600), Lights(), Face(side, hidden_length=1.4e-3), (hair,), None)
    sweep = np.deg2rad([-25, -10, 0, 10, 25])
    hidden = []
    for turn in sweep:
        motion = still_motion(scene, (axis + turn,))
        renderer = Renderer(scene, motion)
        x, y = (part[0] for part in motion.centrelines(0, slice(0, 1)))
        share = (renderer.opened(0) / renderer.background)[
            np.rint(y).astype(int), np.rint(x).astype(int)
        ]
        hidden.append(np.flatnonzero(share[:100] < 0.5).max() / 25)
    darkness = 1 - renderer.opened(0) / renderer.background
    edges = {
        "left": darkness[:, 0], "right": darkness[:, -1],
        "top": darkness[0], "bottom": darkness[-1],
    }  # fmt: skip
    assert max(edges, key=lambda name: edges[name].mean()) == side
    hidden_tolerance = 0.2  # mm: hairs stand before the edge here and there
    assert np.abs(np.array(hidden) - 1.4).max() < hidden_tolerance


def test_dust_before_a_whisker_is_not_taken_for_fur():
    hair = Hair(mouse_c2(), (0.0,), 2.5e-3, -12e-3)
    clean = Scene(Camera(300, 600), Lights(), Face("left", hidden_length=1.4e-3), (hair,), None)
    first_visible = []
    for clutter in (0, 1500):  # specks of dust
        scene = replace(clean, clutter=clutter)
        motion = still_motion(scene, (scene.face.axis,), n=1)
        drawn = Renderer(scene, motion)
        table = visibility_table(motion, drawn, centreline_table(motion))
        first_visible.append(table.first_visible_mm[0])
        dark = drawn.opened(0)[295:306, 110:] < 0.3 * drawn.opened(0).max()
    assert dark.any()  # dust lies on the whisker
    assert first_visible[0] == first_visible[1]  # mm


def test_noise_has_the_asked_for_size_and_is_reproducible(touching):
    scene = replace(touching.scene, camera=Camera().with_noise_sd(2.5))
    renderer = Renderer(scene, touching.motion, seed=4)
    first, again, next_one = renderer.frame(0), renderer.frame(0), renderer.frame(1)
    assert np.array_equal(first, again)
    view = np.s_[420:, 300:]  # nothing moves there
    difference = first[view].astype(float) - next_one[view]
    level = first[view].mean()
    wanted = np.sqrt(2.5**2 / 6 + scene.camera.noise_gain * (level - 4) + 1 / 12)
    assert difference.std() / np.sqrt(2) == pytest.approx(wanted, rel=0.02)
    expected = renderer.light(0)[view] + scene.camera.black_level
    assert (first[view] - expected).mean() == pytest.approx(0, abs=0.05)
    neighbours = np.corrcoef(difference[:, 1:].ravel(), difference[:, :-1].ravel())[0, 1]
    assert abs(neighbours) < 0.02


def test_noise_is_gaussian_and_independent_from_frame_to_frame(touching):
    scene = replace(touching.scene, camera=Camera().with_noise_sd(6.0))
    renderer = Renderer(scene, touching.motion, seed=11)
    view = np.s_[420:, 300:]
    expected = renderer.light(0)[view] + scene.camera.black_level
    sd = np.sqrt(6.0**2 / 6 + scene.camera.noise_gain * (expected - 4) + 1 / 12)
    noise = np.stack([(renderer.frame(i)[view] - expected) / sd for i in range(30)])
    noise = noise[:, expected < 255 - 5 * sd]  # no grey level is cut off
    assert noise.shape[1] > 2000
    assert noise.std() == pytest.approx(1, abs=0.01)
    assert (noise**3).mean() == pytest.approx(0, abs=0.03)
    assert (noise**4).mean() == pytest.approx(3, abs=0.1)
    among_frames = np.corrcoef(noise)[np.triu_indices(30, 1)]
    assert np.abs(among_frames).max() < 5 / np.sqrt(noise.shape[1])
    assert (among_frames**2).mean() == pytest.approx(1 / noise.shape[1], rel=0.25)


def test_other_seeds_make_other_noise(touching):
    one, two = (Renderer(touching.scene, touching.motion, seed=s).frame(0) for s in (1, 2))
    assert (one != two).mean() > 0.3


def test_contrast_at_5_5_mm_is_about_a_hundred_grey_levels(touching):
    dark = touching.without_whiskers(0) - touching.light(0)
    x, y = (part[0] for part in touching.motion.centrelines(0, slice(0, 1)))
    place = int(5.5 * 25)
    around = dark[int(y[place]) - 3 : int(y[place]) + 4, int(x[place])]
    assert around.max() == pytest.approx(100, abs=15)  # grey levels


def test_withdrawn_pole_leaves_no_shadow(touching):
    motion = touching.motion
    nowhere = np.full(len(motion), np.nan)
    without = Renderer(motion.scene, Motion(motion.scene, motion.hairs, nowhere, nowhere))
    assert np.array_equal(without.without_whiskers(0), without.opened(0))
    assert touching.without_whiskers(0).min() < 0.02 * touching.opened(0).max()


def test_moving_fur_moves_and_flicker_flickers():
    hair = Hair(mouse_c2(), (0.0,), 2.3e-3, -9.6e-3)
    scene = Scene(hairs=(hair,), face=Face(moving=0.2e-3), lights=Lights(flicker=0.05))
    n, nowhere = 40, np.full(40, np.nan)
    base = np.full(n, 2.3e-3), np.full(n, -9.6e-3), 0.4 * np.sin(np.arange(n) / 5)
    hairs = [solve_motion(hair, base, (nowhere, nowhere, 0.0), 1)]
    motion = Motion(scene, hairs, nowhere, nowhere)
    renderer = Renderer(scene, motion, seed=0)
    frames = np.stack([renderer.frame(i) for i in range(len(renderer))]).astype(float)
    assert frames.shape == (40, 480, 640)
    renderer = Renderer(scene, motion)
    assert np.abs(renderer.opened(0) - renderer.opened(8)).max() > 30
    brightness = frames[:, 300:, 400:].mean((1, 2))
    assert np.ptp(brightness) / brightness.mean() > 0.04


def test_pole_without_size_is_refused():
    with pytest.raises(ValueError, match="radius must be > 0 m, got 0"):
        Pole(0.0, 0.0, radius=0.0)
