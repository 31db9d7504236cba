"""Half-Gaussian pulses: exact recovery, odd contacts."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import curve_fit

from pipeline.contacts.pulses import add_pulses, fit_pulse
from pipeline.session.recording import Recording
from pipeline.tables.columns import CONTACT_COLUMNS, FRAME_COLUMNS, as_table
from whiskermodel.force_profiles import half_gaussian

RATE = 1000.0


def frames_of(duration, phase=0.5):
    """Times of the frames inside a pulse that begins `phase` of a frame before the first."""
    return (np.arange(int(duration * RATE + 1 - phase)) + phase) / RATE


@settings(max_examples=60, deadline=None)
@given(st.floats(0.5e-6, 50e-6), st.floats(0.003, 0.12), st.floats(0.05, 0.95), st.floats(0, 100))
def test_exact_pulses_are_recovered(peak, duration, phase, start):
    t = frames_of(duration, phase)
    t = t[t < duration]
    force = half_gaussian(t, duration, peak)
    pulse = fit_pulse(start + t, force)
    if len(t) < 4:  # three numbers from three: nothing left over
        return
    # the first frame of a 3 ms touch shows little of where its force began
    tolerance = 1e-4 if len(t) > 6 else 0.1
    assert pulse.peak == pytest.approx(peak, rel=tolerance)
    assert pulse.duration == pytest.approx(duration, rel=tolerance)
    assert pulse.centre - start == pytest.approx(duration / 2, abs=tolerance * duration)


@pytest.mark.parametrize("duration", [0.006, 0.016, 0.08])
def test_agrees_with_general_least_squares(duration):
    """SciPy's fit of the same frames, one without a force, and of a zero beside either end."""
    rng = np.random.default_rng(0)
    t = frames_of(duration)
    force = half_gaussian(t, duration, 15e-6) + rng.normal(0, 0.5e-6, len(t))
    force[2] = np.nan
    known = np.isfinite(force)
    padded_t = np.concatenate([[t[0] - 1e-3], t[known], [t[-1] + 1e-3]])
    padded = np.concatenate([[0.0], force[known], [0.0]])

    def model(t, peak, duration, centre):
        return 1e6 * half_gaussian(t, duration * 1e-3, peak * 1e-6, (centre - duration / 2) * 1e-3)

    found, _ = curve_fit(
        model, padded_t, 1e6 * padded, (14, 1e3 * duration, 500 * duration), xtol=1e-12
    )
    ours = fit_pulse(t, force)
    np.testing.assert_allclose(
        [1e6 * ours.peak, 1e3 * ours.duration, 1e3 * ours.centre], found, rtol=1e-3
    )
    left = 1e6 * force[known] - model(t[known], *found)
    assert 1e6 * ours.misfit == pytest.approx(np.sqrt(np.mean(left**2)), rel=1e-3)
    assert ours.r2 == pytest.approx(
        1 - np.sum(left**2) / np.sum((1e6 * (force[known] - force[known].mean())) ** 2), abs=1e-5
    )


def test_r2_distinguishes_pulses_from_plateaus():
    t = frames_of(0.05)
    plateau = fit_pulse(t, 10e-6 * (1 - np.abs(2 * t / 0.05 - 1) ** 5))
    pulse = fit_pulse(t, half_gaussian(t, 0.05, 10e-6))
    assert pulse.r2 > 0.9999
    assert plateau.r2 < 0.95


def test_missing_forces_are_left_out():
    t = frames_of(0.03)
    force = half_gaussian(t, 0.03, 10e-6)
    force[[0, 7, 8]] = np.nan
    pulse = fit_pulse(t, force)
    assert pulse.peak == pytest.approx(10e-6, rel=0.01)
    assert pulse.duration == pytest.approx(0.03, rel=0.03)


def test_nothing_to_fit_is_none():
    assert fit_pulse([0.0, 0.001], [1e-6, 1e-6]) is None
    assert fit_pulse(np.arange(5) / 1e3, np.zeros(5)) is None
    assert fit_pulse(np.arange(5) / 1e3, np.full(5, np.nan)) is None
    with pytest.raises(ValueError, match="must match"):
        fit_pulse([0.0, 0.001, 0.002], [1e-6])


def tables(*forces):
    """Frames with one contact per force [N], ten free frames around each; contacts."""
    quiet = np.zeros(10)
    force = np.concatenate([quiet] + [part for f in forces for part in (f, quiet)])
    edges = np.cumsum([10] + [n for f in forces for n in (len(f), 10)])
    frames = pd.DataFrame(
        {
            "frame": np.arange(len(force)),
            "time_s": np.arange(len(force)) / RATE,
            "whisker": "C2",
            "tracked": True,
            "contact_force_uN": 1e6 * force,
            "contact_force_uN_se": 0.05,
        }
    )
    contacts = pd.DataFrame(
        {
            "whisker": "C2",
            "contact": np.arange(1, len(forces) + 1),
            "onset_frame": edges[0:-1:2],
            "offset_frame": edges[1::2],
            "flags": "",
        }
    )
    return as_table(contacts, CONTACT_COLUMNS), as_table(frames, FRAME_COLUMNS)


def test_table_of_contacts():
    t = frames_of(0.04)
    pulse = half_gaussian(t, 0.04, 8e-6)
    contacts, frames = tables(pulse, 8e-6 * (1 - np.abs(2 * t / 0.04 - 1) ** 5), pulse[:2])
    out = add_pulses(contacts, frames, Recording(RATE, 25.0, "left"))
    assert contacts["pulse_peak_uN"].isna().all()
    assert out["pulse_peak_uN"][0] == pytest.approx(8.0, rel=1e-3)
    assert out["pulse_duration_ms"][0] == pytest.approx(40.0, rel=1e-3)
    # frame 10 is half a frame into the pulse
    assert out["pulse_centre_s"][0] == pytest.approx(0.0095 + 0.02, abs=1e-5)
    assert list(out["flags"]) == ["", "not_half_gaussian", ""]
    assert np.isnan(out["pulse_peak_uN"][2])


@pytest.mark.parametrize(("error_uN", "flagged"), [(0.12, True), (0.25, False)])
def test_a_misfit_that_noise_explains_makes_no_odd_pulse(error_uN, flagged):
    """A straight rise, 0.54 µN RMS from any half-Gaussian: three times 0.18 µN."""
    ramp = 8e-6 * np.linspace(0.05, 1, 40)
    contacts, frames = tables(ramp)
    assert 1e6 * fit_pulse(np.arange(40) / RATE, ramp).misfit == pytest.approx(0.54, abs=0.02)
    frames["contact_force_uN_se"] = error_uN
    out = add_pulses(contacts, frames, Recording(RATE, 25.0, "left"))
    assert list(out["flags"]) == ["not_half_gaussian" if flagged else ""]


@pytest.mark.filterwarnings("error")
def test_a_force_in_a_single_frame_is_fitted_without_a_word():
    force = np.where(np.arange(20) == 16, 1e-6, 0.0)
    pulse = fit_pulse(np.arange(20) / RATE, force)
    assert pulse.centre == pytest.approx(16 / RATE, abs=1 / RATE)
