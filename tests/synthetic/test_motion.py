"""Driven whiskers: wanted forces, contact edges, slips, signs; shapes against the rod."""

import numpy as np
import pytest

from synthetic.motion import (
    Motion,
    curvature_along,
    follicle_drift,
    pole_visits,
    side_of_pole,
    solve_motion,
    still_pole,
    whisking,
)
from synthetic.scene import Hair, Pole, Scene
from synthetic.staging import pole_for_touch
from synthetic.touches import (
    Touch,
    UnreachableForceError,
    angles_for_forces,
    drive_touches,
    force_table,
    grazing_angle,
)
from whiskermodel.rod import contact_shape, free_shape
from whiskermodel.whisker import mouse_c2

force_tolerance = 1e-5  # of the wanted force
angle_tolerance = 1e-4  # rad
HAIR = Hair(mouse_c2(), (12.0, 1800.0), 2.3e-3, -9.0e-3)
RADIUS = 0.25e-3


def scene_for(side, arc_length=9e-3, hair=HAIR):
    place = pole_for_touch(hair, 0.1 * side, arc_length, side, RADIUS)
    return Scene(hairs=(hair,), pole=Pole(*place, RADIUS))


def driven(side, touches, n=200):
    scene, rng = scene_for(side), np.random.default_rng(5)
    dx, dy = follicle_drift(n, 1000.0, rng)
    base = HAIR.follicle_x + dx, HAIR.follicle_y + dy
    pole = scene.pole.x, scene.pole.y, RADIUS
    angle, _ = drive_touches(HAIR, base, pole, side, touches, rng)
    path = still_pole(scene, n)
    hairs = [solve_motion(HAIR, (*base, angle), (*path, RADIUS), side)]
    return scene, Motion(scene, hairs, *path)


@pytest.fixture(scope="module", params=[1, -1])
def touching(request):
    touches = [Touch(30, 20, 20e-6), Touch(54, 3, 2e-6), Touch(90, 61, 8e-6, "plateau")]
    return request.param, touches, driven(request.param, touches)[1]


def test_touches_have_the_wanted_forces_and_edges(touching):
    _, touches, motion = touching
    contact = motion.hairs[0].contact
    wanted = np.zeros(len(motion))
    for touch in touches:
        wanted[touch.onset : touch.offset] = touch.forces()
    assert np.array_equal(contact.touching, wanted > 0)
    assert contact.contact_force == pytest.approx(wanted, rel=force_tolerance, abs=1e-12)
    assert motion.hairs[0].slips == ()


def test_base_angle_turns_without_jumps(touching):
    angle = touching[2].hairs[0].contact.base_angle
    largest_turn = np.deg2rad(6)  # per frame
    assert np.abs(np.diff(angle)).max() < largest_turn


@pytest.mark.slow
@pytest.mark.parametrize("gap", [1, 3, 8, 40, 49, 50, 51, 54, 90, 200])
def test_free_stretches_of_any_length_leave_the_pole(gap):
    second = 60 + gap
    _, motion = driven(1, [Touch(30, 30, 6e-6), Touch(second, 20, 8e-6)], n=second + 60)
    touching = motion.hairs[0].contact.touching
    wanted = np.zeros(len(motion), bool)
    wanted[30:60] = wanted[second : second + 20] = True
    assert np.array_equal(touching, wanted)


def test_load_bends_away_from_the_pole(touching):
    side, _, motion = touching
    contact = motion.hairs[0].contact
    curvature = curvature_along(HAIR.whisker, contact, np.array([5.5e-3]))[:, 0]
    change = curvature - (12 + 1800 * 5.5e-3)
    # a pole on the left (seen from the follicle) bends the whisker clockwise
    assert np.all(side * change[contact.touching] < 0)
    assert np.all(side * contact.base_moment[contact.touching] < 0)
    assert change[~contact.touching] == pytest.approx(0, abs=1e-9)


def test_curvature_is_the_derivative_of_the_angle(touching):
    contact = touching[2].hairs[0].contact.take(slice(30, 100, 8))
    s = np.linspace(1e-3, 6e-3, 501)
    _, _, angle = contact_shape(HAIR.whisker, contact, s)
    numerical = np.gradient(angle, s, axis=1)[:, 5:-5]
    assert curvature_along(HAIR.whisker, contact, s)[:, 5:-5] == pytest.approx(numerical, abs=2e-2)


def test_centreline_has_the_whisker_s_length(touching):
    motion = touching[2]
    x, y = motion.centrelines(0, slice(35, 45))
    length = np.hypot(np.diff(x), np.diff(y)).sum(1) / motion.scene.camera.pixels_per_m
    assert length == pytest.approx(18e-3, rel=1e-5)
    assert x[:, 0] == pytest.approx(
        motion.hairs[0].contact.base_x[35:45] * motion.scene.camera.pixels_per_m
    )


def test_strip_follows_the_centreline(touching):
    motion = touching[2]
    x, y, angle, curvature, radius, _ = motion.strip(0, 40)
    step = np.hypot(np.diff(x), np.diff(y))
    assert np.diff(angle) == pytest.approx(
        0.5 * (curvature[1:] + curvature[:-1]) * step, abs=angle_tolerance
    )
    assert np.arctan2(-np.diff(y), np.diff(x)) == pytest.approx(
        0.5 * (angle[1:] + angle[:-1]), abs=angle_tolerance
    )
    assert radius[0] == pytest.approx(37e-6 * 25e3)


@pytest.mark.parametrize("side", [1, -1])
def test_grazing_angle_is_where_touch_begins(side):
    pole = scene_for(side).pole
    graze = grazing_angle(HAIR, pole.x - HAIR.follicle_x, pole.y - HAIR.follicle_y, RADIUS, side)
    assert graze == pytest.approx(0.1 * side, abs=angle_tolerance)
    base = np.full(2, HAIR.follicle_x), np.full(2, HAIR.follicle_y)
    angles = graze + side * angle_tolerance * np.array([-1, 1])
    path = np.full(2, pole.x), np.full(2, pole.y)
    moving = solve_motion(HAIR, (*base, angles), (*path, RADIUS), side)
    assert moving.contact.touching.tolist() == [False, True]


def test_grazing_angle_out_of_reach_is_nan():
    assert np.isnan(grazing_angle(HAIR, 30e-3, 0.0, RADIUS, 1))


def test_slip_off_is_recognised_and_the_whisker_comes_back_on_the_other_side():
    scene = scene_for(1, 14e-3)
    table = force_table(
        HAIR, HAIR.follicle_x, HAIR.follicle_y, scene.pole.x, scene.pole.y, RADIUS, 1
    )
    graze = 0.1
    turn = np.concatenate(
        [np.linspace(-0.1, table.turn[-1] + 0.2, 80), np.linspace(table.turn[-1] + 0.2, -0.9, 120)]
    )
    base = np.full(200, HAIR.follicle_x), np.full(200, HAIR.follicle_y)
    moving = solve_motion(HAIR, (*base, graze + turn), (*still_pole(scene, 200), RADIUS), 1)
    first, second = moving.slips
    assert moving.contact.touching[first - 1]
    assert not moving.contact.touching[first]
    assert np.all(moving.contact.side[:first] == 1)
    assert np.all(moving.contact.side[first:second] == -1)
    assert moving.contact.touching[first:second].any()
    assert np.all(moving.contact.side[second:] == 1)


def test_force_that_the_whisker_cannot_bear_is_refused():
    scene = scene_for(1, 11e-3)
    base = np.full(5, HAIR.follicle_x), np.full(5, HAIR.follicle_y)
    with pytest.raises(UnreachableForceError, match="slips off beyond"):
        angles_for_forces(HAIR, *base, (scene.pole.x, scene.pole.y, RADIUS), 1, np.full(5, 60e-6))


def test_touches_out_of_order_are_refused():
    with pytest.raises(ValueError, match="in order"):
        driven(1, [Touch(50, 10, 1e-6), Touch(55, 10, 1e-6)])


def test_pole_out_of_view_is_never_touched():
    nowhere = np.full(10, np.nan)
    base = np.zeros(10), np.zeros(10), np.linspace(-1.5, 1.5, 10)
    for side in (1, -1):
        moving = solve_motion(HAIR, base, (nowhere, nowhere, RADIUS), side)
        assert set(moving.contact.state) == {"free"}


def test_moving_pole_comes_and_goes():
    scene = scene_for(1)
    pole = Pole(scene.pole.x, scene.pole.y, away_x=0, away_y=20e-3)
    scene = Scene(hairs=scene.hairs, pole=pole)
    x, y = pole_visits(scene, 300, [(50, 250)], 60)
    assert np.isnan(x[[0, 49, 299]]).all()
    assert x[150] == pytest.approx(pole.x)
    assert y[150] == pytest.approx(pole.y)
    assert y[100] > pole.y


def test_side_of_pole():
    s = np.array([0.0, 8e-3])
    x, y, _ = free_shape(HAIR.whisker, 0.0, 0.0, 0.3, s, HAIR.intrinsic_curvature)
    assert side_of_pole(HAIR, 0.0, 0.0, 0.3, x[1], y[1] + 1e-3) == 1
    assert side_of_pole(HAIR, 0.0, 0.0, 0.3, x[1], y[1] - 1e-3) == -1


def test_whisking_is_whisking():
    angle = whisking(4000, 1000.0, np.random.default_rng(1), 0.3, 0.25, 14.0)
    spectrum = np.abs(np.fft.rfft(angle - angle.mean())) ** 2
    peak = np.argmax(spectrum[8:]) + 8  # beyond the drift below 2 Hz
    assert 10 < peak / 4 < 20  # Hz
    assert abs(angle.mean() - 0.3) < 0.1
    assert np.ptp(angle) < 1.0


def test_smear_is_the_way_across_the_whisker_and_none_where_it_jumps():
    """Turned by 0.01 rad per frame about its follicle, and by 0.3 rad once: a slip."""
    scene = Scene(hairs=(Hair(mouse_c2(), (0.0, 0.0), 2.3e-3, -9e-3),))
    turn = 0.01 * np.arange(12.0)
    turn[6:] += 0.3
    still = np.full(12, 2.3e-3), np.full(12, -9e-3)
    nowhere = np.full(12, np.nan)
    hair = solve_motion(scene.hairs[0], (*still, turn), (nowhere, nowhere, 0.0), 1)
    motion, camera = Motion(scene, [hair], nowhere, nowhere), scene.camera
    exposed = camera.exposure_s * camera.frames_per_second
    arc = np.linspace(0, 18e-3, len(motion.strip(0, 3)[5]))
    for frame in (3, 5, 6, 9):
        expected = 0.01 * arc * camera.pixels_per_m * exposed
        np.testing.assert_allclose(motion.strip(0, frame)[5], expected, rtol=2e-2, atol=1e-6)
