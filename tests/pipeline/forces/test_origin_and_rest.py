"""Origin and rest shape in one estimate: the same as all unknowns in one system."""

from dataclasses import replace

import numpy as np
import pytest
import traced_motion
from rod_scenes import CURVATURE_AT, known_rest, touching
from scipy import sparse
from scipy.interpolate import CubicSpline

from pipeline.forces import forces, origin_and_rest, rod_fit
from pipeline.kinematics.stations import N_STATIONS
from pipeline.session.parameters import DEFAULTS
from synthetic.presets import make_trial
from whiskermodel.whisker import mouse_c2

N_REST, ROWS, TERMS, DEGREES = rod_fit.N_REST, 20, 4, 2


def some_prior(rng):
    """Rest shape of ROWS rows, a polynomial of DEGREES terms, of random uncertainty."""
    root = rng.normal(size=(DEGREES * N_REST,) * 2)
    weights_cov = (root @ root.T).reshape(DEGREES, N_REST, DEGREES, N_REST)
    powers = rng.uniform(-1, 1, ROWS)[:, None] ** np.arange(DEGREES)
    shared = np.einsum("nk,kvlw,nl->nvw", powers, weights_cov, powers)
    weights = rng.normal(0, 10, (DEGREES, N_REST))
    cov = shared + np.eye(N_REST)
    drift = np.zeros((ROWS, N_REST))
    return rod_fit.RestPrior(weights, 0.0, 1.0, drift, cov, weights_cov, powers)


def mean_of_free(design):
    """As where the rest shape is the mean of the first 8 rows'."""
    return lambda rows: np.tile(design.toarray()[:8].mean(axis=0), (len(rows), 1))


def some_unknowns(rng):
    """As known before: of a random design, in units in which all numbers are about one."""
    dense = rng.normal(size=(ROWS, TERMS))
    root = rng.normal(size=(TERMS, TERMS))
    whisker = replace(mouse_c2(), length=20.0, cone_length=40.0)
    given = root @ root.T, some_prior(rng), whisker, mean_of_free, 0.7
    before = origin_and_rest.OriginAndRest.before(sparse.csr_matrix(dense), *given)
    return before, dense, given[1]


def maps(before, dense, prior):
    """How each row's origin and rest shape follow the unknowns but the pole's place, by hand."""
    out = np.zeros((ROWS, 1 + N_REST, TERMS + DEGREES * N_REST))
    for row in range(ROWS):
        out[row, 0, :TERMS] = dense[row]
        out[row, 1:, :TERMS] = np.outer(before.slide, dense[row] - dense[:8].mean(axis=0))
        for degree in range(DEGREES):
            first = TERMS + degree * N_REST
            part = prior.powers[row, degree] * np.eye(N_REST)
            out[row, 1:, first : first + N_REST] = part
    return out


def shown(rng, rows):
    root = rng.normal(size=(len(rows), 1 + N_REST, 1 + N_REST))
    return root @ root.transpose(0, 2, 1), rng.normal(size=(len(rows), 1 + N_REST))


def test_rows_update_all_unknowns_at_once():
    """Beside the whole system's normal equations."""
    rng = np.random.default_rng(0)
    before, dense, prior = some_unknowns(rng)
    rows = np.arange(8, 17)
    information, pull = shown(rng, rows)
    after = before.given(rows, information, pull)
    pole = np.eye(1 + N_REST)[:, :1] + np.zeros((len(rows), 1, 1))
    seen = np.concatenate([maps(before, dense, prior)[rows], pole], axis=2)
    matrix = np.linalg.inv(before.cov) + np.einsum("nai,nab,nbj->ij", seen, information, seen)
    np.testing.assert_allclose(after.cov, np.linalg.inv(matrix), rtol=1e-6, atol=1e-9)
    expected = np.linalg.solve(matrix, np.einsum("nai,na->i", seen, pull))
    np.testing.assert_allclose(after.change, expected, rtol=1e-6, atol=1e-9)


def test_each_rows_rest_shape_follows_its_origin_as_they_vary_together():
    """Moves with the origin, and scatters beside it, as the joint covariance says."""
    rng = np.random.default_rng(1)
    before, dense, prior = some_unknowns(rng)
    after = before.given(np.arange(8, 17), *shown(rng, np.arange(8, 17)))
    seen = maps(before, dense, prior)
    joint = seen @ after.cov[:-1, :-1] @ seen.transpose(0, 2, 1)
    origin, error, rest = after.of_rows(prior)
    np.testing.assert_allclose(error**2, joint[:, 0, 0])
    change = seen @ after.change[:-1]
    np.testing.assert_allclose(origin, change[:, 0])
    np.testing.assert_allclose(rest.drift, change[:, 1:])
    follows = joint[:, 1:, 0] / joint[:, :1, 0]
    np.testing.assert_allclose(rest.by_origin, follows)
    beside = joint[:, 1:, 1:] - follows[:, :, None] * joint[:, None, 0, 1:]
    np.testing.assert_allclose(rest.cov, np.eye(N_REST) + beside, rtol=1e-6, atol=1e-8)
    np.testing.assert_allclose(rest.shared, beside, rtol=1e-6, atol=1e-8)


def test_rows_alone_ask_nobody_else_of_the_origin():
    """Whatever is known of it beforehand: the same answer, from rows that are sure."""
    rng = np.random.default_rng(2)
    before, _, _ = some_unknowns(rng)
    rows = np.arange(8, 17)
    information, pull = shown(rng, rows)
    sure = replace(before, cov=np.diag([*[1e-4] * TERMS, *np.diag(before.cov)[TERMS:]]))
    vague = replace(sure, cov=sure.cov + np.diag([*[1.0] * TERMS, *[0.0] * (N_REST * 2 + 1)]))
    found = [each.by_rows_alone(rows, information, pull) for each in (sure, vague)]
    assert found[0] == pytest.approx(found[1])
    assert found[0][1] > before.cov[-1, -1] ** 0.5 / 2  # a misplaced pole leaves an error


def test_what_rows_show_is_the_slope_of_their_likelihood():
    """By difference of the prior's rest shape, and of the origin."""
    _, places = touching(np.array([0.05, 0.12]))
    rest = known_rest(2, sd=0.3)

    def found(more, shift=0.0):
        prior = replace(rest, weights=rest.weights + more)
        given = mouse_c2(), CURVATURE_AT, prior
        return origin_and_rest.shown_by(
            rod_fit.fit_loaded(places, *given, shift=shift, fine=True), prior
        )

    information, _ = found(0.0)
    for j, step in enumerate([1e-6, *[0.02] * N_REST]):
        more = step * np.eye(1 + N_REST)[j]
        low, high = (found(sign * more[1:], sign * more[0])[1] for sign in (-1, 1))
        scale = np.sqrt(information[:, range(5), range(5)] * information[:, j, j, None])
        change = (high - low) / (2 * step)
        assert (np.abs(change + information[:, j]) < 0.02 * scale).all()


def test_loads_follow_a_rest_shape_that_moves_along_with_the_origin():
    _, places = touching(np.array([0.05, 0.12]))
    slope, step = np.array([2000.0, -500.0, 300.0, 0.0]), 5e-6  # 1/m²
    rest = replace(known_rest(2, sd=0.3), by_origin=np.tile(slope, (2, 1)))

    def found(shift):
        moved = replace(rest, weights=rest.weights + shift * slope)
        return rod_fit.fit_loaded(places, mouse_c2(), CURVATURE_AT, moved, shift=shift, fine=True)[
            "force"
        ]

    by_origin = rod_fit.fit_loaded(places, mouse_c2(), CURVATURE_AT, rest)["force_by_origin"]
    difference = (found(step) - found(-step)) / (2 * step)
    np.testing.assert_allclose(by_origin, difference, rtol=0.01)
    still = rod_fit.fit_loaded(places, mouse_c2(), CURVATURE_AT, known_rest(2, sd=0.3))
    assert (np.abs(still["force_by_origin"] / difference - 1) > 0.03).all()


@pytest.mark.slow
def test_faint_touches_are_right_where_the_furs_edge_wanders():
    """A whisker whose curvature grows along it, seen from another place as time goes on."""
    traced = traced_motion.trace(make_trial("faint_touch", 0, 0, 250).motion, noise_px=0.01)
    places, time = traced.places, traced.frames["time_s"].to_numpy()
    wander = 60e-6 * np.sin(2 * np.pi * time / (1.5 * np.ptp(time)))
    arc = np.arange(N_STATIONS) * places.spacing[0]
    x, y = places.x.copy(), places.y.copy()
    for row, away in enumerate(wander):
        known = np.flatnonzero(places.information[row] > 0)
        for each in (x, y):
            each[row, known] = CubicSpline(arc[known], each[row, known])(arc[known] + away)
    ends = np.random.default_rng(0).normal(0, 0.3e-3, len(places))  # that show nothing of it
    moved = replace(places, x=x, y=y, last=places.last + ends, nearest=places.nearest - wander)
    evidence, _ = forces.measure_forces(
        moved, mouse_c2(), traced.frames, CURVATURE_AT, params=DEFAULTS.forces
    )
    truth = traced.true_frames["contact_force_uN"].to_numpy()
    pushed = truth > 0.05
    off = (1e6 * evidence["shape_force_N"].to_numpy() - truth)[pushed]
    error = 1e6 * evidence["shape_force_se_N"].to_numpy()[pushed]
    assert np.median(np.abs(off) / truth[pushed]) < 0.007
    assert np.mean(np.abs(off) < 1.96 * error) > 0.94
