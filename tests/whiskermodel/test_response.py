"""The dynamic response: against the paper's integrals, a beam in time steps, and sum rules."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.special import roots_legendre

from whiskermodel import (
    Response,
    Whisker,
    base_loads,
    half_gaussian,
    mouse_c2,
    ramp_and_hold,
    rat_c2,
    stick_slip,
)
from whiskermodel.modal_filter import modal_filters
from whiskermodel.statics import FRAMES

DT = 1e-5  # s, the paper's time step


# The integrals I_k -----------------------------------------------------------------------


def impulse_response(p, d, t):
    """h(t) of Eqs 49–51."""
    if p > d:
        rate = np.sqrt(p**2 - d**2)
        return np.exp(-d * t) * np.sin(rate * t) / rate
    if p == d:
        return t * np.exp(-d * t)
    root = np.sqrt(d**2 - p**2)
    return (np.exp((root - d) * t) - np.exp(-(root + d) * t)) / (2 * root)


def papers_integral(p, d, duration, t):
    """Eqs 49–51 for the unit half-Gaussian by quadrature, with F'''s impulses at its kinks."""
    half, width = duration / 2, duration / 2 / np.sqrt(np.log(2))

    def bell(tau):
        return 2 * np.exp(-(((tau - half) / width) ** 2))

    def slope(tau):
        return -2 * (tau - half) / width**2 * bell(tau)

    def drive(tau):
        second = (4 * (tau - half) ** 2 / width**4 - 2 / width**2) * bell(tau)
        return impulse_response(p, d, t - tau) * (second + 2 * d * slope(tau))

    end = min(t, duration)
    smooth, _ = quad(drive, 0, end, epsabs=1e-12, epsrel=1e-11, limit=2000)
    kinks = slope(0.0) * impulse_response(p, d, t)
    if t > duration:
        kinks -= slope(duration) * impulse_response(p, d, t - duration)
    return smooth + kinks


@pytest.mark.parametrize(
    ("p", "d"),
    [(900.0, 215.0), (5000.0, 215.0), (215.0, 215.0), (150.0, 215.0), (40.0, 2000.0)],
    ids=["under", "fast", "critical", "over", "far over"],
)
def test_derivative_free_form_is_the_papers_integral(p, d):
    duration, dt = 12e-3, 2e-6
    force = half_gaussian(np.arange(0, 30e-3, dt), duration, 1.0)
    (recursion,) = modal_filters(np.array([p]), d, dt)
    integral = force - recursion(force)
    for t in (1e-3, 5e-3, 11e-3, 12.5e-3, 25e-3):
        expected = papers_integral(p, d, duration, t)
        assert integral[round(t / dt)] == pytest.approx(expected, abs=2e-7)  # of the peak force


@settings(max_examples=30, deadline=None)
@given(
    st.lists(st.floats(-1, 1), min_size=2, max_size=6),
    st.floats(30.0, 3e4),
    st.sampled_from([0.0, 215.0, 900.0, 3000.0]),
)
def test_recursion_is_exact_between_any_samples(knots, p, d):
    """The same polygon of force sampled at 1 ms and at 10 µs."""
    coarse = np.array(knots)
    time = np.arange(100 * (len(coarse) - 1) + 1) * 1e-5
    fine = np.interp(time, np.arange(len(coarse)) * 1e-3, coarse)
    (slow,), (quick,) = (modal_filters(np.array([p]), d, dt) for dt in (1e-3, 1e-5))
    for state in (0, 1):
        scale = np.abs(coarse).max() + 1e-12
        difference = slow(coarse, state) - quick(fine, state)[::100]
        assert np.abs(difference).max() < 1e-8 * scale


def test_first_sample_is_a_step():
    p, d, dt = 900.0, 215.0, 1e-5
    (recursion,) = modal_filters(np.array([p]), d, dt)
    t = np.arange(2000) * dt
    rate = np.sqrt(p**2 - d**2)
    step = 1 - np.exp(-d * t) * (np.cos(rate * t) + d / rate * np.sin(rate * t))
    np.testing.assert_allclose(recursion(np.ones(2000)), step, atol=1e-9)
    speed = p * np.exp(-d * t) * np.sin(rate * t) / rate
    np.testing.assert_allclose(recursion(np.ones(2000), state=1), speed, atol=1e-9)


# Against a beam of finite elements, integrated in time -------------------------------------


@pytest.mark.parametrize("boundary", ["fixed", "compliant"])
def test_clamped_frame_against_finite_elements(boundary, finite_element_beam):
    """A half-Gaussian with its kinks: moment, shear, base angle and tip, against their peaks."""
    whisker, c, dt = mouse_c2(), 12e-3, 4e-6
    force = half_gaussian(np.arange(0, 16e-3, dt), 5e-3, 2.5e-6)
    spring = None if boundary == "fixed" else 3 * whisker.base_flexural_rigidity / 18e-3
    moment, shear, angle, tip = finite_element_beam(whisker).run(c, force, dt, spring=spring)
    response = Response(whisker, "fixed" if spring is None else spring, "clamped", n_modes=30)
    loads = response.base_loads(c, force, dt)
    y = response.displacement(c, force, dt, np.array([whisker.length])).total[0]
    pairs = [(loads.moment, moment, 0.01), (loads.shear, shear, 0.03), (y, tip, 0.01)]
    if spring is not None:
        pairs = [pairs[0], pairs[2], (loads.angle, angle, 0.01)]
    for ours, expected, tolerance in pairs:
        assert np.abs(ours - expected).max() < tolerance * np.abs(expected).max()


def test_chord_frame_against_finite_elements(finite_element_beam):
    """The base turns as the force rises; smoothly, to need no infinite acceleration."""
    whisker, c, dt = mouse_c2(), 12e-3, 4e-6
    time = np.arange(0, 16e-3, dt)
    force = ramp_and_hold(time, 2e-3, 2.5e-6, hold_duration=1e-3)
    response = Response(whisker, "fixed", "chord", n_modes=30)
    angle = response.steady_angle_per_newton(c) * force
    moment, _, _, tip = finite_element_beam(whisker).run(c, force, dt, angle=angle)
    loads = response.base_loads(c, force, dt)
    y = response.displacement(c, force, dt, np.array([whisker.length])).total[0]
    assert np.abs(loads.moment - moment).max() < 0.01 * np.abs(moment).max()
    assert np.abs(y - tip).max() < 0.01 * np.abs(tip).max()


# Published and independently computed ratios ------------------------------------------------

# peak vibrational over peak steady base moment (+, −): fixed end, chord frame, 10 modes
FIGURE_7 = {6: (0.045, 0.042), 9: (0.076, 0.084), 12: (0.126, 0.223), 15: (0.499, 0.665)}
FIGURE_8 = {2.5: (1.425, 1.123), 5: (0.608, 0.542), 10: (0.183, 0.269), 20: (0.077, 0.133)}
GIVEN_TO = 0.001  # ratio: the table has three decimals


@pytest.mark.parametrize(
    ("c_mm", "duration_ms", "expected"),
    [(c, 12, value) for c, value in FIGURE_7.items()]
    + [(12, duration, value) for duration, value in FIGURE_8.items()],
)
def test_ratios_of_figures_7_and_8(c_mm, duration_ms, expected):
    force = half_gaussian(np.arange(0, 80e-3, DT), duration_ms * 1e-3, 1e-6)
    ratios = base_loads(mouse_c2(), c_mm * 1e-3, force, DT).vibration_extremes()
    expected = np.array([expected[0], -expected[1]])
    assert np.abs(ratios - expected).max() < GIVEN_TO
    assert (np.abs(ratios / expected - 1) < 0.02).all()


# Laws ---------------------------------------------------------------------------------------


@pytest.mark.slow
@settings(max_examples=20, deadline=None)
@given(st.floats(0.3, 0.99), st.floats(0.1, 0.8), st.sampled_from(["fixed", 0.5, 20.0]))
def test_vibrational_moments_sum_to_the_static_moment_in_the_clamped_frame(taper, c, boundary):
    """Σ P_k φ_k''(0) → −c L²/(E I0)."""
    whisker = Whisker(18e-3, 18e-3 / taper, 37e-6)
    rigidity = whisker.base_flexural_rigidity
    boundary = boundary if boundary == "fixed" else boundary * rigidity / whisker.length
    c = c * whisker.length
    response = Response(whisker, boundary, "clamped", n_modes=60)
    terms = response.participation(c) * response.modes.at_base(2)
    expected = -c * whisker.length**2 / rigidity
    # partial sums swing about their limit; their running mean settles
    assert np.cumsum(terms)[30:].mean() == pytest.approx(expected, rel=0.01)


def test_in_the_chord_frame_that_sum_diverges():
    response = Response(mouse_c2(), n_modes=60)
    partial = np.cumsum(response.participation(9e-3) * response.modes.at_base(2))
    assert abs(partial[59]) > 1.8 * abs(partial[29])


@pytest.mark.parametrize("boundary", ["fixed", "pinned", 1e-7])
def test_participation_by_parts_is_equation_54(boundary):
    c = np.array([2e-3, 9e-3, 17e-3])
    for frame in ("chord", "clamped") if boundary != "pinned" else ("chord",):
        response = Response(mouse_c2(), boundary, frame)
        expected = response.participation_by_quadrature(c)
        error = np.abs(response.participation(c) - expected).max()
        assert error < 1e-9 * np.abs(expected).max()


@pytest.mark.parametrize("boundary", ["fixed", "pinned", 1e-6])
def test_free_ringing_decays_at_twice_the_damping_rate(boundary):
    whisker = mouse_c2()
    response = Response(whisker, boundary, n_modes=6)
    time = np.arange(0, 40e-3, DT)
    force = half_gaussian(time, 5e-3, 1e-6)
    eta, rate = response.amplitudes(9e-3, force, DT), response.amplitude_rates(9e-3, force, DT)
    p, d = response.angular_frequency[:, None], whisker.damping_rate
    free = time > 5.1e-3
    # (η' + dη)² + (p² − d²) η² falls by e^(−2dt) exactly, the energy on average over a cycle
    invariant = (rate + d * eta) ** 2 + (p**2 - d**2) * eta**2
    ringing = response.angular_frequency > 0
    scaled = (invariant * np.exp(2 * d * time))[ringing][:, free]
    np.testing.assert_allclose(scaled / scaled[:, :1], 1, rtol=1e-6)
    energy = (rate**2 + p**2 * eta**2)[ringing].sum(axis=0)[free]
    slope = np.polyfit(time[free], np.log(energy), 1)[0]
    assert slope == pytest.approx(-2 * d, rel=0.02)


def test_amplitude_rate_is_the_derivative():
    response = Response(mouse_c2())
    force = half_gaussian(np.arange(0, 20e-3, 1e-6), 5e-3, 1e-6)
    eta = response.amplitudes(9e-3, force, 1e-6)[:, 6000:]
    rate = response.amplitude_rates(9e-3, force, 1e-6)[:, 6000:]
    numeric = np.gradient(eta, 1e-6, axis=1)[:, 1:-1]
    assert np.abs(rate[:, 1:-1] - numeric).max() < 1e-3 * np.abs(rate).max()


@settings(max_examples=15, deadline=None)
@given(
    st.lists(st.floats(-2e-5, 2e-5), min_size=3, max_size=8),
    st.sampled_from(["fixed", "pinned", 1e-6]),
    st.sampled_from([2, 10, 37]),
)
def test_response_does_not_depend_on_the_sampling_step(samples, boundary, factor):
    response = Response(mouse_c2(), boundary)
    coarse = response.base_loads(11e-3, samples, 1e-3)
    fine = response.base_loads(11e-3, samples, 1e-3, substeps=factor)
    np.testing.assert_allclose(coarse.time, np.arange(len(samples)) * 1e-3)  # s
    np.testing.assert_allclose(fine.time[::factor], coarse.time, rtol=1e-12)
    scale = np.abs(samples).max() + 1e-12
    for part, unit in (("moment", 11e-3), ("shear", 1.0), ("angle", 1e4)):
        difference = getattr(coarse, part) - getattr(fine, part)[::factor]
        assert np.abs(difference).max() < 1e-6 * unit * scale


def test_a_slow_force_leaves_no_vibration():
    time = np.arange(0, 3.0, 1e-4)
    force = 10e-6 * np.sin(np.pi * time / 3.0) ** 2
    for boundary in ("fixed", 1e-6):
        loads = base_loads(mouse_c2(), 9e-3, force, 1e-4, boundary=boundary)
        assert np.abs(loads.vibration_extremes()).max() < 1e-3


def test_static_parts_are_equations_57_and_59():
    whisker, c = mouse_c2(), 9e-3
    loads = base_loads(whisker, c, np.linspace(0, 1e-6, 50), 1e-3)
    np.testing.assert_allclose(loads.steady_moment, -c * loads.force)
    np.testing.assert_allclose(loads.steady_shear, loads.force)
    np.testing.assert_allclose(
        loads.steady_paper_shear, (1 - 4 * c / whisker.cone_length) * loads.force
    )


def test_true_shear_balances_momentum():
    """Shear at the base = F + ∫ρA (ÿ + 2d ẏ) dx in the clamped frame, by differences."""
    whisker, c, dt = mouse_c2(), 9e-3, 2e-6
    time = np.arange(0, 12e-3, dt)
    force = ramp_and_hold(time, 4e-3, 1e-6)
    response = Response(whisker, "fixed", "clamped", n_modes=30)
    nodes, weights = roots_legendre(60)
    x, w = whisker.length * (nodes + 1) / 2, whisker.length * weights / 2
    density = whisker.density * np.pi * whisker.radius(x) ** 2
    y = response.displacement(c, force, dt, x).total
    momentum = (w * density) @ np.gradient(y, dt, axis=1)
    expected = force + np.gradient(momentum, dt) + 2 * whisker.damping_rate * momentum
    shear = response.base_loads(c, force, dt).shear
    assert np.abs(shear - expected)[5:-5].max() < 0.01 * force.max()


def test_pinned_base_bears_no_moment_and_rotates_in_the_chord_frame():
    force = half_gaussian(np.arange(0, 40e-3, DT), 12e-3, 1e-6)
    loads = base_loads(mouse_c2(), 9e-3, force, DT, boundary="pinned")
    assert (loads.vibrational_moment == 0).all()
    assert np.abs(loads.vibrational_angle).max() > 0
    fixed = base_loads(mouse_c2(), 9e-3, force, DT)
    assert (fixed.vibrational_angle == 0).all()


def test_compliant_follicle_lies_between_its_limits():
    force = half_gaussian(np.arange(0, 40e-3, DT), 5e-3, 1e-6)
    whisker = mouse_c2()

    def moment(boundary):
        return base_loads(whisker, 11e-3, force, DT, boundary=boundary).vibrational_moment

    unit = whisker.base_flexural_rigidity / whisker.length
    stiff, fixed, soft = moment(1e7 * unit), moment("fixed"), moment(1e-7 * unit)
    assert np.abs(stiff - fixed).max() < 1e-5 * np.abs(fixed).max()
    assert np.abs(soft).max() < 1e-3 * np.abs(fixed).max()
    loads = base_loads(whisker, 11e-3, force, DT, boundary=2 * unit)
    spring = 2 * unit * loads.vibrational_angle
    assert np.abs(loads.vibrational_moment - spring).max() < 1e-6 * np.abs(spring).max()


def test_the_frames_differ_by_an_order_of_magnitude_for_a_slip():
    force = stick_slip(np.arange(0, 60e-3, DT), slip_duration=0.25e-3)
    chord, clamped = (base_loads(rat_c2(), 32e-3, force, DT, frame=f) for f in FRAMES)
    np.testing.assert_array_equal(chord.steady_moment, clamped.steady_moment)
    assert np.ptp(chord.vibrational_moment) > 10 * np.ptp(clamped.vibrational_moment)


# Many forces at once ------------------------------------------------------------------------


def test_many_forces_and_contacts_are_one_call():
    time = np.arange(0, 20e-3, DT)
    c = np.array([[6e-3], [9e-3]])
    force = half_gaussian(time, [3e-3, 5e-3, 8e-3], 1e-6)
    response = Response(mouse_c2(), 1e-6)
    many = response.base_loads(c, force, DT)
    assert many.vibrational_moment.shape == (2, 3, len(time))
    for i in range(2):
        for j in range(3):
            one = response.base_loads(c[i, 0], force[j], DT)
            for part in ("vibrational_moment", "vibrational_angle", "shear", "steady_moment"):
                expected = getattr(one, part)
                np.testing.assert_allclose(
                    getattr(many, part)[i, j], expected, rtol=1e-9, atol=1e-16
                )
    assert many.vibration_extremes().shape == (2, 2, 3)


def test_displacement_vanishes_at_the_contact_in_the_static_part():
    response = Response(mouse_c2())
    time = np.arange(0, 20e-3, DT)
    force = half_gaussian(time, 12e-3, 20e-6)
    y = response.displacement(9e-3, force, DT, np.array([0.0, 9e-3, 18e-3]))
    np.testing.assert_allclose(y.time, time)
    assert y.steady.shape == (3, len(force))
    assert np.abs(y.steady[:2]).max() < 1e-12  # m
    assert np.abs(y.vibrational[0]).max() < 1e-12  # m
    np.testing.assert_allclose(y.total, y.steady + y.vibrational)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            {"contact_arc_length": 18e-3},
            r"contact_arc_length must lie between 0 and .* got 0\.018",
        ),
        ({"force": [0.0, np.nan, 1e-6]}, r"force must be finite everywhere, got .*nan.* \(1,\)"),
        ({"force": []}, "force must have at least one sample"),
        ({"dt": 0.0}, r"dt must be > 0 s, got 0\.0 s"),
        ({"substeps": 0}, "substeps must be a whole number >= 1, got 0"),
        ({"n_modes": 0}, "n_modes must be a whole number >= 1, got 0"),
        ({"frame": "lab"}, "frame must be one of chord, clamped, got 'lab'"),
        ({"boundary": "pinned", "frame": "clamped"}, "frame 'clamped' needs .* got 'pinned'"),
        ({"contact_arc_length": [1e-3, 2e-3, 3e-3], "force": np.zeros((2, 4))}, "one per force"),
    ],
)
def test_impossible_arguments_are_named(arguments, message):
    usual = {"contact_arc_length": 9e-3, "force": np.zeros(10), "dt": 1e-3}
    with pytest.raises(ValueError, match=message):
        base_loads(mouse_c2(), **(usual | arguments))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"base_radius": -37e-6}, "base_radius must be positive and finite, got -3.7e-05"),
        ({"cone_length": 17e-3}, "cone_length must be at least the length .*taper.* 0–1"),
        ({"damping_rate": -1.0}, "damping_rate must be finite and >= 0, got -1.0"),
    ],
)
def test_impossible_whiskers_are_named(change, message):
    usual = {"length": 18e-3, "cone_length": 19e-3, "base_radius": 37e-6}
    with pytest.raises(ValueError, match=message):
        Whisker(**(usual | change))
