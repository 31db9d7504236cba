"""The closed form for half-Gaussian contacts against the recursion for sampled forces."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from whiskermodel import (
    HalfGaussianMoments,
    Response,
    half_gaussian,
    half_gaussian_extremes,
    half_gaussian_moments,
    mouse_c2,
    pulse_response,
    rat_c2,
)

DT = 2e-6  # s


def assert_like_the_recursion(response, c, peak, duration, tolerance=None):
    time = np.arange(0, np.max(duration) + 15e-3, DT)
    steady, vibrational = half_gaussian_moments(response, c, peak, duration, time)
    loads = response.base_loads(c, half_gaussian(time, duration, peak), DT)
    scale = np.abs(response.base_moment_weights(c)).sum(axis=0) * np.abs(peak)
    if tolerance is None:  # what taking the force as linear over DT costs the recursion
        tolerance = 3 * (DT / np.asarray(duration)) ** 2 + 1e-9
    error = np.abs(vibrational - loads.vibrational_moment).max(axis=-1)
    assert (error <= tolerance * scale).all()
    np.testing.assert_allclose(steady, loads.steady_moment, atol=1e-12 * np.abs(steady).max())


@settings(max_examples=8, deadline=None)
@given(
    st.lists(st.integers(500, 20000), min_size=1, max_size=4),
    st.floats(2e-3, 17e-3),
    st.sampled_from(["fixed", 3e-7, "pinned"]),
    st.sampled_from(["chord", "clamped"]),
)
def test_closed_form_is_the_recursion(steps, c, boundary, frame):
    """Durations of 1 to 40 ms, whole numbers of steps so that no kink falls between samples."""
    frame = "chord" if boundary == "pinned" else frame
    duration = np.array(steps) * DT
    response = Response(mouse_c2(), boundary, frame)
    assert_like_the_recursion(response, c, np.linspace(1e-6, 2e-5, len(steps)), duration)


@pytest.mark.parametrize("duration", [20e-6, 100e-6, 400e-6])
def test_contacts_shorter_than_the_fastest_mode(duration):
    assert_like_the_recursion(Response(mouse_c2()), 9e-3, [1e-6], [duration])


@pytest.mark.parametrize("duration", [1e-3, 12e-3, 55e-3, 100e-3])
@pytest.mark.parametrize("n_modes", [1, 10])
def test_closed_form_is_the_convolution_to_nine_digits(duration, n_modes):
    """−P φ''(0) (F − p² h∗F) of each mode by Gauss's rule on pieces of half a radian."""
    response = Response(mouse_c2(), n_modes=n_modes)
    d, weights = response.whisker.damping_rate, response.base_moment_weights(9e-3)
    time = duration * np.array([0.013, 0.5, 0.97, 1.0, 1.1, 1.5])
    _, vibrational = half_gaussian_moments(response, 9e-3, 1e-6, [duration], time)
    expected = -weights.sum() * half_gaussian(time, duration, 1e-6)
    nodes, gauss = np.polynomial.legendre.leggauss(12)
    for p, weight in zip(response.angular_frequency, weights, strict=True):
        rate = np.sqrt(p**2 - d**2)
        for i, t in enumerate(time):
            edges = np.linspace(0, min(t, duration), int(2 * p * duration) + 10)
            half = np.diff(edges)[:, None] / 2
            tau = edges[:-1, None] + half * (nodes + 1)
            kernel = np.exp(-d * (t - tau)) * np.sin(rate * (t - tau)) / rate
            force = half_gaussian(tau.ravel(), duration, 1e-6).reshape(tau.shape)
            expected[i] += weight * p**2 * (half * gauss * kernel * force).sum()
    assert np.abs(vibrational[0] - expected).max() < 1e-9 * 9e-3 * 1e-6  # of c F_max


@pytest.mark.parametrize(("damping", "duration"), [(1500.0, 6e-3), (20000.0, 30e-3)])
def test_sluggish_modes_take_the_recursion(damping, duration):
    """Of damping [1/s] beyond which some or all modes only creep; no polynomial follows all."""
    whisker = dataclasses.replace(mouse_c2(), damping_rate=damping)
    assert_like_the_recursion(Response(whisker), 9e-3, [1e-6], [duration], 1e-5)


def test_grouping_does_not_matter(monkeypatch):
    rng = np.random.default_rng(3)
    c, duration = rng.uniform(3e-3, 30e-3, 15), np.geomspace(0.3e-3, 40e-3, 15)
    time, response = np.arange(0, 60e-3, 1e-5), Response(rat_c2())
    _, together = half_gaussian_moments(response, c, 1e-5, duration, time)
    monkeypatch.setattr(pulse_response, "_SPREAD", 1.03)
    _, apart = half_gaussian_moments(response, c, 1e-5, duration, time)
    assert np.abs(together - apart).max() < 1e-10 * np.abs(apart).max()


def test_extremes():
    c, duration = np.array([6e-3, 12e-3, 15e-3]), np.array([12e-3, 2.5e-3, 12e-3])
    steady, highest, lowest = half_gaussian_extremes(Response(mouse_c2()), c, 2e-6, duration)
    np.testing.assert_allclose(steady, -c * 2e-6)
    np.testing.assert_allclose(highest / -steady, [0.045, 1.425, 0.499], atol=1e-3)
    np.testing.assert_allclose(lowest / -steady, [-0.042, -1.123, -0.665], atol=1e-3)


def test_extremes_are_looked_for_while_the_whisker_rings():
    """Two contacts of one span, whose least moments come just after their ends."""
    response, dt, ringing = Response(mouse_c2()), 1e-5, 0.3e-3
    duration = np.array([5.1e-3, 5.9e-3])
    found = half_gaussian_extremes(response, 9e-3, 1e-6, duration, ringing, dt)
    for k, own in enumerate(duration):
        time = np.arange(0, own + ringing, dt)
        _, vibrational = half_gaussian_moments(response, 9e-3, 1e-6, [own], time)
        assert found[1, k] == pytest.approx(vibrational.max(), rel=1e-9)
        if own == duration.max():
            assert found[2, k] == pytest.approx(vibrational.min(), rel=1e-9)
            assert time[vibrational[0].argmin()] > own


def test_prepared_for_repeated_calls():
    response, time = Response(mouse_c2()), np.arange(0, 30e-3, 1e-5)
    prepared, out = HalfGaussianMoments(response, time), np.empty((2, 3, len(time)))
    for duration in ([3e-3, 12e-3, 20e-3], [4e-3, 4e-3, 9e-3]):
        expected = half_gaussian_moments(response, 9e-3, 1e-6, duration, time)
        steady, _ = prepared(9e-3, 1e-6, duration, out=out)
        assert steady.base is out
        np.testing.assert_array_equal(out, expected)
    with pytest.raises(ValueError, match=r"out must be of shape \(2, 1, 3000\), got"):
        prepared(9e-3, 1e-6, 5e-3, out=out)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"duration": 0.0}, r"duration must be > 0 s, got 0\.0 s"),
        ({"contact_arc_length": 19e-3}, r"contact_arc_length must lie .* got 0\.019 m"),
        ({"peak_force": np.inf}, "peak_force must be finite everywhere"),
        ({"time": [0.0, 0.0]}, "time must be one ascending row"),
        ({"duration": [1e-3, 2e-3], "peak_force": [1e-6] * 3}, "of one length"),
    ],
)
def test_impossible_arguments_are_named(change, message):
    usual = {"contact_arc_length": 9e-3, "peak_force": 1e-6, "duration": 5e-3, "time": [0.0, 1e-3]}
    with pytest.raises(ValueError, match=message):
        half_gaussian_moments(Response(mouse_c2()), **(usual | change))
