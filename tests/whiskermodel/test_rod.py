"""The large-angle rod against independent solutions, closed forms, equilibrium and energy."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_bvp

from whiskermodel import rod, rod_shapes
from whiskermodel.rod import contact_shape, free_shape, solve_contact
from whiskermodel.whisker import Whisker, mouse_c2

POLE_RADIUS = 0.25e-3  # m
agreement_with_solve_bvp = 1e-9  # relative
agreement_with_small_angle = 1e-3  # relative, at 0.01 rad


def turned_into_pole(push, distance=9e-3, side=1, whisker=None, **kwargs):
    """Contacts of a straight-mounted whisker turned by `push` [rad] beyond the grazing touch."""
    whisker = whisker or mouse_c2()
    pole_y = side * (POLE_RADIUS + float(whisker.radius(distance)))
    angle = side * np.atleast_1d(push)
    return whisker, solve_contact(
        whisker, (0, 0, angle), (distance, pole_y, POLE_RADIUS), side, **kwargs
    )


def rod_bvp(whisker, angle, pole_x, pole_y, side, curvature, guess, friction=0.0):
    """Contact arc length and normal force [m, N] from scipy's general boundary-value solver.

    In units of mm and µN: states θ, x, y, m = B(θ' − κ0), and the constants c, fx, fy, over
    t = s/c; m' = −(t̂ × F) with m = 0 at the contact.
    """
    scale = np.array([1, 1e-3, 1e-3, 1e-9, 1e-3, 1e-6, 1e-6])

    def slopes(t, y):
        theta, _, _, m, c, fx, fy = y * scale[:, None]
        s = c * t
        rest = sum(k * s**i for i, k in enumerate(curvature))
        bend = rest + m / (whisker.youngs_modulus * np.pi / 4 * whisker.radius(s) ** 4)
        cos, sin = np.cos(theta), np.sin(theta)
        zero = np.zeros_like(t)
        rates = [c * bend, c * cos, c * sin, -c * (cos * fy - sin * fx), zero, zero, zero]
        return np.stack(rates) / scale[:, None]

    def ends(first, last):
        theta, x, y, m, c, fx, fy = last * scale
        reach = side * (POLE_RADIUS + float(whisker.radius(c)))
        normal = -side * (fy * np.cos(theta) - fx * np.sin(theta))
        tangential = fx * np.cos(theta) + fy * np.sin(theta)
        return np.array(
            [
                first[0] - angle,
                first[1],
                first[2],
                m * 1e9,
                (x - reach * np.sin(theta) - pole_x) * 1e3,
                (y + reach * np.cos(theta) - pole_y) * 1e3,
                (tangential - friction * normal) * 1e6,
            ]
        )

    t = np.linspace(0, 1, 60)
    x, y, theta = contact_shape(whisker, guess, guess.contact_arc_length * t)
    c, tc, force = guess.contact_arc_length[0], guess.contact_angle[0], guess.contact_force[0]
    fx = force * (side * np.sin(tc) + friction * np.cos(tc))
    fy = force * (-side * np.cos(tc) + friction * np.sin(tc))
    moment = (x[0, -1] - x[0]) * fy - (y[0, -1] - y[0]) * fx
    # start 5 % off, so that agreement is not inherited
    off = np.array([1, 1, 1, 1.05, 1.01, 1.05, 1.05])
    rows = [theta[0], x[0], y[0], moment, c + 0 * t, fx + 0 * t, fy + 0 * t]
    start = np.stack(rows) / scale[:, None] * off[:, None]
    answer = solve_bvp(slopes, ends, t, start, tol=1e-9, bc_tol=1e-12, max_nodes=60000)
    assert answer.success, answer.message
    theta, _, _, m0, c, fx, fy = answer.y * scale[:, None]
    normal = -side * (fy[-1] * np.cos(theta[-1]) - fx[-1] * np.sin(theta[-1]))
    return c[0], normal, m0[0]


@pytest.mark.parametrize(
    ("angle", "pole_x", "side", "curvature", "friction"),
    [
        (0.2, 9e-3, 1, (0.0,), 0.0),
        (-0.6, 8e-3, -1, (20.0, -500.0), 0.0),
        (0.35, 11e-3, 1, (-30.0, 1000.0), 0.25),
        (0.08, 15e-3, 1, (10.0,), 0.0),
    ],
)
def test_agrees_with_general_solver(angle, pole_x, side, curvature, friction):
    whisker = mouse_c2()
    place = (0.0, 0.0, angle), (pole_x, 0.3e-3, POLE_RADIUS), side
    ours = solve_contact(whisker, *place, intrinsic_curvature=curvature, friction=friction)
    assert ours.state[0] == "contact"
    c, force, moment = rod_bvp(
        whisker, angle, pole_x, 0.3e-3, side, curvature, ours, friction=friction
    )
    assert ours.contact_arc_length[0] == pytest.approx(c, rel=agreement_with_solve_bvp)
    assert ours.contact_force[0] == pytest.approx(force, rel=agreement_with_solve_bvp)
    assert ours.base_moment[0] == pytest.approx(moment, rel=agreement_with_solve_bvp)


def test_spectral_convergence(monkeypatch):
    """The error falls as a power of e with the number of nodes, and is gone at the default."""
    default = rod_shapes._NODES

    def forces(nodes):
        monkeypatch.setattr(rod_shapes, "_NODES", nodes)
        _, near = turned_into_pole([0.3, 0.7])
        _, distal = turned_into_pole([0.02, 0.05], distance=16e-3)
        return np.concatenate([near.contact_force, distal.contact_force])

    truth = forces(65)
    assert np.all(truth > 0)
    errors = [np.abs(forces(nodes) / truth - 1).max() for nodes in (7, 11, 15, default)]
    assert errors[1] < 0.1 * errors[0]
    assert errors[2] < 0.1 * errors[1]
    assert errors[3] < 1e-10


def test_small_angle_limit_is_eq_17():
    """Push angle = F ỹ_s'(0) with ỹ_s'(0) = L_in c² / (3 (L_in − c) E I0), Eq. 17."""
    push = 0.01
    for distance in (5e-3, 9e-3, 14e-3):
        whisker, ours = turned_into_pole([push], distance=distance)
        c, cone = ours.contact_arc_length, whisker.cone_length
        compliance = cone * c**2 / (3 * (cone - c) * whisker.base_flexural_rigidity)
        np.testing.assert_allclose(ours.contact_force * compliance, push, rtol=5e-3)
        np.testing.assert_allclose(
            ours.base_moment, -c * ours.contact_force, rtol=agreement_with_small_angle
        )


def test_small_angle_shape_is_eq_17():
    """Deflection against the chord, both sides of the contact (Eq. 17, chord frame)."""
    whisker, ours = turned_into_pole([1e-3], distance=9e-3)
    c, cone, force = ours.contact_arc_length[0], whisker.cone_length, ours.contact_force[0]
    s = np.linspace(0, whisker.length, 50)
    d = force * cone**4 / (6 * whisker.base_flexural_rigidity)
    before = (3 * s - c - 2 * cone) / (cone - s) ** 2
    before += ((c + cone) * s + (cone - c) * (c + 2 * cone)) / (cone**2 * (cone - c))
    beyond = -(c**2) / (cone**2 * (cone - c) ** 2) * (s - c)
    expected = d * np.where(s <= c, before, beyond)
    x, y, _ = contact_shape(whisker, ours, s)
    chord = np.arctan2(ours.contact_y, ours.contact_x)[0]
    height = y[0] * np.cos(chord) - x[0] * np.sin(chord)
    np.testing.assert_allclose(height, expected, atol=2e-3 * np.abs(expected).max())


def test_cylinder_limit_is_eq_13():
    whisker = replace(mouse_c2(), cone_length=np.inf)
    _, ours = turned_into_pole([2e-3], whisker=whisker)
    # tip deflection F c³/(3EI) against the base tangent = push · c at small angles
    c = ours.contact_arc_length
    np.testing.assert_allclose(
        ours.contact_force * c**2 / (3 * whisker.base_flexural_rigidity), 2e-3, rtol=2e-3
    )


def test_work_of_the_follicle_is_stored_as_bending():
    """Turning the base against the frictionless pole: dE/dα = −M(0), to third order in dα."""
    thin = replace(mouse_c2(), base_radius=1e-8, youngs_modulus=3e9 * 3700.0**4)
    alpha = np.linspace(0.05, 0.7, 401)
    _, ours = turned_into_pole(alpha, whisker=thin, intrinsic_curvature=(15.0, -300.0))
    assert ours.touching.all()
    z, weights = np.polynomial.legendre.leggauss(40)
    c = ours.contact_arc_length[:, None]
    s = c * (z + 1) / 2
    h = 1e-7
    curvature = (
        contact_shape(thin, ours, np.minimum(s + h, c))[2] - contact_shape(thin, ours, s - h)[2]
    ) / (np.minimum(s + h, c) - s + h)
    bend = curvature - (15.0 - 300.0 * s)
    energy = np.sum(thin.flexural_rigidity(s) * bend**2 / 2 * weights * c / 2, axis=1)
    work = -np.concatenate(
        [[0], np.cumsum((ours.base_moment[1:] + ours.base_moment[:-1]) / 2 * np.diff(alpha))]
    )
    np.testing.assert_allclose(energy - energy[0], work, atol=1e-5 * energy.max())


def test_shape_is_in_equilibrium():
    """B(s)(θ' − κ0) = (r_c − r) × F along the loaded part, κ0 beyond; unit speed everywhere."""
    whisker = mouse_c2()
    coefficients = (20.0, -800.0)
    _, ours = turned_into_pole([0.4], intrinsic_curvature=coefficients)
    s = np.linspace(0, whisker.length, 4001)
    x, y, angle = (a[0] for a in contact_shape(whisker, ours, s))
    curvature = np.gradient(angle, s)
    c = ours.contact_arc_length[0]
    normal = np.array([-np.sin(ours.contact_angle[0]), np.cos(ours.contact_angle[0])])
    fx, fy = -ours.contact_force[0] * normal
    moment = np.where(s < c, (ours.contact_x - x) * fy - (ours.contact_y - y) * fx, 0.0)
    expected = coefficients[0] + coefficients[1] * s + moment / whisker.flexural_rigidity(s)
    inner = (np.abs(s - c) > 2e-5) & (s > 1e-5) & (s < whisker.length - 1e-5)
    np.testing.assert_allclose(curvature[inner], expected[inner], atol=0.02)  # 1/m
    np.testing.assert_allclose(np.gradient(x, s)[1:-1], np.cos(angle)[1:-1], atol=1e-5)
    np.testing.assert_allclose(np.gradient(y, s)[1:-1], np.sin(angle)[1:-1], atol=1e-5)
    np.testing.assert_allclose(moment[0], ours.base_moment[0], rtol=1e-10)
    base_t = np.array([np.cos(angle[0]), np.sin(angle[0])])
    np.testing.assert_allclose(base_t @ [fx, fy], ours.axial_force[0], rtol=1e-10)
    np.testing.assert_allclose(base_t[0] * fy - base_t[1] * fx, ours.lateral_force[0], rtol=1e-10)


def test_surfaces_touch_and_do_not_overlap():
    whisker, ours = turned_into_pole([0.05, 0.2, 0.5], side=-1, intrinsic_curvature=(10.0,))
    s = np.linspace(0, whisker.length, 20001)
    x, y, _ = contact_shape(whisker, ours, s)
    gap = np.hypot(x - ours.pole_x[:, None], y - ours.pole_y[:, None])
    gap -= POLE_RADIUS + whisker.radius(s)
    np.testing.assert_allclose(gap.min(axis=1), 0.0, atol=2e-9)  # m; the taper tilts by r' = 2e-3
    np.testing.assert_allclose(s[gap.argmin(axis=1)], ours.contact_arc_length, atol=2e-6)


def test_the_pole_lies_square_to_the_place_of_contact():
    """R + r(c) beside it: what Newton's method leaves, of 2000 contacts of every kind."""
    rng, whisker, n = np.random.default_rng(3), mouse_c2(), 2000
    reach, way, angle = rng.uniform(1e-3, 18e-3, n), rng.uniform(-3, 3, n), rng.uniform(-1, 1, n)
    pole = reach * np.cos(way), reach * np.sin(way), rng.uniform(0, 0.5e-3, n)
    bend = np.stack([rng.uniform(-40, 40, n), rng.uniform(-2e3, 2e3, n)], axis=1)
    ours = solve_contact(
        whisker, (0, 0, way + angle), pole, rng.choice([-1, 1], n), bend, rng.uniform(-0.3, 0.3, n)
    )
    rows = ours.touching
    away = (ours.side * (ours.pole_radius + whisker.radius(ours.contact_arc_length)))[rows]
    turn = ours.contact_angle[rows]
    dx = ours.pole_x[rows] - ours.contact_x[rows] + away * np.sin(turn)
    dy = ours.pole_y[rows] - ours.contact_y[rows] - away * np.cos(turn)
    assert rows.sum() > 300
    assert np.hypot(dx, dy).max() < 1e-11  # m


def test_signs_of_the_conventions():
    """Pole on the left pushes to the right: clockwise moment, force into the face when steep."""
    _, left = turned_into_pole([0.3], side=1)
    _, right = turned_into_pole([0.3], side=-1)
    assert left.base_moment[0] < 0
    assert left.lateral_force[0] < 0
    assert left.axial_force[0] < 0
    for name in ("contact_force", "contact_arc_length", "axial_force"):
        np.testing.assert_allclose(getattr(left, name), getattr(right, name), rtol=1e-12)
    for name in ("base_moment", "lateral_force"):
        np.testing.assert_allclose(getattr(left, name), -getattr(right, name), rtol=1e-12)


@settings(max_examples=25, deadline=None)
@given(
    turn=st.floats(-3, 3),
    dx=st.floats(-0.02, 0.02),
    dy=st.floats(-0.02, 0.02),
    push=st.floats(0.01, 0.5),
)
def test_moves_with_the_camera(turn, dx, dy, push):
    """Turning and shifting everything changes no force."""
    whisker, here = turned_into_pole([push], intrinsic_curvature=(20.0, -500.0))
    cos, sin = np.cos(turn), np.sin(turn)
    px, py = here.pole_x[0], here.pole_y[0]
    there = solve_contact(
        whisker,
        (dx, dy, push + turn),
        (dx + cos * px - sin * py, dy + sin * px + cos * py, POLE_RADIUS),
        1,
        intrinsic_curvature=(20.0, -500.0),
    )
    np.testing.assert_allclose(there.contact_force, here.contact_force, rtol=1e-9)
    np.testing.assert_allclose(there.base_moment, here.base_moment, rtol=1e-9)
    np.testing.assert_allclose(
        there.contact_x, dx + cos * here.contact_x - sin * here.contact_y, atol=1e-11
    )


def test_states():
    whisker = mouse_c2()
    # turned away; touching; pushed past the pole; pole in the follicle's mouth
    ours = solve_contact(
        whisker,
        (0, 0, [-0.1, 0.1, 1.4, 0.1]),
        ([9e-3, 9e-3, 9e-3, 1e-4], [0.3e-3, 0.3e-3, 0.3e-3, 0.0], POLE_RADIUS),
        1,
    )
    assert list(ours.state) == ["free", "contact", "slipped", "unreachable"]
    np.testing.assert_array_equal(ours.touching, [False, True, False, False])
    assert np.all(ours.contact_force[[0, 2, 3]] == 0)
    assert np.all(np.isnan(ours.contact_arc_length[[0, 2, 3]]))
    x, _, angle = contact_shape(whisker, ours, [0, 9e-3])
    np.testing.assert_allclose(angle[[0, 2, 3], 1], [-0.1, 1.4, 0.1])
    np.testing.assert_allclose(x[0, 1], 9e-3 * np.cos(-0.1))


def test_free_starts_where_contact_ends():
    """The force goes to zero continuously at the grazing touch, from the touching side only."""
    _, ours = turned_into_pole(np.linspace(-1e-4, 1e-4, 20))
    np.testing.assert_array_equal(ours.touching, np.arange(20) >= 10)
    assert np.all(np.diff(ours.contact_force[10:]) > 0)
    assert ours.contact_force[10] < 1e-9  # N


def test_beyond_the_tip_is_slipped():
    whisker = mouse_c2()
    ours = solve_contact(whisker, (0, 0, [0.05, -0.5]), (18.3e-3, 0.26e-3, POLE_RADIUS), 1)
    assert list(ours.state) == ["slipped", "free"]


def test_snaps_past_at_the_fold_only():
    """Pushed on and on, the whisker holds, then has slipped, and never holds again."""
    for distance in (7e-3, 9e-3, 11e-3, 13e-3):
        _, ours = turned_into_pole(np.linspace(0.01, 1.2, 120), distance=distance)
        held = ours.touching
        last = np.flatnonzero(held)[-1]
        assert held[: last + 1].all()
        assert set(ours.state[last + 1 :]) == {"slipped"}
        assert np.all(np.diff(ours.contact_arc_length[: last + 1])[-3:] > 0)


def test_friction_turns_the_force():
    _, ours = turned_into_pole([0.3, 0.3, 0.3], friction=[0.0, 0.3, -0.3])
    cos, sin = np.cos(ours.contact_angle), np.sin(ours.contact_angle)
    # base tangent is the lab's direction `base_angle`
    bx, by = np.cos(ours.base_angle), np.sin(ours.base_angle)
    fx = ours.axial_force * bx - ours.lateral_force * by
    fy = ours.axial_force * by + ours.lateral_force * bx
    np.testing.assert_allclose(
        fx * cos + fy * sin, ours.friction * ours.contact_force, rtol=1e-9, atol=1e-18
    )
    np.testing.assert_allclose(fy * cos - fx * sin, -ours.contact_force, rtol=1e-9)


def test_guess_changes_nothing_but_time():
    alpha = np.linspace(-0.1, 0.9, 50)
    _, plain = turned_into_pole(alpha, intrinsic_curvature=(20.0,))
    rng = np.random.default_rng(1)
    guess = (
        plain.contact_arc_length * rng.uniform(0.9, 1.1, 50),
        plain.contact_force * rng.uniform(0.5, 2, 50),
    )
    _, guessed = turned_into_pole(alpha, intrinsic_curvature=(20.0,), guess=guess)
    np.testing.assert_array_equal(plain.state, guessed.state)
    np.testing.assert_allclose(plain.contact_force, guessed.contact_force, rtol=1e-9)


def test_batches_and_curvature_per_frame(monkeypatch):
    monkeypatch.setattr(rod, "_BATCH", 3)
    rows = np.array([[20.0, 0.0], [0.0, 100.0], [-10.0, 5.0], [5.0, 0.0]])
    _, together = turned_into_pole([0.1, 0.2, 0.3, 0.4], intrinsic_curvature=rows)
    for i, push in enumerate((0.1, 0.2, 0.3, 0.4)):
        _, alone = turned_into_pole([push], intrinsic_curvature=rows[i])
        np.testing.assert_allclose(together.contact_force[i], alone.contact_force[0], rtol=1e-9)


def test_free_shape_of_constant_curvature_is_a_circle():
    whisker = mouse_c2()
    s = np.linspace(0, whisker.length, 30)
    x, y, angle = free_shape(whisker, 1e-3, 2e-3, 0.3, s, (40.0,))
    assert x.shape == (30,)
    np.testing.assert_allclose(angle, 0.3 + 40 * s, rtol=1e-14)
    np.testing.assert_allclose(x, 1e-3 + (np.sin(angle) - np.sin(0.3)) / 40, atol=1e-13)
    np.testing.assert_allclose(y, 2e-3 - (np.cos(angle) - np.cos(0.3)) / 40, atol=1e-13)


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"side": 0}, "side must be"),
        ({"pole": (9e-3, 0.0, -1e-3)}, "pole_radius must be >= 0"),
        ({"pole": (np.nan, 0.0, POLE_RADIUS)}, "pole_x must be finite"),
        ({"base": (0.0, 0.0, [[0.1]])}, "base_angle must be a number or"),
        ({"base": ([0.0, 0.0], [0.0, 0.0, 0.0], 0.1)}, "of one length"),
        ({"intrinsic_curvature": [[1.0], [2.0]]}, "intrinsic_curvature must be"),
        ({"guess": ([1.0, 2.0], [1.0, 2.0])}, "guess must be"),
    ],
)
def test_refuses_what_is_not_possible(change, named):
    arguments = {"base": (0.0, 0.0, 0.1), "pole": (9e-3, 0.0, POLE_RADIUS), "side": 1}
    with pytest.raises(ValueError, match=named):
        solve_contact(mouse_c2(), **(arguments | change))


def test_refuses_arc_lengths_off_the_whisker():
    whisker = Whisker(length=10e-3, cone_length=12e-3, base_radius=30e-6)
    with pytest.raises(ValueError, match="arc_length must be within"):
        free_shape(whisker, 0, 0, 0, [0.0, 11e-3])
