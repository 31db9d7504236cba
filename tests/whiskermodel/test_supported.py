"""The contact-consistent model: supported modes, release, and a beam held and let go."""

import numpy as np
import pytest
from scipy.special import roots_legendre

from whiskermodel import SupportedResponse, base_loads, half_gaussian, mouse_c2, ramp_and_hold
from whiskermodel.modes import modes, supported_modes
from whiskermodel.whisker import Whisker

DT = 1e-5  # s


@pytest.mark.parametrize("boundary", ["fixed", "pinned", 2.0])
def test_supported_modes_are_orthonormal_and_held(boundary):
    some = supported_modes(0.95, 0.6, boundary, 8)
    np.testing.assert_allclose(some.shape(np.array([0.0, 0.6])), 0, atol=1e-10)
    nodes, weights = roots_legendre(80)
    x = np.concatenate([0.3 * (nodes + 1), 0.6 + 0.2 * (nodes + 1)])
    w = np.concatenate([0.3 * weights, 0.2 * weights]) * (1 - 0.95 * x) ** 2
    np.testing.assert_allclose((some.shape(x) * w) @ some.shape(x).T, np.eye(8), atol=1e-9)
    assert (some.p_prime > 0).all()


@pytest.mark.parametrize("share", [0.2, 0.8])
def test_free_modes_take_over_what_the_supported_ones_are(share):
    """∫ φ ψ (1 − λx)² dx, by Gauss on either side of the support, where the shear steps."""
    whisker = mouse_c2()
    both = SupportedResponse(whisker, share * whisker.length)
    nodes, weights = roots_legendre(80)
    x = np.concatenate([share / 2 * (nodes + 1), share + (1 - share) / 2 * (nodes + 1)])
    w = np.concatenate([share / 2 * weights, (1 - share) / 2 * weights])
    free, held = both.free.modes.shape(x), both.held.modes.shape(x)
    expected = (free * w * (1 - whisker.taper * x) ** 2) @ held.T
    np.testing.assert_allclose(both._overlap(), expected, atol=1e-10)


def test_times_are_those_of_the_samples():
    time = np.arange(0, 8e-3, DT)
    force = half_gaussian(time, 5e-3, 1e-6)
    both = SupportedResponse(mouse_c2(), 9e-3)
    np.testing.assert_allclose(both.loads(force, DT).time, time)
    np.testing.assert_allclose(both.displacement(force, DT, np.array([9e-3])).time, time)


def test_supported_cylinder_is_the_textbook_beam():
    """Clamped and supported at the far end: k tan … = tanh …, k₁L = 3.9266 (support → tip)."""
    some = supported_modes(0.0, 1 - 1e-9, "fixed", 2)
    np.testing.assert_allclose(np.sqrt(some.p_prime), [3.926602, 7.068583], rtol=1e-6)


def test_a_support_raises_every_frequency():
    free, held = modes(0.95, "fixed", 7).p_prime, supported_modes(0.95, 0.5, "fixed", 6).p_prime
    assert (held >= free[:6]).all()  # Rayleigh: and interlaced
    assert (held <= free[1:]).all()


def test_against_a_finite_element_beam_held_and_released(finite_element_beam):
    """Base moment to 2 % of its peak, during the contact and after it."""
    whisker, c, dt = mouse_c2(), 11e-3, 2e-6  # Newmark's rule needs the small step
    time = np.arange(0, 14e-3, dt)
    force = ramp_and_hold(time, 2e-3, 2e-6, hold_duration=0.5e-3)
    force[time >= 4.5e-3 - dt / 2] = 0.0
    response = SupportedResponse(whisker, c, n_modes=24)
    loads = response.loads(force, dt)
    angle = response.free.steady_angle_per_newton(c) * force
    beam = finite_element_beam(whisker, node=c)
    moment, _, _, tip = beam.run(c, 0 * force, dt, angle, held_until=loads.release)
    y = response.displacement(force, dt, np.array([whisker.length])).total[0]
    assert np.abs(loads.moment - moment).max() < 0.02 * np.abs(moment).max()
    assert np.abs(y - tip).max() < 0.02 * np.abs(tip).max()


@pytest.mark.parametrize("boundary", ["fixed", "pinned", 1e-6])
def test_displacement_and_velocity_are_carried_over(boundary):
    response = SupportedResponse(mouse_c2(), 12e-3, boundary, n_modes=30)
    force = half_gaussian(np.arange(0, 20e-3, 2e-6), 5e-3, 2e-6)
    release = response.loads(force, 2e-6).release
    x = np.linspace(0, 18e-3, 37)
    y = response.displacement(force, 2e-6, x).total
    scale = np.abs(y).max()
    assert np.abs(np.diff(y[:, release - 1 : release + 3], axis=1)).max() < 0.01 * scale
    before, after = (np.diff(y[:, r : r + 2], axis=1)[:, 0] for r in (release - 1, release + 1))
    # in the mean over the whisker: fronts of high modes pass within a step
    mass = (1 - 0.95 * x / 18e-3) ** 2
    assert (mass * (before - after) ** 2).sum() < 0.02 * (mass * before**2).sum()


def test_the_poles_force_balances_angular_momentum():
    """M(0) = −c F − ∫x ρA (ÿ + 2d ẏ) dx about the base, F the pole's, by differences."""
    whisker, c, dt = mouse_c2(), 9e-3, 2e-6
    force = ramp_and_hold(np.arange(0, 12e-3, dt), 4e-3, 1e-6)
    response = SupportedResponse(whisker, c, n_modes=30)
    nodes, weights = roots_legendre(60)
    x, w = whisker.length * (nodes + 1) / 2, whisker.length * weights / 2
    lever = w * x * whisker.density * np.pi * whisker.radius(x) ** 2
    y = response.displacement(force, dt, x).total
    momentum = lever @ np.gradient(y, dt, axis=1)
    loads = response.loads(force, dt)
    turning = np.gradient(momentum, dt) + 2 * whisker.damping_rate * momentum
    expected = -(loads.moment + turning) / c
    assert np.abs(loads.pole_force - expected)[5:-5].max() < 1e-3 * force.max()
    assert np.abs(loads.pole_force - force).max() > 0.05 * force.max()


def test_the_pole_holds_the_whisker_and_lets_go():
    response = SupportedResponse(mouse_c2(), 9e-3)
    force = half_gaussian(np.arange(0, 30e-3, DT), 12e-3, 10e-6)
    loads = response.loads(force, DT)
    y = response.displacement(force, DT, np.array([9e-3])).total[0]
    assert np.abs(y[: loads.release]).max() < 1e-12  # m
    assert np.abs(y[loads.release + 10 :]).max() > 1e-6  # m
    assert (loads.pole_force[loads.release :] == 0).all()
    # vibration apart, it is the quasi-static force: the same impulse within a few per cent
    assert loads.pole_force.sum() == pytest.approx(force.sum(), rel=0.03)


def test_pole_force_balances_the_moments_about_the_base():
    """c F_pole = −M(0) − ∫ρA x (ÿ + 2dẏ) dx while the contact lasts; slow enough to resolve."""
    whisker, c, dt = Whisker(18e-3, 19e-3, 37e-6), 9e-3, 4e-6
    force = ramp_and_hold(np.arange(0, 12e-3, dt), 5e-3, 1e-6, hold_duration=5e-3)
    response = SupportedResponse(whisker, c, "fixed", n_modes=20)
    loads = response.loads(force, dt)
    nodes, weights = roots_legendre(80)
    x, w = whisker.length * (nodes + 1) / 2, whisker.length * weights / 2
    y = response.displacement(force, dt, x).total
    angular = (w * x * whisker.density * np.pi * whisker.radius(x) ** 2) @ y
    rate = np.gradient(angular, dt)
    expected = -loads.moment - np.gradient(rate, dt) - 2 * whisker.damping_rate * rate
    inner = slice(20, loads.release - 20)
    assert np.abs(c * loads.pole_force - expected)[inner].max() < 0.02 * c * 1e-6


def test_it_agrees_with_the_papers_model_where_vibration_is_small():
    force = half_gaussian(np.arange(0, 60e-3, DT), 12e-3, 10e-6)
    paper = base_loads(mouse_c2(), 6e-3, force, DT)
    held = SupportedResponse(mouse_c2(), 6e-3).loads(force, DT)
    np.testing.assert_array_equal(paper.steady_moment, held.steady_moment)
    peak = np.abs(paper.steady_moment).max()
    assert np.abs(held.vibrational_moment).max() < 0.05 * peak
    assert np.abs(paper.moment - held.moment).max() < 0.08 * peak


@pytest.mark.parametrize(
    ("force", "message"),
    [
        ([0, 1e-6, 0, 1e-6, 0], "force must be one contact, .* zero at sample 2"),
        ([0, 0, 0], "force must hold a contact"),
        ([0, np.nan, 0], "force must be finite"),
        ([[0, 1e-6, 0]], "force must be one row"),
    ],
)
def test_impossible_forces_are_named(force, message):
    with pytest.raises(ValueError, match=message):
        SupportedResponse(mouse_c2(), 9e-3).loads(force, 1e-3)


def test_impossible_supports_are_named():
    with pytest.raises(ValueError, match=r"support must lie in 0–1 .* got 1\.0"):
        supported_modes(0.95, 1.0)
    with pytest.raises(ValueError, match="contact_arc_length must lie between"):
        SupportedResponse(mouse_c2(), 18e-3)


@pytest.mark.parametrize("boundary", ["fixed", "pinned"])
def test_finer_samples_of_the_same_force_give_the_same_loads(boundary):
    """A force linear between coarse samples: release and all that follows are the same."""
    coarse = np.interp(np.arange(60), [0, 7, 15, 20, 59], [0, 4e-6, 4e-6, 0, 0])
    fine = np.interp(np.arange(4 * 59 + 1) / 4, np.arange(60), coarse)
    response = SupportedResponse(mouse_c2(), 9e-3, boundary)
    here, there = response.loads(coarse, DT), response.loads(fine, DT / 4)
    assert (here.release, there.release) == (20, 80)
    inside = np.arange(60) != here.release  # where the pole lets go its force jumps
    np.testing.assert_allclose(here.pole_force[inside], there.pole_force[::4][inside], atol=1e-12)
    size = np.abs(here.steady_moment).max()
    np.testing.assert_allclose(here.moment, there.moment[::4], atol=1e-6 * size)
