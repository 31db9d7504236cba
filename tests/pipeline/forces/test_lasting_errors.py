"""What shifts stations in all frames alike is found, and they count less."""

from dataclasses import replace

import numpy as np
import pytest
import traced_motion
from hypothesis import given
from hypothesis import strategies as st

from pipeline.forces import forces, lasting_errors
from pipeline.forces.lasting_errors import LASTING_SHARE, lasting_variance
from pipeline.forces.whisker_rows import WhiskerRows
from pipeline.session.parameters import DEFAULTS
from synthetic.presets import make_trial
from whiskermodel.whisker import mouse_c2

AT = 5.5e-3
FUR_PX, FUR_REACH_M = 0.3, 0.5e-3  # by how much, and how far out, stations are drawn aside
EDGE_PX, EDGE_M = 0.05, 7.5e-3  # by how much, and where, the pole's edge shifts a station
FORCE_ERROR = 0.01  # relative, of the peak forces' median
SD_M, SPACING_M = 1e-6, 0.375e-3


@pytest.fixture(scope="module")
def traced():
    return traced_motion.trace(make_trial("noisy", 3, 0, 700).motion, noise_px=0.02)


def shifted(places, aside):
    """The stations moved across the whisker by `aside` (rows, stations) [m]."""
    along_x, along_y = np.gradient(places.x, axis=1), np.gradient(places.y, axis=1)
    length = np.hypot(along_x, along_y)
    known = np.isfinite(length)
    x = np.where(known, places.x - aside * along_y / length, places.x)
    y = np.where(known, places.y + aside * along_x / length, places.y)
    return replace(places, x=x, y=y, information=np.where(known, places.information, 0.0))


@pytest.fixture(scope="module")
def furry(traced):
    """Stations near the face drawn aside: to one side in free frames, to the other in touches."""
    places = traced.places
    touching = traced.true_frames["in_contact"].to_numpy()
    arc = np.arange(places.x.shape[1]) * places.spacing[0]
    beyond = np.maximum(arc - np.nanmedian(places.first) - 0.4e-3, 0)
    aside = FUR_PX / traced.recording.pixels_per_m * np.exp(-beyond / FUR_REACH_M)
    return shifted(places, aside * np.where(touching, -1.0, 1.0)[:, None])


@pytest.fixture(scope="module")
def edged(traced):
    """One station shifted while the whisker touches, as beside the pole's edge."""
    places = traced.places
    touching = traced.true_frames["in_contact"].to_numpy()
    aside = np.zeros(places.x.shape)
    aside[touching, round(EDGE_M / places.spacing[0])] = EDGE_PX / traced.recording.pixels_per_m
    return shifted(places, aside)


def median_force_error(traced, places):
    evidence, _ = forces.measure_forces(
        places, mouse_c2(), traced.frames, AT, params=DEFAULTS.forces
    )
    truth = traced.true_frames["contact_force_uN"].to_numpy()
    pushed = truth > 3
    return np.median(1e6 * evidence["shape_force_N"].to_numpy()[pushed] / truth[pushed] - 1)


def judged(traced, places):
    angle = np.radians(traced.frames["base_angle_deg"].to_numpy())
    time = traced.frames["time_s"].to_numpy()
    own = WhiskerRows(
        places, mouse_c2(), AT, angle, time, forces.far_from_pole(places, DEFAULTS.forces)
    )
    return lasting_errors.with_lasting_errors(own, 1e-3 * DEFAULTS.forces.loaded_distance_mm)


def parts_left(traced, places):
    """Part of their information that the stations keep, and where they lie beyond the fur [m]."""
    before = np.where(places.information > 0, places.information, np.nan)
    arc = np.arange(before.shape[1]) * places.spacing[0] - np.nanmedian(places.first)
    return judged(traced, places).information / before, arc


@pytest.mark.slow
def test_forces_are_those_without_the_fur(traced, furry, monkeypatch):
    assert abs(median_force_error(traced, furry)) < FORCE_ERROR
    none = np.zeros(furry.x.shape[1])
    monkeypatch.setattr(lasting_errors, "lasting_variance", lambda *_: none)
    monkeypatch.setattr(forces.station_noise, "lasting_variance", lambda *_: none)
    assert abs(median_force_error(traced, furry)) > 2 * FORCE_ERROR


@pytest.mark.slow
def test_only_stations_near_the_face_count_less(traced, furry):
    part, arc = parts_left(traced, furry)
    near, beyond = (arc > 0) & (arc < 1.3e-3), arc > 3.4e-3
    assert np.nanmax(part[:, near]) < 0.1
    assert np.nanmin(part[:, beyond]) > 0.9


@pytest.mark.slow
def test_only_the_station_beside_the_poles_edge_counts_less(traced, edged):
    part, _ = parts_left(traced, edged)
    edge = round(EDGE_M / edged.spacing[0])
    assert np.nanmax(part[:, edge]) < 0.1
    away = np.abs(np.arange(part.shape[1]) - edge) * edged.spacing[0]
    assert np.nanmin(part[:, away > 2e-3]) > 0.9


@pytest.mark.slow
def test_what_few_frames_show_nearest_to_the_face_counts_no_more_than_what_lies_beyond(
    traced, furry
):
    """Stations too seldom seen to be judged lie deeper in the fur than those that are doubted."""
    first = np.flatnonzero((furry.information > 0).mean(axis=0) > 0.5)[0]
    information = furry.information.copy()
    information[:, first] = 0.0
    seldom = slice(0, None, len(information) // 4)
    information[seldom, first] = furry.information[seldom, first + 1]
    doubted = judged(traced, replace(furry, information=information)).information
    part = doubted[seldom, first] / information[seldom, first]
    assert np.nanmax(part) < 0.1


@pytest.mark.slow
def test_fur_counts_as_much_where_noise_is_larger_than_said(traced, furry):
    """As a codec's: its fits multiply all variances, also that of fur."""
    said = judged(traced, furry).information
    boasted = judged(traced, replace(furry, information=30 * furry.information)).information / 30
    arc = np.arange(said.shape[1]) * furry.spacing[0] - np.nanmedian(furry.first)
    near = (arc > 0.4e-3) & (arc < 1.3e-3)
    ratio = boasted[:, near][said[:, near] > 0] / said[:, near][said[:, near] > 0]
    assert 0.5 < np.median(ratio) < 2


@pytest.mark.slow
def test_without_fur_nothing_changes(traced):
    assert np.array_equal(judged(traced, traced.places).information, traced.places.information)


def misfits(rng, shift_sd, rows=60, stations=40):
    """Misfits (rows, stations) of noise and of shifts [standard errors of the mean]."""
    shift = np.asarray(shift_sd) / np.sqrt(rows)
    return SD_M * (shift + rng.normal(size=(rows, stations)))


@given(seed=st.integers(0, 10**6), at=st.integers(0, 39), size=st.sampled_from([-25.0, 25.0]))
def test_one_shifted_station_is_found_wherever_it_lies(seed, at, size):
    """Also the last one, towards which a curve through all would bend, and by how much."""
    rng, shift = np.random.default_rng(seed), np.zeros(40)
    shift[at] = size
    rows = 60
    noise = misfits(rng, shift, rows)
    x = np.linspace(-1, 1, 40)  # rods follow what smooth curves can
    smooth = np.polynomial.legendre.legvander(x, lasting_errors.DEGREE)
    noise -= (smooth @ np.linalg.lstsq(smooth, noise.T, rcond=None)[0]).T
    found = lasting_variance(noise, np.full(noise.shape, SD_M**-2), SPACING_M)
    assert np.argmax(found) == at
    true = (size * SD_M / np.sqrt(rows) / LASTING_SHARE) ** 2
    assert 0.2 * true < found[at] < 3 * true


def test_chance_shifts_hardly_any_station():
    rng, count = np.random.default_rng(3), 0
    for _ in range(200):
        noise = misfits(rng, np.zeros(40))
        count += lasting_variance(noise, np.full(noise.shape, SD_M**-2), SPACING_M).any()
    assert count <= 3  # of 8000 means, half a one lies beyond four standard errors


def test_means_that_all_lie_off_alike_are_no_shifts():
    """Where all means scatter more than noise does, as a codec's, none stands out."""
    rng = np.random.default_rng(5)
    noise = misfits(rng, rng.normal(0, 6, 40))
    assert not lasting_variance(noise, np.full(noise.shape, SD_M**-2), SPACING_M).any()


def test_too_few_frames_show_nothing():
    shift = np.zeros(40)
    shift[20] = 50.0
    noise = misfits(np.random.default_rng(0), shift, lasting_errors.FEWEST_ROWS - 1)
    assert not lasting_variance(noise, np.full(noise.shape, SD_M**-2), SPACING_M).any()
    few = misfits(np.random.default_rng(0), shift)[:, : lasting_errors.FEWEST_STATIONS - 1]
    assert not lasting_variance(few, np.full(few.shape, SD_M**-2), SPACING_M).any()
