"""What fur draws aside in all frames alike is found and left out."""

from dataclasses import replace

import numpy as np
import pytest
import traced_motion
from rod_scenes import CURVATURE_AT, SD, known_rest, noisy, touching

from pipeline.forces import forces, fur_bias, rod_fit
from pipeline.forces.whisker_rows import WhiskerRows
from pipeline.session.parameters import DEFAULTS
from synthetic.presets import make_trial
from whiskermodel.whisker import mouse_c2

pytestmark = pytest.mark.slow

AT = 5.5e-3
FUR_PX, FUR_REACH_M = 0.3, 0.5e-3  # by how much, and how far out, stations are drawn aside
FORCE_ERROR = 0.01  # relative, of the peak forces' median


@pytest.fixture(scope="module")
def traced():
    return traced_motion.trace(make_trial("noisy", 3, 0, 700).motion, noise_px=0.02)


@pytest.fixture(scope="module")
def furry(traced):
    """Stations near the face drawn aside: to one side in free frames, to the other in touches."""
    places = traced.places
    touching = traced.true_frames["in_contact"].to_numpy()
    arc = np.arange(places.x.shape[1]) * places.spacing[0]
    beyond = np.maximum(arc - np.nanmedian(places.first) - 0.4e-3, 0)
    aside = FUR_PX / traced.recording.pixels_per_m * np.exp(-beyond / FUR_REACH_M)
    aside = aside * np.where(touching, -1.0, 1.0)[:, None]
    along_x, along_y = np.gradient(places.x, axis=1), np.gradient(places.y, axis=1)
    length = np.hypot(along_x, along_y)
    known = np.isfinite(length)
    x = np.where(known, places.x - aside * along_y / length, places.x)
    y = np.where(known, places.y + aside * along_x / length, places.y)
    return replace(places, x=x, y=y, information=np.where(known, places.information, 0.0))


def median_force_error(traced, places):
    evidence, _ = forces.measure_forces(places, mouse_c2(), traced.frames, AT)
    truth = traced.true_frames["contact_force_uN"].to_numpy()
    pushed = truth > 3
    return np.median(1e6 * evidence["shape_force_N"].to_numpy()[pushed] / truth[pushed] - 1)


def judged(traced, places):
    angle = np.radians(traced.frames["base_angle_deg"].to_numpy())
    time = traced.frames["time_s"].to_numpy()
    free = forces.far_from_pole(places)
    own = WhiskerRows(places, mouse_c2(), AT, angle, time, free)
    return fur_bias.without_bias(own, 1e-3 * DEFAULTS.forces.loaded_distance_mm)


def test_forces_are_those_without_the_fur(traced, furry, monkeypatch):
    assert abs(median_force_error(traced, furry)) < FORCE_ERROR
    monkeypatch.setattr(fur_bias, "without_bias", lambda own, _: own.places)
    assert abs(median_force_error(traced, furry)) > 2 * FORCE_ERROR


def test_only_stations_near_the_face_count_less(traced, furry):
    before = np.where(furry.information > 0, furry.information, np.nan)
    part = judged(traced, furry).information / before
    arc = np.arange(part.shape[1]) * furry.spacing[0] - np.nanmedian(furry.first)
    near, beyond = (arc > 0.4e-3) & (arc < 1.3e-3), arc > 3.4e-3
    assert np.nanmax(part[:, near]) < 0.1
    assert np.nanmin(part[:, beyond]) > 0.9


def test_what_few_frames_show_nearest_to_the_face_counts_no_more_than_what_lies_beyond(
    traced, furry
):
    """Stations too seldom seen to be judged lie deeper in the fur than those that are doubted."""
    first = np.flatnonzero((furry.information > 0).mean(axis=0) > 0.5)[0]
    information = furry.information.copy()
    information[:, first] = 0.0
    seldom = slice(0, None, len(information) // 4)
    information[seldom, first] = furry.information[seldom, first + 1]
    edge = furry.first + furry.spacing[0]  # of the fur: a step farther out
    doubted = judged(traced, replace(furry, information=information, first=edge)).information
    part = doubted[seldom, first] / information[seldom, first]
    assert np.nanmax(part) < 0.1


def test_what_is_usual_may_be_chance():
    """Squared misfits of 1.9 and of 2.1 times the expected variance."""
    square, expected = np.array([1.9, 2.1]), np.ones(2)
    kinds = [(square, expected)] * 2
    np.testing.assert_allclose(fur_bias._bias(kinds, usual=1.0), [0.0, 1.1])


def test_fur_counts_as_much_where_noise_is_larger_than_said(traced, furry):
    """As a codec's: its fits multiply all variances, also that of fur."""
    said = judged(traced, furry).information
    boasted = judged(traced, replace(furry, information=30 * furry.information)).information / 30
    arc = np.arange(said.shape[1]) * furry.spacing[0] - np.nanmedian(furry.first)
    near = (arc > 0.4e-3) & (arc < 1.3e-3)
    ratio = boasted[:, near][said[:, near] > 0] / said[:, near][said[:, near] > 0]
    assert 0.5 < np.median(ratio) < 2


def test_without_fur_nothing_changes(traced):
    assert np.array_equal(judged(traced, traced.places).information, traced.places.information)


def test_usual_misfits_are_variances_of_few_outliers():
    """Of normal misfits, the median square stands for the variance; ten rows are needed."""
    rng, sd = np.random.default_rng(4), np.array([1.0, 3.0, 2.0, 1.0])
    square = (sd * rng.normal(size=(4000, 4))) ** 2
    square[:400] = 1e4
    expected = rng.uniform(0.9, 1.1, (4000, 4)) * sd**2 / 2
    square[9:, 2], square[10:, 3] = np.nan, np.nan
    found, usual = fur_bias.usual_misfit(square, expected)
    np.testing.assert_allclose(found[:2], sd[:2] ** 2, rtol=0.35)  # a tenth is wild
    np.testing.assert_allclose(usual[:2], sd[:2] ** 2 / 2, rtol=0.02)
    np.testing.assert_array_equal(np.isnan(found), [False, False, True, False])
    calm, _ = fur_bias.usual_misfit(square[400:], expected[400:])
    np.testing.assert_allclose(calm[:2], sd[:2] ** 2, rtol=0.1)


def test_what_both_kinds_of_frames_miss_alike_is_their_mean_beyond_what_is_usual():
    """Misfits [µm²] count where they are twice the usual; unknown ones do not."""
    free = np.array([9.0, 2.5, 20.0, np.nan]), np.array([1.0, 1.0, 2.0, 1.0])
    touching = np.array([11.0, 9.0, np.nan, np.nan]), np.array([1.0, 1.0, 1.0, 1.0])
    found = fur_bias._bias([free, touching], 2.0)
    np.testing.assert_allclose(found, [(7 + 9) / 2, 7 / 2, 16.0, 0.0])
    assert fur_bias._usual([free, touching]) == pytest.approx(9.0)  # median of 9, 7, 10, 11, 9
    assert fur_bias._usual([(0.1 * free[0], free[1])]) == 1.0
    assert fur_bias._usual([(np.full(2, np.nan), np.ones(2))]) == 1.0


@pytest.mark.parametrize("noise", [0, 9])
def test_a_misfit_is_expected_of_the_rod_and_of_the_station(noise):
    """As large as said, or as χ² shows where that is more; unknown where nothing was seen."""
    rng, whisker, prior = np.random.default_rng(7), mouse_c2(), known_rest(3)
    _, places = touching(np.full(3, 0.2))
    for _ in range(noise):
        places = noisy(places, rng)
    judged, misfit = np.array([3, 9, 20, 30]), np.empty((3, 2, places.x.shape[1]))
    fit = rod_fit.fit_loaded(places, whisker, CURVATURE_AT, prior, misfit=misfit)
    rows = WhiskerRows(places, whisker, CURVATURE_AT, *np.zeros((2, 3)), np.zeros(3, bool))
    *found, _ = fur_bias._misfits(rows, places.information, prior)
    square, expected = (each[:, judged] for each in found)
    own = SD**2 * np.maximum(fit["chi2"], 1.0)[:, None]
    assert (fit["chi2"] > 4).all() == (noise > 0)
    np.testing.assert_array_equal(np.isnan(expected[:, 0]), True)
    np.testing.assert_allclose(expected[:, 1:], (misfit[:, 1, judged] + own)[:, 1:])
    np.testing.assert_allclose(square, misfit[:, 0, judged] ** 2)
