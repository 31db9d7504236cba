"""Shapes of the named forces."""

import numpy as np
import pytest

from whiskermodel.force_profiles import half_gaussian, ramp_and_hold, stick_slip

NEWTON = 1e-15  # N, rounding


def test_half_gaussian_peaks_at_mid_contact_and_lasts_its_duration():
    time = np.arange(0, 30e-3, 1e-5)
    force = half_gaussian(time, 12e-3, 10e-6)
    assert force.max() == pytest.approx(10e-6)
    assert time[force.argmax()] == pytest.approx(6e-3)
    assert (force[(time > 0) & (time < 12e-3 - 1e-9)] > 0).all()
    assert (force[time > 12e-3] == 0).all()


def test_half_gaussian_is_the_printed_one_moved_and_doubled():
    t_d, time = 6e-3, np.linspace(0, 12e-3, 101)
    printed = np.exp(-((time - t_d) ** 2) / (1.2011 * t_d) ** 2) - 0.5
    np.testing.assert_allclose(half_gaussian(time, 2 * t_d, 1.0), 2 * printed, atol=1e-4)


def test_half_gaussian_for_many_contacts():
    time = np.linspace(0, 20e-3, 201)
    many = half_gaussian(time, [5e-3, 10e-3], [1e-6, 2e-6], onset=[0, 5e-3])
    assert many.shape == (2, 201)
    np.testing.assert_allclose(many[1], half_gaussian(time - 5e-3, 10e-3, 2e-6), atol=NEWTON)


def test_stick_slip_rises_falls_and_repeats():
    time = np.arange(0, 30e-3, 1e-5)
    force = stick_slip(time, slip_duration=2e-3)
    assert force[800] == pytest.approx(5e-6)  # end of the stick, 8 ms
    assert force[400] == pytest.approx(5e-6 * np.sin(np.pi / 4))
    np.testing.assert_allclose(force[1000:2000], force[:1000], atol=5e-20)
    assert (force[2001:] == 0).all()


def test_ramp_and_hold_is_a_raised_cosine():
    time = np.arange(0, 100e-3, 1e-5)
    force = ramp_and_hold(time, 24e-3, 1e-6, hold_duration=20e-3)
    assert force[1200] == pytest.approx(0.5e-6)
    assert (np.abs(force[2400:4400] - 1e-6) < NEWTON).all()
    assert force[4400 + 1200] == pytest.approx(0.5e-6)
    assert (np.abs(force[6800:]) < NEWTON).all()
    assert ramp_and_hold(time, 24e-3, 1e-6)[-1] == pytest.approx(1e-6)


def test_impossible_arguments_are_named():
    time = np.linspace(0, 1e-2, 11)
    with pytest.raises(ValueError, match=r"duration must be > 0 s, got -0\.001 s"):
        half_gaussian(time, -1e-3, 1e-6)
    with pytest.raises(ValueError, match="peak_force must be finite"):
        half_gaussian(time, 1e-3, np.nan)
    with pytest.raises(ValueError, match=r"slip_duration must be > 0 s, got 0\.0 s"):
        stick_slip(time, 0.0)
    with pytest.raises(ValueError, match="events must be a whole number >= 1, got 0"):
        stick_slip(time, 1e-3, events=0)
    with pytest.raises(ValueError, match=r"hold_duration must be >= 0 s, got -1\.0 s"):
        ramp_and_hold(time, 1e-3, 1e-6, hold_duration=-1.0)
