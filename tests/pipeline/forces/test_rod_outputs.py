"""What follows from a fitted rod, beside differences of fits to places that are moved a little.

Nothing here knows how a rod is integrated or fitted. Every place is moved in turn by a part of its
error, and every coefficient of the rest shape by a part of its own, so that the squares of what
follows add up to a variance.
"""

from dataclasses import replace

import numpy as np
import pytest
from rod_scenes import CURVATURE_AT, SD, known_rest, noisy, touching

from pipeline.forces import rod_fit
from pipeline.forces.rod_fit import N_REST
from pipeline.kinematics.stations import N_STATIONS
from whiskermodel.whisker import mouse_c2

REST_SD = 0.4  # 1/m, of every coefficient: neither known nor free
LOADS = ("moment", "axial", "lateral")
part = 0.05  # of an error, by which things are moved
tolerance = 0.015  # relative, of standard errors and derivatives
pull_tolerance = 0.06  # Gauss and Newton's derivatives, where places do not fit quite


def fitted(places, rest=None, **more):
    """Fine fits of all rows; `rest` (rows, N_REST) is added to the rest shape [1/m]."""
    prior = known_rest(len(places), sd=REST_SD)
    prior = prior if rest is None else replace(prior, drift=rest)
    return rod_fit.fit_loaded(places, mouse_c2(), CURVATURE_AT, prior, fine=True, **more)


def values(fit):
    """What has a standard error, (rows,) each."""
    out = {name: fit[name] for name in ("force", "gap", "angle", "curvature")}
    return out | {load: fit["force"] * fit[f"{load}_per_force"] for load in LOADS}


def moved_by_errors(case):
    """Changes of all values per standard error of each place and coefficient, (errors,) each."""
    _, one = touching(**case)
    known = np.flatnonzero(one.information[0] > 0)
    n = 2 * (len(known) + N_REST)
    _, places = touching(**(case | {"push": np.repeat(case["push"], n)}))
    direction = np.arctan2(np.gradient(one.y[0]), np.gradient(one.x[0]))
    x, y, rest = places.x.copy(), places.y.copy(), np.zeros((n, N_REST))
    for sign, start in ((1, 0), (-1, n // 2)):
        for i, k in enumerate(known):
            x[start + i, k] -= sign * part * SD * np.sin(direction[k])
            y[start + i, k] += sign * part * SD * np.cos(direction[k])
        for j in range(N_REST):
            rest[start + len(known) + j, j] = sign * part * REST_SD
    friction = case.get("friction", 0.0)
    found = values(fitted(replace(places, x=x, y=y), rest, friction=friction))
    return {name: (v[: n // 2] - v[n // 2 :]) / (2 * part) for name, v in found.items()}


CASES = (
    {"push": 0.35, "distance": 8e-3, "side": 1, "origin": 0.1e-3, "friction": 0.3},
    {"push": 0.2, "distance": 10e-3, "side": -1, "origin": -0.08e-3, "friction": 0.0},
)


@pytest.mark.parametrize("case", CASES)
def test_variances_are_those_of_errors_put_in(case):
    _, places = touching(**case)
    fit = fitted(places, friction=case["friction"])
    changes = moved_by_errors(case)
    for name in ("force", "gap", "angle", *LOADS):
        found = np.sqrt((changes[name] ** 2).sum())
        assert np.sqrt(fit[f"{name}_var"][0]) == pytest.approx(found, rel=tolerance), name
    both, sizes = (changes["gap"] * changes["force"]).sum(), fit["gap_var"] * fit["force_var"]
    assert fit["gap_force_cov"][0] == pytest.approx(both, abs=tolerance * np.sqrt(sizes[0]))


@pytest.mark.parametrize("case", CASES)
def test_a_shared_error_of_the_rest_shape_is_that_part_of_the_loads_variance(case):
    """As loads differ where each coefficient of the rest shape is another."""
    n = 2 * N_REST
    _, places = touching(**(case | {"push": np.repeat(case["push"], n)}))
    step = part * REST_SD * np.vstack([np.eye(N_REST), -np.eye(N_REST)])
    root = np.random.default_rng(1).normal(size=(N_REST, N_REST))
    rest = replace(known_rest(n, sd=REST_SD), shared=np.tile(root @ root.T, (n, 1, 1)))
    given = mouse_c2(), CURVATURE_AT
    fit = rod_fit.fit_loaded(places, *given, rest, case["friction"], fine=True)
    moved = values(fitted(places, step, friction=case["friction"]))
    for load in ("force", *LOADS):
        slope = (moved[load][:N_REST] - moved[load][N_REST:]) / (2 * part * REST_SD)
        found = np.linalg.norm(slope @ root)
        assert np.sqrt(fit[f"{load}_shared_var"][0]) == pytest.approx(found, rel=tolerance), load
    alone = rod_fit.fit_loaded(places, *given, replace(rest, shared=None), case["friction"])
    assert (alone["force_shared_var"] == 0).all()


@pytest.mark.parametrize("case", CASES)
def test_misfits_have_the_rods_variance(case):
    """At every station, seen or not, as the rod moves with errors put in."""
    _, places = touching(**case)
    misfit = np.empty((1, 2, N_STATIONS))
    prior = known_rest(1, sd=REST_SD)
    fit = rod_fit.fit_loaded(
        places, mouse_c2(), CURVATURE_AT, prior, case["friction"], misfit=misfit
    )
    seen = places.information[0] > 0
    assert np.abs(misfit[0, 0, seen]).max() < 1e-9
    within = misfit[0, 1, seen] / SD**2  # leverages: with the prior's they sum to the unknowns
    assert (within < 1).all()
    learnt = 1 - np.diagonal(fit.rest_cov[0]) / REST_SD**2
    assert within.sum() == pytest.approx(3 + learnt.sum(), rel=0.01)


@pytest.mark.parametrize("case", CASES)
def test_loads_follow_the_origin_as_two_fits_differ(case):
    _, places = touching(**case)
    step = 2e-6

    def at(shift):
        return fitted(places, friction=case["friction"], shift=shift)

    after, before, fit = at(step), at(-step), at(0.0)
    for load in ("force", *LOADS):
        change = (values(after)[load] - values(before)[load]) / (2 * step)
        least = tolerance * abs(fit["force_by_origin"][0]) if load != "moment" else 0.0
        np.testing.assert_allclose(
            fit[f"{load}_by_origin"], change, rtol=2 * tolerance, atol=least
        )


@pytest.mark.parametrize("case", CASES)
def test_pull_and_bend_are_slope_and_curvature_of_the_likelihood(case):
    """Of the fit's own sum of squares, stations' and rest shape's, at origins beside its own."""
    case = case | {"push": np.repeat(case["push"], 3)}
    _, places = touching(**case)
    steps = np.array([-3e-6, 0.0, 3e-6]) + 6e-6
    misfit = np.empty((3, 2, N_STATIONS))
    fit = fitted(places, friction=case["friction"], shift=steps, misfit=misfit)
    chosen = known_rest(3).weights[0]
    log_likelihood = -0.5 * (places.information * misfit[:, 0] ** 2).sum(axis=1)
    log_likelihood -= 0.5 * ((fit.rest - chosen) ** 2).sum(axis=1) / REST_SD**2
    slope = (log_likelihood[2] - log_likelihood[0]) / 6e-6
    bend = -(log_likelihood[2] - 2 * log_likelihood[1] + log_likelihood[0]) / 9e-12
    assert fit["chi2"].max() < 1
    assert fit["origin_pull"][1] == pytest.approx(slope, rel=pull_tolerance)
    assert fit["origin_bend"][1] == pytest.approx(bend, rel=pull_tolerance)


def test_errors_grow_with_a_misfit_that_noise_does_not_explain():
    """Places three times as noisy as said: errors as if that were known; not the rest shape's."""
    _, places = touching(np.full(60, 0.2))
    rng = np.random.default_rng(5)
    wild, known = places, fitted(replace(places, information=places.information / 9))
    for _ in range(9):
        wild = noisy(wild, rng)
    fit = fitted(wild)
    assert np.mean(fit["chi2"]) == pytest.approx(9.0, rel=0.1)
    for name in ("force_var", "gap_var", "angle_var"):
        assert np.median(fit[name] / known[name]) == pytest.approx(1.0, abs=0.1), name
