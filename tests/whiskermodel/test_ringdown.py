"""Ring-down fits: generated decays recovered, intervals that cover, published values of Fig. 5."""

import contextlib

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import curve_fit
from scipy.stats import t as student

from whiskermodel import Response, Whisker, half_gaussian, mouse_c2
from whiskermodel.ringdown import Estimate, fit_ringdown, youngs_modulus

TIME = np.arange(0, 25e-3, 1e-3)  # s, frames after a slip at 1000 frames/s
DAMPING, FREQUENCY = 215.0, 938.0  # 1/s, rad/s: the paper's means


def decay(time, d=DAMPING, p=FREQUENCY, amplitude=1.0, phase=0.6, offset=0.0):
    return amplitude * np.sin(p * time + phase) * np.exp(-d * time) + offset


@settings(max_examples=60, deadline=None)
@given(
    st.floats(20, 500), st.floats(400, 2500), st.floats(-3, 3), st.floats(1e-6, 1e6), st.booleans()
)
def test_noiseless_decay_is_recovered(d, p, phase, amplitude, with_offset):
    offset = 0.2 * amplitude * with_offset
    signal = decay(TIME, d, p, amplitude, phase, offset)
    fit = fit_ringdown(TIME + 3.7, signal, with_offset)
    assert fit.damping_rate.value == pytest.approx(d, rel=1e-5)
    assert fit.angular_frequency.value == pytest.approx(p, rel=1e-6)
    assert fit.undamped_angular_frequency.value == pytest.approx(np.hypot(p, d), rel=1e-6)
    assert fit.amplitude.value == pytest.approx(amplitude, rel=1e-5)
    assert np.cos(fit.phase.value - phase) == pytest.approx(1, abs=1e-6)
    if not with_offset:
        assert fit.offset == Estimate(0.0, 0.0, 0.0)
    np.testing.assert_allclose(fit(TIME + 3.7), signal, atol=1e-5 * amplitude)


@pytest.mark.parametrize(("d", "p"), [(20.0, 0.95 * np.pi * 1e3), (60.0, 2000.0), (300.0, 130.0)])
def test_swings_are_found_up_to_half_the_sampling_rate(d, p):
    """In 120 ms, of up to 180 swings, or of less than one that is left over."""
    time = np.arange(0, 120e-3, 1e-3)
    fit = fit_ringdown(time, decay(time, d, p))
    assert fit.angular_frequency.value == pytest.approx(p, rel=1e-6)
    assert fit.damping_rate.value == pytest.approx(d, rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("with_offset", [False, True])
def test_intervals_cover_as_often_as_they_say(with_offset):
    """95 % intervals of 500 noisy decays: 95 ± 3 % hold the truth (3 binomial standard errors)."""
    rng = np.random.default_rng(1)
    truth = {
        "damping_rate": DAMPING,
        "angular_frequency": FREQUENCY,
        "undamped_angular_frequency": np.hypot(DAMPING, FREQUENCY),
        "amplitude": 1.0,
        "phase": 0.6,
    }
    if with_offset:
        truth["offset"] = 0.1
    clean = decay(TIME, offset=0.1 * with_offset)
    fits = [
        fit_ringdown(TIME, clean + rng.normal(0, 0.04, len(TIME)), with_offset) for _ in range(500)
    ]
    for name, value in truth.items():
        covered = np.mean([getattr(f, name).low < value < getattr(f, name).high for f in fits])
        assert abs(covered - 0.95) < 0.03, name
    assert np.mean([f.residual_sd for f in fits]) == pytest.approx(0.04, rel=0.05)


def test_interval_of_youngs_modulus_is_twice_the_frequencys_and_the_geometrys():
    """E goes with p² L⁴/r0²; errors of 1 % and less, so that first order is enough."""
    cone, p = Whisker(17e-3, 18e-3, 37e-6), Estimate(940.0, 940.0 * 0.995, 940.0 * 1.01)
    bare = youngs_modulus(p, cone)
    assert bare.low / bare.value == pytest.approx(1 - 2 * 0.005)
    assert bare.high / bare.value == pytest.approx(1 + 2 * 0.01)
    sure = Estimate(940.0, 940.0, 940.0)
    for errors, relative in (({"length_se": 17e-6}, 4e-3), ({"base_radius_se": 37e-9}, 2e-3)):
        wide = youngs_modulus(sure, cone, **errors)
        assert wide.high / wide.value == pytest.approx(1 + 1.96 * relative, abs=1e-6)
        assert wide.low / wide.value == pytest.approx(1 - 1.96 * relative, abs=1e-6)


def test_published_youngs_modulus():
    """E = 3.03 GPa as published; 3.05 with the undamped frequency, 2.90 without; λ = 1."""
    cone = Whisker(17.14e-3, 17.14e-3, 37.15e-6, density=1000.0)
    undamped, damped = (Estimate(p, p, p) for p in (np.hypot(FREQUENCY, DAMPING), FREQUENCY))
    rounded = 0.006  # GPa; given to two decimals, from p'/2 to three
    assert youngs_modulus(undamped, cone).value / 1e9 == pytest.approx(3.05, abs=rounded)
    assert youngs_modulus(damped, cone).value / 1e9 == pytest.approx(2.90, abs=rounded)
    assert youngs_modulus(undamped, cone).value / 1e9 == pytest.approx(3.03, rel=0.01)


def test_modulus_from_the_models_own_ringing():
    """The late ringing of a simulated contact, in which only the first mode is left."""
    whisker, dt = mouse_c2(), 1e-5
    force = half_gaussian(np.arange(0, 60e-3, dt), 5e-3, 1e-6)
    moment = Response(whisker, n_modes=1).base_loads(9e-3, force, dt).vibrational_moment
    time = np.arange(600, 3600, 100)
    fit = fit_ringdown(time * dt, moment[time])
    assert fit.damping_rate.value == pytest.approx(whisker.damping_rate, rel=1e-4)
    assert youngs_modulus(fit, whisker).value == pytest.approx(whisker.youngs_modulus, rel=1e-4)
    pinned = youngs_modulus(fit, whisker, "pinned").value
    assert pinned < whisker.youngs_modulus  # its first swing is faster, so E would be less


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("with_offset", [False, True])
def test_what_hardly_swings_has_wide_intervals_not_none(seed, with_offset):
    """Pure decays and straight lines: frequency and phase mean nothing; some find no fit."""
    rng = np.random.default_rng(seed)
    still = rng.choice([np.exp(-rng.uniform(50, 2000) * TIME), 1 + rng.uniform(-20, 20) * TIME])
    with contextlib.suppress(ValueError):
        fit = fit_ringdown(TIME, still, with_offset)
        assert_intervals_hold_their_values(fit)


def assert_intervals_hold_their_values(fit):
    for name in ("damping_rate", "angular_frequency", "amplitude", "phase", "offset"):
        estimate = getattr(fit, name)
        assert np.isfinite([estimate.value, estimate.low, estimate.high]).all(), name
        assert estimate.low <= estimate.value <= estimate.high


def test_the_sign_of_a_frequency_means_nothing():
    signal = decay(TIME) + np.random.default_rng(5).normal(0, 0.02, len(TIME))
    ahead, back = (
        fit_ringdown(TIME, signal, frequency_range=r) for r in ((800, 1100), (-1100, -800))
    )
    for name in ("damping_rate", "angular_frequency", "undamped_angular_frequency", "phase"):
        one, other = getattr(ahead, name), getattr(back, name)
        expected = [one.value, one.low, one.high]
        np.testing.assert_allclose([other.value, other.low, other.high], expected, rtol=1e-5)


def test_geometry_widens_the_interval():
    frequency = Estimate(960.0, 940.0, 980.0)
    narrow = youngs_modulus(frequency, mouse_c2())
    wide = youngs_modulus(frequency, mouse_c2(), length_se=0.2e-3, base_radius_se=0.5e-6)
    half = wide.value * 1.96 * np.hypot(4 * 0.2 / 18, 2 * 0.5 / 37)
    assert wide.value == narrow.value
    expected = np.hypot(half, narrow.high - narrow.value)
    assert wide.high - wide.value == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize(
    ("time", "signal", "message"),
    [
        (TIME[:5], TIME[:5], "one length >= 6, got shapes \\(5,\\)"),
        (TIME, TIME[:-1], "one length"),
        (TIME[::-1], TIME, "time must ascend"),
        (TIME, np.full(25, np.nan), "signal must be finite"),
        (TIME, np.zeros(25), "signal must swing"),
    ],
)
def test_impossible_arguments_are_named(time, signal, message):
    with pytest.raises(ValueError, match=message):
        fit_ringdown(time, signal)


OVERTONES = (2.4635, 4.6249)  # of a fixed-end cone of taper 0.95


def with_overtones(time, d=DAMPING, p=FREQUENCY, parts=((0.5, 0.3), (-0.4, 1.1))):
    out = decay(time, d, p)
    for ratio, (amplitude, phase) in zip(OVERTONES, parts, strict=True):
        swing = np.sqrt(ratio**2 * (p**2 + d**2) - d**2)
        out = out + decay(time, d, swing, amplitude, phase)
    return out


def test_overtones_are_distinguished_from_the_first_mode():
    """Without them the frequency is off by percents; with them it is exact, drift and all."""
    signal = with_overtones(TIME) + 0.2 + 3.0 * TIME
    near = 0.8 * FREQUENCY, 1.25 * FREQUENCY
    alone = fit_ringdown(TIME, signal, 2, frequency_range=near)
    assert abs(alone.angular_frequency.value / FREQUENCY - 1) > 0.01
    fit = fit_ringdown(TIME, signal, 2, OVERTONES, frequency_range=near)
    assert fit.angular_frequency.value == pytest.approx(FREQUENCY, rel=1e-6)
    assert fit.damping_rate.value == pytest.approx(DAMPING, rel=1e-5)
    np.testing.assert_allclose(fit(TIME), signal, atol=1e-6)


@pytest.mark.parametrize("background", [0, 1, 2])
@pytest.mark.parametrize("overtones", [(), OVERTONES])
def test_every_interval_is_that_of_a_general_fit(overtones, background):
    """SciPy's fit, which differentiates by steps, of the numbers as they are reported."""
    rng = np.random.default_rng(4)
    se = 0.02 * np.linspace(2, 0.5, len(TIME))
    signal = (with_overtones(TIME) if overtones else decay(TIME)) + rng.normal(0, se)
    signal += 0.2 * (background > 0) + 3 * TIME * (background > 1)
    near = 0.8 * FREQUENCY, 1.25 * FREQUENCY
    fit = fit_ringdown(TIME + 2, 7 * signal, background, overtones, 3 * se, near)

    def curve(time, d, p, amplitude, phase, *rest):
        out = decay(time, d, p, amplitude, phase)
        for k, ratio in enumerate(overtones):
            swing = np.sqrt(ratio**2 * (p**2 + d**2) - d**2)
            out = out + np.exp(-d * time) * np.sin(swing * time) * rest[background + 2 * k]
            out = out + np.exp(-d * time) * np.cos(swing * time) * rest[background + 2 * k + 1]
        return out + sum(rest[k] * time**k for k in range(background))

    start = [DAMPING, FREQUENCY, 7, 0.6, *np.zeros(background), *[1.0] * 2 * len(overtones)]
    best, covariance = curve_fit(curve, TIME, 7 * signal, start, se, xtol=1e-12, ftol=1e-12)
    width = student.ppf(0.975, len(TIME) - len(best)) * np.sqrt(np.diag(covariance))
    names = ["damping_rate", "angular_frequency", "amplitude", "phase", "offset"]
    for name, value, half in zip(names[: 4 + min(background, 1)], best, width, strict=False):
        own = getattr(fit, name)
        assert own.value == pytest.approx(value, rel=1e-4, abs=1e-4 * half), name
        assert own.high - own.value == pytest.approx(half, rel=1e-3), name
        assert own.value - own.low == pytest.approx(half, rel=1e-3), name
    p = fit.undamped_angular_frequency
    turn = best[:2] / np.hypot(*best[:2])
    spread = width[0] * np.sqrt(turn @ covariance[:2, :2] @ turn / covariance[0, 0])
    assert p.high - p.value == pytest.approx(spread, rel=1e-3)
    residual = (signal * 7 - curve(TIME, *best)) / se
    usual = 1 / np.sqrt(np.mean(1 / se**2))
    expected = usual * np.sqrt((residual**2).sum() / (len(TIME) - len(best)))
    assert fit.residual_sd == pytest.approx(expected, rel=1e-4)
    np.testing.assert_allclose(fit(TIME + 2), curve(TIME, *best), atol=1e-4)


@pytest.mark.slow
def test_intervals_cover_with_overtones_and_uneven_errors():
    """95 % intervals of 300 noisy decays: 95 ± 4 % hold the truth (3 binomial standard errors)."""
    rng = np.random.default_rng(2)
    se = 0.01 * np.linspace(2, 0.5, len(TIME))
    near = 0.8 * FREQUENCY, 1.25 * FREQUENCY
    clean = with_overtones(TIME)
    fits = [
        fit_ringdown(TIME, clean + rng.normal(0, se), 1, OVERTONES, 7 * se, near)
        for _ in range(300)
    ]
    for name, value in (("angular_frequency", FREQUENCY), ("damping_rate", DAMPING)):
        covered = np.mean([getattr(f, name).low < value < getattr(f, name).high for f in fits])
        assert abs(covered - 0.95) < 0.04, name


def test_errors_of_the_signal_must_be_errors():
    with pytest.raises(ValueError, match="signal_se must be 25 numbers > 0"):
        fit_ringdown(TIME, decay(TIME), signal_se=np.zeros(len(TIME)))
    with pytest.raises(ValueError, match="length >= 11"):
        fit_ringdown(TIME[:10], decay(TIME[:10]), True, OVERTONES)
