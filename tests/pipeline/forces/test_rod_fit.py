"""The rod fitted to places on a whisker, against the rod that made them."""

from dataclasses import replace

import numpy as np
import pytest
from rod_scenes import CURVATURE_AT, REST, SD, known_rest, noisy, touching

from pipeline.forces import rest_shape, rod_fit
from pipeline.forces.rod_integration import nearest_to
from pipeline.forces.rod_outputs import CURVATURE_REACH_M
from pipeline.kinematics.stations import N_STATIONS
from whiskermodel import rod
from whiskermodel.whisker import mouse_c2

exact = 5e-5  # relative, without noise
settled = 0.1  # standard errors by which a usual fit differs from a fine one


def fine_fit(places, rest, **more):
    """As `fit_loaded`, settled as finely as for the likelihood's slope."""
    return rod_fit.fit_loaded(places, mouse_c2(), CURVATURE_AT, rest, fine=True, **more)


def test_usual_fits_have_arrived():
    """In noise, free and touching, also where others lead up to them."""
    _, places = touching(np.tile([-0.2, 0.01, 0.1, 0.4], 30))
    places, rest = noisy(places, np.random.default_rng(7)), known_rest(120)
    usual, fine = (
        rod_fit.fit_loaded(places, mouse_c2(), CURVATURE_AT, rest),
        fine_fit(places, rest),
    )
    for name in ("force", "gap", "angle"):
        off = np.abs(usual[name] - fine[name]) / np.sqrt(fine[f"{name}_var"])
        assert off.max() < settled, name
    np.testing.assert_allclose(usual["force_var"], fine["force_var"], rtol=settled)


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("distance", [7e-3, 9e-3, 11e-3, 14e-3])
def test_force_is_exact_at_large_angles(distance, side):
    push = np.linspace(0.02, 0.45, 7) if distance < 12e-3 else np.linspace(0.01, 0.2, 7)
    truth, places = touching(push, distance, side)
    assert truth.touching.all()
    fit = fine_fit(places, known_rest(len(push)))
    np.testing.assert_allclose(fit["force"], truth.contact_force, rtol=exact)
    moment = fit["force"] * fit["moment_per_force"]
    np.testing.assert_allclose(moment, truth.base_moment, rtol=exact)
    axial = fit["force"] * fit["axial_per_force"]
    np.testing.assert_allclose(axial, truth.axial_force, atol=exact * truth.contact_force.max())
    lateral = fit["force"] * fit["lateral_per_force"]
    np.testing.assert_allclose(lateral, truth.lateral_force, rtol=exact)
    np.testing.assert_allclose(fit["contact"], truth.contact_arc_length, atol=1e-6)
    np.testing.assert_allclose(fit["angle"], truth.base_angle, atol=2e-5)
    np.testing.assert_allclose(fit["gap"], 0.0, atol=2e-8)


def test_moment_at_the_curvature_point_is_the_rods():
    """Δκ per force times E I(s_p) is the lever of the true contact force about r_p."""
    truth, places = touching([0.4])
    fit = rod_fit.fit_loaded(places, mouse_c2(), CURVATURE_AT, known_rest(1))
    x, y, _ = rod.contact_shape(mouse_c2(), truth, [CURVATURE_AT])
    angle, force = truth.contact_angle, truth.contact_force
    fx, fy = force * np.sin(angle), -force * np.cos(angle)
    moment = (truth.contact_x - x[0]) * fy - (truth.contact_y - y[0]) * fx
    change = fit["curvature_per_force"] * fit["force"]
    np.testing.assert_allclose(
        change * mouse_c2().flexural_rigidity(CURVATURE_AT), moment, rtol=1e-4
    )


def true_curvature(truth, whisker):
    """Curvature [1/m] of the loaded rod at CURVATURE_AT: rest shape and moment over E I."""
    x, y, _ = rod.contact_shape(whisker, truth, [CURVATURE_AT])
    fx = truth.contact_force * np.sin(truth.contact_angle)
    fy = -truth.contact_force * np.cos(truth.contact_angle)
    moment = (truth.contact_x - np.ravel(x)) * fy - (truth.contact_y - np.ravel(y)) * fx
    return REST[0] + REST[1] * CURVATURE_AT + moment / whisker.flexural_rigidity(CURVATURE_AT)


@pytest.mark.parametrize("distance", [7e-3, 10e-3])
def test_curvature_is_not_biased_by_the_kink_at_the_pole(distance):
    push = np.full(400, 0.2)
    truth, places = touching(push, distance)
    true = true_curvature(truth, mouse_c2())
    fit = rod_fit.fit_loaded(places, mouse_c2(), CURVATURE_AT, known_rest(400))
    np.testing.assert_allclose(fit["curvature"], true, atol=5e-3)  # 1/m
    places = noisy(places, np.random.default_rng(3))
    fit = rod_fit.fit_loaded(places, mouse_c2(), CURVATURE_AT, known_rest(400))
    z = (fit["curvature"] - true) / np.sqrt(fit["curvature_var"])
    assert 0.92 < np.mean(np.abs(z) < 1.96) < 0.98
    assert abs(z.mean()) < 0.15


def test_curvature_that_the_rod_does_not_have_is_measured():
    """0.5 1/m more over the window than any rod of this rest shape and load would have."""
    truth, places = touching([0.1])
    along = np.arange(N_STATIONS) * places.spacing[0] - CURVATURE_AT
    bump = 0.25 * np.where(np.abs(along) < CURVATURE_REACH_M + 1e-5, along**2, 0.0)
    direction = np.unwrap(np.arctan2(np.gradient(places.y[0]), np.gradient(places.x[0])))
    moved = replace(
        places,
        x=places.x - bump * np.sin(direction),
        y=places.y + bump * np.cos(direction),
        information=1e-2 * places.information,  # not so exact that the bump is an outlier
    )
    fit = rod_fit.fit_loaded(moved, mouse_c2(), CURVATURE_AT, known_rest(1))
    more = fit["curvature"] - true_curvature(truth, mouse_c2())
    np.testing.assert_allclose(more, 0.5, atol=0.02)


@pytest.mark.parametrize("origin", [0.1e-3, -0.08e-3])
def test_curvature_is_that_of_the_true_place(origin):
    truth, places = touching([0.1, 0.3], origin=origin)
    fit = rod_fit.fit_loaded(places, mouse_c2(), CURVATURE_AT, known_rest(2))
    np.testing.assert_allclose(fit["curvature"], true_curvature(truth, mouse_c2()), atol=5e-3)
    step = 0.1e-3
    before, after = (
        rod_fit.fit_loaded(places, mouse_c2(), CURVATURE_AT + d, known_rest(2))["curvature"]
        for d in (-step, step)
    )
    np.testing.assert_allclose(fit["curvature_slope"], (after - before) / (2 * step), rtol=0.03)


@pytest.mark.parametrize("origin", [0.1e-3, -0.08e-3])
def test_an_origin_that_is_known_costs_nothing(origin):
    truth, places = touching([0.05, 0.3], origin=origin)
    fit = rod_fit.fit_loaded(places, mouse_c2(), CURVATURE_AT, known_rest(2))
    np.testing.assert_allclose(fit["force"], truth.contact_force, rtol=exact)
    np.testing.assert_allclose(fit["contact"], truth.contact_arc_length, atol=1e-6)
    blind = rod_fit.fit_loaded(
        replace(places, origin=np.zeros(2)), mouse_c2(), CURVATURE_AT, known_rest(2)
    )
    # the fourth power of the radius: a few per cent per 0.1 mm
    assert abs(blind["force"][1] / truth.contact_force[1] - 1) > 0.02


@pytest.mark.parametrize("load", ["force", "moment", "axial", "lateral"])
def test_how_loads_follow_the_origin(load):
    """Beside the difference of two fits; the rest shape is known loosely, as from free frames."""
    _, places = touching([0.05, 0.3], distance=8e-3)

    def loads(shift):
        prior = known_rest(2, sd=0.1)
        fit = rod_fit.fit_loaded(places, mouse_c2(), CURVATURE_AT, prior, shift=shift)
        share = 1.0 if load == "force" else fit[f"{load}_per_force"]
        return fit["force"] * share, fit

    step = 0.02e-3
    difference = (loads(step)[0] - loads(-step)[0]) / (2 * step)
    value, fit = loads(0.0)
    np.testing.assert_allclose(fit[f"{load}_by_origin"], difference, rtol=0.05)
    assert load != "force" or (np.abs(difference / value) > 200).all()  # 2 % per 0.1 mm


def test_friction_that_is_known_is_taken_out():
    truth, places = touching([0.1, 0.4], friction=0.3)
    fit = rod_fit.fit_loaded(places, mouse_c2(), CURVATURE_AT, known_rest(2), friction=0.3)
    np.testing.assert_allclose(fit["force"], truth.contact_force, rtol=exact)
    np.testing.assert_allclose(fit["force"] * fit["axial_per_force"], truth.axial_force, rtol=1e-3)


def test_standard_errors_cover():
    """Forces and gap scatter as their errors say: 95 % of 600 draws, ± 3 %."""
    truth, places = touching(np.full(600, 0.03))
    places = noisy(places, np.random.default_rng(2))
    fit = rod_fit.fit_loaded(places, mouse_c2(), CURVATURE_AT, known_rest(600))
    z = (fit["force"] - truth.contact_force) / np.sqrt(fit["force_var"])
    assert 0.92 < np.mean(np.abs(z) < 1.96) < 0.98
    assert abs(z.mean()) < 0.15
    for load in ("moment", "axial", "lateral"):
        true = getattr(truth, {"moment": "base_moment"}.get(load, f"{load}_force"))
        z = (fit["force"] * fit[f"{load}_per_force"] - true) / np.sqrt(fit[f"{load}_var"])
        assert 0.92 < np.mean(np.abs(z) < 1.96) < 0.99
        assert abs(z.mean()) < 0.15
    z = fit["gap"] / np.sqrt(fit["gap_var"])
    assert 0.92 < np.mean(np.abs(z) < 1.96) < 0.98
    both = np.cov(fit["gap"], fit["force"])[0, 1]
    assert both == pytest.approx(np.mean(fit["gap_force_cov"]), rel=0.35)


@pytest.mark.slow
@pytest.mark.parametrize("side", [1, -1])
def test_errors_of_strong_bends_are_those_of_many_draws(side):
    """At 0.4 rad, with a rest shape known to 1 1/m: SDs and covariances of 2000 draws, ± 10 %."""
    n, rng = 2000, np.random.default_rng(8)
    _, places = touching(np.full(n, 0.4), side=side)
    prior = known_rest(n, sd=1.0)
    shapes = rng.normal(0, 1.0, (n, rod_fit.N_REST))
    prior = replace(prior, drift=prior.drift + shapes)
    fit = rod_fit.fit_loaded(noisy(places, rng), mouse_c2(), CURVATURE_AT, prior)
    for load in ("moment", "axial", "lateral"):
        found = np.std(fit["force"] * fit[f"{load}_per_force"])
        stated = np.sqrt(np.mean(fit[f"{load}_var"]))
        assert stated == pytest.approx(found, rel=0.1), load
    both = np.cov(fit["gap"], fit["force"])
    assert np.mean(fit["gap_var"]) == pytest.approx(both[0, 0], rel=0.2)
    assert np.mean(fit["force_var"]) == pytest.approx(both[1, 1], rel=0.2)
    limit = 0.1 * np.sqrt(both[0, 0] * both[1, 1])
    assert np.mean(fit["gap_force_cov"]) == pytest.approx(both[0, 1], abs=limit)


def test_uncertain_rest_shape_widens_the_error():
    _, places = touching([0.03])
    sure = rod_fit.fit_loaded(places, mouse_c2(), CURVATURE_AT, known_rest(1))
    unsure = rod_fit.fit_loaded(places, mouse_c2(), CURVATURE_AT, known_rest(1, sd=3.0))
    assert unsure["force_var"][0] > 4 * sure["force_var"][0]


def test_free_whisker_has_no_force():
    truth, places = touching([-0.05, -0.01])
    assert not truth.touching.any()
    fit = rod_fit.fit_loaded(places, mouse_c2(), CURVATURE_AT, known_rest(2))
    np.testing.assert_allclose(fit["force"], 0.0, atol=1e-10)
    assert (fit["gap"] > 0.05e-3).all()


def test_rest_shape_of_free_frames():
    _, places = touching([-0.3, -0.1])
    fit = rod_fit.fit_free(places, mouse_c2(), CURVATURE_AT)
    weights = known_rest(1).weights[0]
    np.testing.assert_allclose(fit.rest, [weights] * 2, atol=1e-2)  # 1/m
    assert np.isnan(fit["force"]).all()


def test_one_wild_station_does_little():
    truth, places = touching([0.2])
    x = places.x.copy()
    places.y[0, round(7.5e-3 / places.spacing[0])] += 0.2e-3  # 5 px off, a hair that crosses
    fit = rod_fit.fit_loaded(replace(places, x=x), mouse_c2(), CURVATURE_AT, known_rest(1))
    assert fit["force"][0] == pytest.approx(truth.contact_force[0], rel=0.02)


def test_a_wild_station_moves_the_force_by_some_errors_only():
    """Sixty errors off, of a whisker as noisy as its stations' information says."""
    _, places = touching([0.2])
    places = noisy(places, np.random.default_rng(4))

    def force(off):
        y = places.y.copy()
        y[0, round(7.5e-3 / places.spacing[0])] += off * SD
        moved = replace(places, y=y)
        return rod_fit.fit_loaded(moved, mouse_c2(), CURVATURE_AT, known_rest(1))["force"][0]

    assert 1 < (force(60) - force(0)) / (force(3) - force(0)) < 10


def test_rows_that_cannot_be_fitted_are_missing_values():
    _, places = touching([0.1, 0.1, 0.1])
    places.information[0] = 0.0  # nothing measured
    places.information[1, 12:] = 0.0  # too little
    fit = rod_fit.fit_loaded(places, mouse_c2(), CURVATURE_AT, known_rest(3))
    np.testing.assert_array_equal(np.isnan(fit["force"]), [True, True, False])


@pytest.mark.parametrize(("start", "found"), [(6e-3, 6.93e-3), (12e-3, 11.07e-3)])
def test_of_two_places_square_to_the_pole_the_one_near_the_start_is_found(start, found):
    """A wave beneath a pole: two of its flanks face it alike."""
    h = 0.25e-3
    s = np.arange(73) * h
    x, y = s, 1e-3 * np.cos(2 * np.pi * s / 6e-3)
    angle = np.arctan(np.gradient(y, x))
    place = nearest_to(x, y, np.cos(angle), np.sin(angle), h, start, 9e-3, 3e-3)
    assert place == pytest.approx(found, abs=0.02e-3)


def test_a_trace_that_jumps_from_line_to_line_has_no_rod():
    """Nor does the shape at rest overflow by what a wild rod would make of it."""
    _, places = touching(np.full(40, -0.2))
    y = places.y.copy()
    jumps = np.random.default_rng(3).normal(0, 3e-3, (10, 11))
    y[:10] += np.repeat(jumps, 7, axis=1)[:, :N_STATIONS]
    wild = replace(places, y=y)
    fit = rod_fit.fit_free(wild, mouse_c2(), CURVATURE_AT)
    assert np.isnan(fit["angle"][:10]).all()
    with np.errstate(over="raise", invalid="raise", divide="raise"):
        model = rest_shape.fit_rest(
            fit.rest, fit.rest_cov, fit["angle"], np.arange(40.0), np.ones(40, bool)
        )
    assert len(model.time) == 30
    loaded = rod_fit.fit_loaded(wild, mouse_c2(), CURVATURE_AT, known_rest(40))
    assert np.isnan(loaded["force"][:10]).all()
    assert np.isfinite(loaded["force"][10:]).all()


@pytest.mark.parametrize("place", [0.5e-3, 3e-3, 6e-3, 17e-3])
def test_a_straight_trace_goes_on_straight_across_gaps_and_beyond_its_ends(place):
    h, turn = 0.25e-3, -0.6
    along = np.arange(73) * h
    x, y = 1e-3 + along * np.cos(turn), -2e-3 + along * np.sin(turn)
    seen = (along > 2e-3) & (along < 14e-3) & ~((along > 5e-3) & (along < 7e-3))
    hidden_x, hidden_y = (np.where(seen, each, np.nan) for each in (x, y))
    stations = rod_fit.Seen(hidden_x, hidden_y, seen.astype(float))
    *angles, at = rod_fit._begin(stations, np.flatnonzero(seen), place, h)
    np.testing.assert_allclose(angles, turn, atol=1e-12)
    expected = place, 1e-3 + place * np.cos(turn), -2e-3 + place * np.sin(turn)
    np.testing.assert_allclose(at, expected, atol=1e-12)


@pytest.mark.parametrize("turn", [0.0, 3.0, -3.1])
def test_a_rod_begins_with_the_turn_from_its_base_on(turn):
    """Also where the direction of the base is about to pass half a turn."""
    along = np.linspace(0, 18e-3, 73)
    angle = turn + 100 * along
    steps = np.diff(along) * np.exp(1j * (angle[1:] + angle[:-1]) / 2)
    place = np.append(0, np.cumsum(steps))
    stations = rod_fit.Seen(place.real, place.imag, np.ones(73))
    base, direction, _ = rod_fit._begin(stations, np.arange(73), 12e-3, along[1])
    assert base == pytest.approx(turn, abs=0.06)
    assert direction - base == pytest.approx(1.2, abs=0.06)


def test_a_rod_does_not_depend_on_the_row_before():
    _, places = touching([-0.2, 0.45, 0.01, 0.3, -0.1, 0.4])
    rest = known_rest(6)
    fit, turned = fine_fit(places, rest), fine_fit(places.rows(np.arange(6)[::-1]), rest)
    for name in ("force", "angle"):
        np.testing.assert_allclose(turned[name][::-1], fit[name], rtol=1e-5, atol=1e-10)


def test_a_pole_beyond_the_tip_is_one_at_the_tip():
    """As far as rods go there: the nearest place that a trace may have is the last station."""
    _, places = touching(np.full(3, -0.2))
    last = (N_STATIONS - 1) * places.spacing[0]
    at_tip, beyond = (
        rod_fit.fit_loaded(
            replace(places, nearest=np.full(3, nearest)), mouse_c2(), CURVATURE_AT, known_rest(3)
        )
        for nearest in (last, last + 3 * places.spacing[0])
    )
    for name in rod_fit.OUTPUTS:
        np.testing.assert_array_equal(at_tip[name], beyond[name])
