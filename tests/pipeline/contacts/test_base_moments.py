"""Dynamic base moments of contacts: the model's own, signed as the tables are."""

import numpy as np
import pandas as pd
import pytest

from pipeline.contacts import base_moments
from pipeline.session.recording import Recording
from pipeline.tables.columns import CONTACT_COLUMNS, FRAME_COLUMNS, as_table
from whiskermodel.force_profiles import half_gaussian
from whiskermodel.response import Response
from whiskermodel.whisker import mouse_c2

RATE = 1000.0
RECORDING = Recording(RATE, 25.0, "left")


def tables(duration=0.012, peak=5e-6, place=12e-3, sign=-1, flags=""):
    """One contact [30, …) that begins half a frame before its first frame."""
    n = round(duration * RATE)
    force = np.zeros(200)
    t = (np.arange(n) + 0.5) / RATE
    force[30 : 30 + n] = half_gaussian(t, duration, peak)
    frames = pd.DataFrame(
        {"frame": np.arange(200), "whisker": "C2", "contact_force_uN": 1e6 * force}
    )
    contacts = pd.DataFrame(
        {
            "whisker": ["C2"],
            "onset_frame": [30],
            "offset_frame": [30 + n],
            "peak_force_uN": [1e6 * force.max()],
            "peak_base_moment_nN_m": [sign * 1e9 * peak * place],
            "contact_arc_length_mm": [1e3 * place],
            "pulse_peak_uN": [1e6 * peak],
            "pulse_duration_ms": [1e3 * duration],
            "flags": [flags],
        }
    )
    return as_table(contacts, CONTACT_COLUMNS), as_table(frames, FRAME_COLUMNS)


def run(contacts, frames, whiskers=None):
    whiskers = {"C2": mouse_c2()} if whiskers is None else whiskers
    return base_moments.add_base_moments(contacts, frames, whiskers, RECORDING).iloc[0]


def finely_sampled(duration, peak, place):
    """Steady peak, largest and least vibrational moment from the recursion, 10 µs steps."""
    dt = 1e-5
    t = np.arange(0, duration + 30e-3, dt)
    loads = Response(mouse_c2()).base_loads(place, half_gaussian(t, duration, peak), dt)
    steady = loads.steady_moment
    return steady[np.abs(steady).argmax()], *loads.vibrational_moment[
        [loads.vibrational_moment.argmax(), loads.vibrational_moment.argmin()]
    ]


@pytest.mark.parametrize("duration", [0.003, 0.012, 0.05])
def test_pulse_moments_are_the_models(duration):
    row = run(*tables(duration))
    steady, high, low = (1e9 * m for m in finely_sampled(duration, 5e-6, 12e-3))
    assert row["steady_peak_nN_m"] == pytest.approx(steady, rel=1e-3)
    assert row["vibration_max_nN_m"] == pytest.approx(high, rel=0.01)
    assert row["vibration_min_nN_m"] == pytest.approx(low, rel=0.01)
    assert row["vibration_ratio"] == pytest.approx(max(high, -low) / abs(steady), rel=0.01)


def test_published_ratio_of_fig_8():
    """The paper's Fig. 8, 5 ms at 12 mm: 0.608 of the steady peak by another solver."""
    assert run(*tables(0.005))["vibration_ratio"] == pytest.approx(0.608, abs=0.005)


def test_signs_follow_the_measured_moment():
    against, along = run(*tables(sign=-1)), run(*tables(sign=1))
    assert against["steady_peak_nN_m"] < 0 < along["steady_peak_nN_m"]
    assert along["vibration_max_nN_m"] == -against["vibration_min_nN_m"]
    assert along["vibration_min_nN_m"] == -against["vibration_max_nN_m"]
    assert along["vibration_ratio"] == against["vibration_ratio"]


def test_measured_force_of_a_pulse_gives_the_pulses_moments():
    """A contact called odd is driven with its force; for a pulse the two agree roughly."""
    pulse, measured = run(*tables(0.03)), run(*tables(0.03, flags="slip;not_half_gaussian"))
    for column in ("steady_peak_nN_m", "vibration_max_nN_m", "vibration_min_nN_m"):
        assert measured[column] == pytest.approx(pulse[column], rel=0.2)
    assert measured["steady_peak_nN_m"] != pulse["steady_peak_nN_m"]


@pytest.mark.parametrize(("before", "after"), [(0.3, 0.6), (1.0, 0.05)])
def test_measured_forces_are_straight_between_frames_and_to_zero_beside_them(before, after):
    """Moments of a trapezium that begins and ends within a frame; it slopes as its ends do."""
    n, rise, contacts, frames = 30, 2e-6, *tables(0.03, flags="not_half_gaussian")
    force = np.full(n, 4 * rise)
    force[:2], force[-2:] = (
        (before * rise, (1 + before) * rise),
        ((1 + after) * rise, after * rise),
    )
    frames.loc[30 : 29 + n, "contact_force_uN"] = 1e6 * force
    row = run(contacts, frames)
    nodes = 1e-3 * np.array([-before, *range(n), n - 1 + after])
    time = np.arange(-1e-3, 55e-3, 1e-6)
    course = np.interp(time, nodes, [0.0, *force, 0.0], left=0.0, right=0.0)
    loads = Response(mouse_c2()).base_loads(12e-3, course, 1e-6)
    assert row["steady_peak_nN_m"] == pytest.approx(-1e9 * 12e-3 * 4 * rise, rel=1e-6)
    for name in ("max", "min"):
        expected = 1e9 * getattr(loads.vibrational_moment, name)()
        assert row[f"vibration_{name}_nN_m"] == pytest.approx(expected, rel=0.02)


def test_a_missing_frame_is_bridged():
    contacts, frames = tables(0.03, flags="not_half_gaussian")
    whole = run(contacts, frames)
    frames.loc[40, "contact_force_uN"] = np.nan
    assert run(contacts, frames)["steady_peak_nN_m"] == pytest.approx(
        whole["steady_peak_nN_m"], rel=0.01
    )


@pytest.mark.parametrize(
    ("place", "whiskers"), [(12e-3, {"C2": None}), (18.5e-3, None), (np.nan, None)]
)
def test_what_the_model_cannot_take_stays_empty(place, whiskers):
    contacts, frames = tables()
    contacts["contact_arc_length_mm"] = 1e3 * place
    row = run(contacts, frames, whiskers)
    assert np.isnan(row["steady_peak_nN_m"])
    assert np.isnan(row["vibration_ratio"])


def test_no_contacts_no_rows():
    contacts, frames = tables()
    out = base_moments.add_base_moments(contacts.iloc[:0], frames, {"C2": mouse_c2()}, RECORDING)
    assert len(out) == 0
    assert list(out.columns) == [c.name for c in CONTACT_COLUMNS]
