"""Rest values from free frames: truth recovered, outliers ignored, errors that cover."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal, norm

from pipeline.forces import rest_shape
from pipeline.forces.rest_shape import fit_rest, free_frames
from pipeline.session.parameters import DEFAULTS

noise = 0.4  # 1/m


def whisking(n, rng):
    t = np.arange(n) / 1000
    return t, 0.4 * np.sin(2 * np.pi * 9 * t) * (0.8 + 0.2 * np.sin(7 * t)) + rng.normal(
        0, 0.01, n
    )


def true_rest(angle, time, drift=0.0):
    return 22.0 + 15.0 * angle - 12.0 * angle**2 + drift * np.sin(time)


@pytest.mark.parametrize("drift", [0.0, 2.0])
def test_recovers_rest_as_function_of_angle_and_time(drift):
    rng = np.random.default_rng(0)
    time, angle = whisking(4000, rng)
    truth = true_rest(angle, time, drift)
    measured = truth + rng.normal(0, noise, len(time))
    free = angle < 0.15  # touches lie at the other angles
    model = fit_rest(measured, np.full(len(time), noise**2), angle, time, free)
    values, cov = model.predict(angle, time)
    error = values[:, 0] - truth
    assert np.abs(error[free]).max() < (0.3 if drift == 0 else 0.5)  # 1/m
    assert np.abs(error).max() < 0.7  # beyond the angles of the free frames
    assert np.sqrt(cov[:, 0, 0]).max() < 0.7


def test_touched_frames_among_the_free_do_not_matter():
    rng = np.random.default_rng(1)
    time, angle = whisking(2000, rng)
    truth = true_rest(angle, time)
    measured = truth + rng.normal(0, noise, len(time))
    measured[angle > 0.2] += 30.0  # pushed
    model = fit_rest(measured, np.full(len(time), noise**2), angle, time, np.full(2000, True))
    free = angle < 0.2
    assert np.abs(model.predict(angle, time)[0][:, 0] - truth)[free].max() < 0.4


def test_errors_cover_and_grow_where_nothing_was_seen():
    z, inside, outside = [], [], []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        time, angle = whisking(400, rng)
        # true scatter of the rest value, changing slowly as real ones do, on top of the noise
        own = np.convolve(rng.normal(0, 1, 400 + 19), np.ones(20) / 20, "valid") * 2.0
        truth = 22.0 + 15.0 * angle
        measured = truth + own + rng.normal(0, noise, 400)
        model = fit_rest(measured, np.full(400, noise**2), angle, time, angle < 0.1)
        at = np.array([0.0, 0.9])
        values, cov = model.predict(at, np.array([0.2, 0.2]))
        wanted = 22.0 + 15.0 * at[0] + own[200]
        z.append((values[0, 0] - wanted) / np.sqrt(cov[0, 0, 0]))
        inside.append(cov[0, 0, 0])
        outside.append(cov[1, 0, 0])
    assert 0.85 <= np.mean(np.abs(z) < 1.96) <= 1.0
    assert np.median(outside) > 1.5 * np.median(inside)


def test_several_values_at_once_are_each_alone():
    rng = np.random.default_rng(2)
    time, angle = whisking(1500, rng)
    one = 10.0 + 5.0 * angle + rng.normal(0, 0.1, 1500)
    two = -3.0 + 50.0 * angle + rng.normal(0, 0.5, 1500)
    both = fit_rest(
        np.column_stack([one, two]), np.full((1500, 2), 0.01), angle, time, np.full(1500, True)
    )
    values, cov = both.predict(np.array([0.1]), np.array([0.5]))
    np.testing.assert_allclose(values[0], [10.5, 2.0], atol=0.1)
    assert cov.shape == (1, 2, 2)
    assert np.all(np.linalg.eigvalsh(cov[0]) > 0)


def test_too_few_free_frames_are_none():
    angle = np.linspace(0, 1, 50)
    few = np.arange(50) < rest_shape.FEWEST_FRAMES - 1
    assert fit_rest(angle, np.ones(50), angle, angle, few) is None
    lost = np.where(few, 1.0, np.nan)
    assert fit_rest(lost, np.ones(50), angle, angle, np.full(50, True)) is None


def test_unmoved_whisker_needs_no_angle():
    rng = np.random.default_rng(3)
    values = 7.0 + rng.normal(0, noise, 300)
    time = np.arange(300) / 1000
    model = fit_rest(values, np.full(300, noise**2), np.zeros(300), time, np.full(300, True))
    assert model.predict(np.zeros(1), np.zeros(1))[0][0, 0] == pytest.approx(7.0, abs=0.1)


def test_free_frames_are_far_or_without_pole():
    distance = np.array([0.0, 0.1e-3, 0.5e-3, np.nan, 0.0])
    known = np.array([True, True, True, True, False])
    np.testing.assert_array_equal(
        free_frames(distance, known, DEFAULTS.forces), [False, False, True, False, True]
    )


def test_free_frames_of_a_whisker_that_hardly_leaves_the_pole():
    rng = np.random.default_rng(6)
    away = np.where(np.arange(300) < 20, 25e-6, 0.0)  # m
    distance = 12e-6 + away + rng.normal(0, 0.5e-6, 300)
    known = np.full(300, True)
    np.testing.assert_array_equal(free_frames(distance, known, DEFAULTS.forces), away > 0)
    # a force that moves it by so little says nothing of free frames
    swaying = 12e-6 + 5e-6 * np.sin(np.arange(300) / 9) + rng.normal(0, 0.5e-6, 300)
    assert not free_frames(swaying, known, DEFAULTS.forces).any()


def at_rest(n, rng, swing=0.002):
    """Free frames of a whisker that hardly moves: time [s] and base angle [rad]."""
    return np.arange(n) / 1000, 0.1 + rng.normal(0, swing, n)


def test_shape_is_kept_at_angles_that_no_free_frame_had():
    rng = np.random.default_rng(5)
    time, angle = at_rest(250, rng)
    measured = 12.0 + rng.normal(0, noise, 250)
    model = fit_rest(measured, np.full(250, noise**2), angle, time, np.full(250, True))
    away = 0.1 + np.array([0.0, 0.1, 0.2, 0.4, 0.8])  # rad
    values, cov = model.predict(away, np.full(5, 0.26))
    error = np.sqrt(cov[:, 0, 0])
    np.testing.assert_allclose(values[:, 0], 12.0, atol=0.3)  # 1/m
    assert error[0] < 0.5
    assert np.all(np.diff(error) > 0)


def test_errors_at_unseen_angles_are_what_rolling_can_do():
    """12 1/m per rad and per rad²; no slope, a slope, and a bend as well are as likely."""
    rng = np.random.default_rng(15)
    time, angle = at_rest(250, rng)
    measured = 12.0 + rng.normal(0, noise, 250)
    model = fit_rest(measured, np.full(250, noise**2), angle, time, np.full(250, True))
    turn = np.array([0.5, 2.0])  # rad; of the first, three quarters are the slope's
    cov = model.predict(model.centre + turn, np.full(2, 0.12))[1]
    expected = 12.0 * np.sqrt(2 / 3 * turn**2 + turn**4 / 3)
    np.testing.assert_allclose(np.sqrt(cov[:, 0, 0]), expected, rtol=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("turn", [0.0, 0.15, 0.4])
def test_errors_cover_whiskers_that_roll(turn):
    z = []
    for seed in range(80):
        rng = np.random.default_rng(seed)
        time, angle = at_rest(200, rng, swing=0.01)
        slope = rng.normal(0, 0.7 * rest_shape.TURNING_SD)
        measured = 15.0 + slope * (angle - 0.1) + rng.normal(0, noise, 200)
        model = fit_rest(measured, np.full(200, noise**2), angle, time, np.full(200, True))
        values, cov = model.predict(np.array([0.1 + turn]), time[-1:])
        z.append((values[0, 0] - 15.0 - slope * turn) / np.sqrt(cov[0, 0, 0]))
    assert np.mean(np.abs(z) < 1.96) >= 0.9


@pytest.mark.parametrize("n", [3, 5, 12])
def test_a_handful_of_free_frames_is_enough(n):
    error, stated = [], []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        time, angle = at_rest(n, rng)
        measured = 12.0 + rng.normal(0, noise, n)
        model = fit_rest(measured, np.full(n, noise**2), angle, time, np.full(n, True))
        values, cov = model.predict(np.array([0.1]), time[-1:])
        error.append(values[0, 0] - 12.0)
        stated.append(np.sqrt(cov[0, 0, 0]))
    assert np.std(error) < 1.5 * noise
    assert np.mean(np.abs(error) < 1.96 * np.array(stated)) >= 0.9
    assert np.max(stated) < 5 * noise


def test_many_angles_override_the_prior():
    rng = np.random.default_rng(6)
    time, angle = whisking(3000, rng)
    slope = 5 * rest_shape.TURNING_SD
    measured = 12.0 + slope * angle + rng.normal(0, noise, 3000)
    model = fit_rest(measured, np.full(3000, noise**2), angle, time, np.full(3000, True))
    values, _ = model.predict(np.array([-0.3, 0.3]), np.ones(2))
    assert np.diff(values[:, 0])[0] / 0.6 == pytest.approx(slope, rel=0.02)


def test_noise_that_two_values_share_is_no_scatter():
    """Errors of the fit that cancel in a sum leave the sum as well known as it was measured."""
    rng = np.random.default_rng(7)
    shared = rng.normal(0, 1.0, 800)
    values = np.column_stack([10 + shared, 5 - shared]) + rng.normal(0, 0.1, (800, 2))
    cov = np.array([[1.01, -1.0], [-1.0, 1.01]])
    time, angle = whisking(800, rng)
    model = fit_rest(values, np.tile(cov, (800, 1, 1)), angle, time, np.full(800, True))
    _, stated = model.predict(np.zeros(1), time[400:401])
    assert np.sqrt(stated[0].sum()) < 0.1  # 1/m, of the sum
    assert np.sqrt(np.linalg.eigvalsh(model.scatter).max()) < 0.4


def test_model_by_another_angle_says_the_same():
    rng = np.random.default_rng(8)
    time, angle = whisking(2000, rng)
    both = np.column_stack([20 + 15 * angle - 8 * angle**2, 3 - 6 * angle])
    both += rng.normal(0, 0.05, both.shape)
    model = fit_rest(both, np.full(both.shape, 0.05**2), angle, time, np.full(2000, True))
    lean = np.array([4e-3, -7e-3])  # rad m
    turned = rest_shape.by_leaning_angle(model, lean)
    at = np.linspace(-0.4, 0.4, 9)
    expected = model.predict(at, np.ones(9))[0]
    found = turned.predict(at + expected @ lean, np.ones(9))[0]
    np.testing.assert_allclose(found, expected, atol=0.05)  # 1/m


def test_frames_clear_of_a_touch_are_free_where_none_is_far():
    rng = np.random.default_rng(9)
    touching = np.arange(300) % 60 < 15
    level = 0.01e-3  # where a touch lies as the pole was measured
    swing = np.abs(np.sin(np.arange(300) / 20)) * 0.15e-3
    distance = level + np.where(touching, 0.0, swing) + rng.normal(0, 1e-6, 300)
    free = free_frames(distance, np.full(300, True), DEFAULTS.forces)
    assert not free[touching].any()
    assert free[~touching & (swing > 0.08e-3)].all()
    # a few far ones, all of one angle, do not shut the others out
    distance[-30:] = 0.3e-3
    assert free_frames(distance, np.full(300, True), DEFAULTS.forces).sum() >= free[:-30].sum()
    # nor do some that went astray, into the pole, make touches free
    distance[5:17] = -0.2e-3
    assert not free_frames(distance, np.full(300, True), DEFAULTS.forces)[
        touching & (distance > -0.1e-3)
    ].any()
    always = level + rng.normal(0, 5e-6, 300)
    assert not free_frames(always, np.full(300, True), DEFAULTS.forces).any()


def test_errors_of_the_drift_are_those_of_correlated_frames():
    """Ten neighbouring frames share an error; the drift, of which there is none, scatters so."""
    n, sd, found, stated = 5000, 0.5, [], []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        time, angle = whisking(n, rng)
        values = np.repeat(rng.normal(0, sd, n // 10), 10)
        model = rest_shape.fit_rest(values, np.full(n, sd**2), angle, time, np.ones(n, bool))
        middle = time[n // 2 : n // 2 + 1]
        found.append(model.drift(middle)[0, 0])
        _, cov = model.predict(np.array([model.centre]), middle)
        stated.append((cov[0] - model.scatter - model.weights_cov[0, :, 0])[0, 0])
    assert 0.6 < np.sqrt(np.mean(stated)) / np.std(found) < 2.5


@pytest.mark.parametrize(("frames", "every"), [(900, 1), (1900, 1), (2000, 2), (90_000, 10)])
def test_of_many_free_frames_one_of_some_neighbours_is_looked_at(frames, every):
    rows = np.arange(7, 7 + frames)
    np.testing.assert_array_equal(rest_shape.enough(rows), rows[::every])


def test_the_drift_is_a_line_through_what_lies_near_in_time():
    """Gaussian weights of 0.3 s; eight frames without a drift are added to level and slope."""
    rng = np.random.default_rng(11)
    time = np.sort(rng.uniform(0, 3, 700))
    time = time[(time < 1.2) | (time > 2.0)]
    residual = np.column_stack([np.sin(3 * time), 2 - time]) + rng.normal(0, 0.1, (len(time), 2))
    share, at = rng.uniform(0.2, 1, len(time)), np.array([0.05, 0.7, 1.4, 1.7, 2.9])
    found, frames = rest_shape._smooth(time, residual, share, at)
    for k, middle in enumerate(at):
        u = (time - middle) / 0.3
        design = np.stack([np.ones(len(u)), u], axis=1)
        weighted = design * (share * np.exp(-0.5 * u**2))[:, None]
        square = weighted.T @ design + 8 * np.eye(2)
        line = np.linalg.solve(square, weighted.T @ residual)
        np.testing.assert_allclose(found[k], line[0], atol=0.02)  # bins are 0.06 s
        assert frames[k] == pytest.approx(1 / np.linalg.inv(square)[0, 0], rel=0.03)


def test_without_free_frames_there_is_no_drift():
    drift, frames = rest_shape._smooth(np.zeros(0), np.zeros((0, 2)), np.zeros(0), np.arange(3.0))
    np.testing.assert_array_equal(drift, np.zeros((3, 2)))
    np.testing.assert_array_equal(frames, [8, 8, 8])


def test_polynomials_are_averaged_by_the_probability_of_what_was_seen():
    """Of all values at once; mean and covariance are those of the mixture."""
    rng = np.random.default_rng(12)
    n, share, precision = 14, rng.uniform(0.3, 1, 14), np.array([0.01, 0.5, 2.0])
    noise = np.array([[0.3, 0.1], [0.1, 0.2]])
    powers = rng.uniform(-1, 1, n)[:, None] ** np.arange(3)
    values = powers @ np.array([[2.0, -1.0], [0.7, 0.2], [0.1, 0.3]])
    values += rng.multivariate_normal(np.zeros(2), noise, n)
    weights, cov, degrees = rest_shape._averaged(powers, values, share, noise, precision)
    errors = np.kron(np.diag(1 / share), noise)
    means, covs, density = np.zeros((3, 6)), np.zeros((3, 6, 6)), np.zeros(3)
    for degree in range(3):
        design = np.kron(powers[:, : degree + 1], np.eye(2))
        prior = np.diag(np.repeat(1 / precision[: degree + 1], 2))
        seen = design @ prior @ design.T + errors
        gain, own = prior @ design.T @ np.linalg.inv(seen), slice(0, 2 * degree + 2)
        means[degree, own] = gain @ values.ravel()
        covs[degree, own, own] = prior - gain @ design @ prior
        density[degree] = multivariate_normal.pdf(values.ravel(), np.zeros(2 * n), seen)
    share_of = density / density.sum()
    assert share_of.max() < 0.98
    np.testing.assert_allclose(degrees, share_of, rtol=1e-6)
    mean = share_of @ means
    np.testing.assert_allclose(weights.ravel(), mean, rtol=1e-6)
    spread = sum(
        p * (c + np.outer(m - mean, m - mean))
        for p, c, m in zip(share_of, covs, means, strict=True)
    )
    np.testing.assert_allclose(cov.reshape(6, 6), spread, rtol=1e-6, atol=1e-12)


def test_what_is_predicted_has_all_its_errors():
    """Of weights, of true scatter, and of a drift that four frames show as one."""
    rng = np.random.default_rng(13)
    time, angle = whisking(600, rng)
    values = np.column_stack([true_rest(angle, time), 3 + 5 * angle]) + rng.normal(
        0, noise, (600, 2)
    )
    model = fit_rest(values, np.full((600, 2), 0.1), angle, time, np.ones(600, bool))
    at, when = np.array([-0.2, 0.3]), np.array([0.1, 0.4])
    found, cov = model.predict(at, when)
    turning = model.turning_cov(at)
    for k in range(2):
        powers = ((at[k] - model.centre) / model.scale) ** np.arange(3)
        design = np.kron(powers[:, None], np.eye(2))
        known = model.weights_cov.reshape(6, 6)
        _, frames = rest_shape._smooth(model.time, model.residual, model.share, when[k : k + 1])
        expected = design.T @ known @ design + model.scatter + 4 / frames[0] * model.noise
        np.testing.assert_allclose(cov[k], expected, rtol=1e-9)
        np.testing.assert_allclose(turning[k], design[2:].T @ known[2:, 2:] @ design[2:])
        np.testing.assert_allclose(found[k], powers @ model.weights + model.drift(when)[k])
    np.testing.assert_allclose(np.diag(model.noise), noise**2, rtol=0.35)  # outliers count less
    np.testing.assert_allclose(np.diag(model.noise - model.scatter), 0.1, rtol=0.01)


@pytest.mark.parametrize(
    ("away", "least", "most"), [(6.7, 0.05, 0.95), (4.7, 0, 0.1), (8.7, 0.9, 1)]
)
def test_frames_eight_times_their_scatter_beyond_the_nearest_are_free(away, least, most):
    """`away`: in standard deviations of the distance; touches scatter as well, by some 1.5."""
    rng, sd = np.random.default_rng(16), 12e-6
    clear = np.arange(600) % 200 >= 100
    distance = sd * (np.where(clear, away, 0.0) + rng.normal(0, 1, 600))
    free = free_frames(distance, np.full(600, True), DEFAULTS.forces)
    assert least <= np.mean(free[clear]) <= most


@pytest.mark.parametrize(
    ("far", "clear", "alone"),
    [(17, 20, False), (23, 20, True), (90, 310, False), (110, 290, True)],
)
def test_far_frames_count_alone_where_they_are_many(far, clear, alone):
    """At least 20, and a quarter of all that are clear of a touch."""
    parts = np.full(100, 0.0), np.full(far, 1e-3), np.full(clear, 0.15e-3)
    free = free_frames(np.concatenate(parts), np.full(100 + far + clear, True), DEFAULTS.forces)
    assert free.sum() == (far if alone else far + clear)


@pytest.mark.parametrize(("astray", "nearest"), [(8, 0.01e-3), (12, -0.2e-3)])
def test_the_nearest_distance_is_one_that_many_frames_have(astray, nearest):
    """Of 100 touches; what fewer than a tenth as many show went astray."""
    rng = np.random.default_rng(14)
    parts = np.full(100, 0.01e-3), np.full(astray, -0.2e-3), rng.uniform(0.3e-3, 3e-3, 400)
    distance = rng.permutation(np.concatenate(parts))
    assert rest_shape._nearest(distance, 20e-6, 0.5e-3) == pytest.approx(nearest)


def test_a_prior_draws_the_polynomial_to_zero_by_the_errors_of_frames():
    """Ridge regression, where no frame lies far off; errors are 2 1/m, of one value 1 1/m."""
    u, precision = np.linspace(-1, 1, 9), np.array([0.02, 0.5, 1.0])
    powers, errors = u[:, None] ** np.arange(3), np.array([2.0, 1.0])
    values = np.column_stack([0.5 + 0.3 * u, 0.2 - 0.2 * u])
    start = np.zeros((3, 2))
    weights, share = rest_shape._robust_polynomial(powers, values, precision, errors, start, 8)
    np.testing.assert_allclose(share, 1.0, atol=0.05)
    for k, error in enumerate(errors):
        square = powers.T @ powers + error**2 * np.diag(precision)
        expected = np.linalg.solve(square, powers.T @ values[:, k])
        np.testing.assert_allclose(weights[:, k], expected, atol=0.01)


def test_other_values_are_smoothed_as_the_rest_shape_was():
    """What free frames show of a slope over the angle, and of a slow change, twice as large."""
    rng = np.random.default_rng(8)
    n, noise = 800, 0.02
    time, angle = np.arange(n) / 500, 0.2 * np.sin(np.arange(n) / 9)
    shape = 20 + 6 * angle + 0.5 * np.sin(time)
    free = np.arange(n) % 3 > 0
    measured = shape + noise * rng.normal(size=n)
    model = fit_rest(measured, np.full(n, noise**2), angle, time, free)
    np.testing.assert_array_equal(model.rows, np.flatnonzero(free))
    again = model.smoother(2 * measured[model.rows, None])(angle, time)
    values, _ = model.predict(angle, time)
    np.testing.assert_allclose(again, 2 * values, rtol=0, atol=2 * noise)


def test_rest_shapes_of_any_size_are_found_as_they_are():
    """Also where few frames show them, and badly."""
    rng = np.random.default_rng(17)
    time, angle = at_rest(5, rng)
    measured, variance = rng.normal(0, 50, 5), np.full(5, 50.0**2)
    found = [
        fit_rest(measured + size, variance, angle, time, np.full(5, True)).predict(angle, time)[0]
        for size in (0.0, 800.0)
    ]
    np.testing.assert_allclose(found[1] - found[0], 800, rtol=1e-6)


def test_outliers_are_left_out_at_five_percent_of_the_exactness():
    """In normal noise the mean of these frames is 95 % as exact as that of all (variances)."""
    rng, n = np.random.default_rng(18), 4000
    z = rng.permutation(norm.ppf((np.arange(n) + 0.5) / n))
    still = np.zeros(n)
    share = fit_rest(z, np.ones(n), still, np.arange(n) / 1000, np.full(n, True), 0).share
    pull = share * z  # of each frame on the mean; its variance is this one's over slope²
    assert np.mean(pull * z) ** 2 / np.mean(pull**2) == pytest.approx(0.95, abs=0.01)


def test_frames_that_lie_on_the_same_pixels_share_an_error():
    """A sweep over 25 px/mm, seen 5 mm from the base: each pixel adds an error of its own."""
    rng, pixel = np.random.default_rng(19), 1 / 25 / 5  # rad
    n, sweep, z = 1500, 0.16, []
    angle = sweep * np.abs((np.arange(n) / 300) % 2 - 1)
    of_pixel = (angle / pixel).astype(int)
    for _ in range(60):
        errors = rng.normal(0, noise, (of_pixel.max() + 1, 8))[of_pixel]
        model = fit_rest(errors, np.full((n, 8), noise**2), angle, np.arange(n) / 1000, angle >= 0)
        z.append(model.weights[0] / np.sqrt(np.diag(model.weights_cov[0, :, 0])))
    assert 0.95 < np.sqrt(np.mean(np.square(z))) < 1.1
