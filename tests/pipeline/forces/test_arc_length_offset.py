"""Where the trace begins: recovered from tip and bending; left alone where nothing shows it."""

from dataclasses import replace

import numpy as np
import pytest
import traced_motion
from line_ends import with_tip
from scipy import sparse
from usual_parameters import measure_stations

from pipeline.forces import arc_length_offset, estimate_forces, forces
from pipeline.forces.lasting_errors import LASTING_SHARE
from pipeline.kinematics import resampled
from pipeline.session.parameters import DEFAULTS
from synthetic.presets import make_trial
from whiskermodel.whisker import mouse_c2

pytestmark = pytest.mark.slow

origin_tolerance = 0.02e-3  # m
tip_tolerance = 0.04e-3  # m; the hidden length that was given counts, too
AT = 5.5e-3


@pytest.fixture(scope="module")
def touching():
    motion = make_trial("noisy", 0, 0, 500).motion
    return traced_motion.trace(motion, noise_px=0.01)


def measured_again(traced, hidden):
    """Places and kinematics where the hidden length is taken to be `hidden` [m]."""
    whiskers = list(traced.whiskers.values())
    return measure_stations(traced.lines, traced.recording, whiskers, [hidden], traced.pole)


def force_errors(traced, evidence):
    truth = traced.true_frames
    pushed = (truth["contact_force_uN"] > 3).to_numpy()
    found = 1e6 * evidence["shape_force_N"].to_numpy()[pushed]
    return found / truth["contact_force_uN"].to_numpy()[pushed] - 1


@pytest.mark.parametrize("wrong_by", [-0.15e-3, 0.0, 0.1e-3])
def test_a_wrong_hidden_length_is_found_from_the_bending(touching, wrong_by):
    places = measured_again(touching, traced_motion.HIDDEN - wrong_by)
    evidence, _ = forces.measure_forces(
        places, mouse_c2(), touching.frames, AT, params=DEFAULTS.forces
    )
    found = evidence["origin_m"].to_numpy()
    assert np.median(found) == pytest.approx(wrong_by, abs=origin_tolerance)
    assert abs(np.median(force_errors(touching, evidence))) < 0.01
    assert np.abs(np.median(found) - wrong_by) < 3 * evidence["origin_se_m"].median()


def test_ends_that_scatter_move_no_origin_where_the_fur_keeps_still(touching):
    """Ends that scatter by 0.07 mm, as those of H.264: origins follow by a sixth of it at most."""
    places = touching.places
    ends = places.last + np.random.default_rng(4).normal(0, 0.07e-3, len(places))
    blurred = replace(places, last=ends)
    origin, _ = arc_length_offset.origin_from_tip(
        blurred, mouse_c2(), times(touching), DEFAULTS.forces
    )
    assert np.std(origin.per_row) < 0.012e-3


def test_first_points_that_wander_are_seen_from_the_tip(touching):
    """Traces that begin anywhere within 0.15 mm: each row's origin follows, from the far end."""
    rng = np.random.default_rng(0)
    t = np.arange(len(touching.places))
    slow = 0.08e-3 * np.sin(2 * np.pi * t / 300)
    places = touching.places
    wandered = replace(
        places, first=places.first - slow, last=places.last - slow + rng.normal(0, 1e-5, len(t))
    )
    origin, _ = arc_length_offset.origin_from_tip(
        wandered, mouse_c2(), times(touching), DEFAULTS.forces
    )
    error = origin.per_row - slow
    assert np.std(error) < 0.2 * np.std(slow)
    # how far out the tip is seen is no evidence where what lies beyond the ends is not
    assert abs(np.mean(origin.per_row)) < 0.03e-3


def test_a_slow_wander_is_seen_through_a_codecs_ends(touching):
    """Ends that scatter by 0.1 mm, and err alike for some frames, about a slow follicle."""
    n = len(touching.places)
    slow, left = 0.08e-3 * np.sin(2 * np.pi * np.arange(n) / n), []
    for seed in range(8):
        ends = np.zeros(n)
        for k, push in enumerate(np.random.default_rng(seed).normal(0, 0.06e-3, n)):
            ends[k] = 0.8 * ends[k - 1] + push
        wandered = replace(touching.places, last=touching.places.last - slow + ends)
        origin, _ = arc_length_offset.origin_from_tip(
            wandered, mouse_c2(), times(touching), DEFAULTS.forces
        )
        left.append(np.std(origin.per_row - slow) / np.std(slow))
    assert np.mean(left) < 0.55


def times(touching):
    """Time [s] of the frames."""
    return touching.frames["time_s"].to_numpy()


def seen(places, short=traced_motion.TIP_UNSEEN):
    """The places where the tip is seen `short` [m] beyond the ends."""
    return with_tip(places, mouse_c2(), short)


@pytest.mark.parametrize("wrong_by", [-0.2e-3, 0.1e-3])
def test_a_tip_that_is_seen_corrects_the_hidden_length(touching, wrong_by):
    places = seen(measured_again(touching, traced_motion.HIDDEN - wrong_by))
    origin, _ = arc_length_offset.origin_from_tip(
        places, mouse_c2(), times(touching), DEFAULTS.forces
    )
    assert np.median(origin.per_row) == pytest.approx(wrong_by, abs=tip_tolerance)
    assert 0.02e-3 < np.median(origin.se) < 0.06e-3


@pytest.mark.parametrize("frames", [6, 20])
def test_a_handful_of_frames_shows_the_tip(touching, frames):
    places = seen(measured_again(touching, traced_motion.HIDDEN - 0.1e-3)).rows(slice(frames))
    origin, _ = arc_length_offset.origin_from_tip(
        places, mouse_c2(), times(touching)[:frames], DEFAULTS.forces
    )
    assert np.median(origin.per_row) == pytest.approx(0.1e-3, abs=tip_tolerance)


def test_a_length_that_contradicts_the_hidden_length_is_hardly_errors_in_conflict(touching):
    """A whisker that has grown by 0.7 mm since it was measured."""
    grown = seen(touching.places, traced_motion.TIP_UNSEEN + 0.7e-3)
    origin, _ = arc_length_offset.origin_from_tip(
        grown, mouse_c2(), times(touching), DEFAULTS.forces
    )
    assert abs(np.median(origin.per_row)) < 0.1e-3


def test_bending_and_tip_that_disagree_make_the_standard_error_larger(touching):
    """An end 0.2 mm nearer to the tip than it is: more than both errors explain."""
    errors = [
        forces.measure_forces(places, mouse_c2(), touching.frames, AT, params=DEFAULTS.forces)[0][
            "origin_se_m"
        ].median()
        for places in (seen(touching.places), seen(touching.places, 0.1e-3))
    ]
    assert errors[1] > 1.5 * errors[0]


def test_a_whisker_of_unknown_dimensions_has_no_tip_to_go_by(touching):
    places = seen(touching.places, 0.8e-3)
    evidence = [
        estimate_forces(touching.frames, own, {"C2": None}, AT)[1]
        for own in (places, touching.places)
    ]
    np.testing.assert_array_equal(*(each["origin_m"] for each in evidence))


@pytest.mark.parametrize("column", ["bending_origin_m", "bending_origin_se_m", "chi2"])
def test_a_whisker_of_unknown_dimensions_cannot_bend_unlike_them(touching, column):
    known, unknown = (
        estimate_forces(touching.frames, touching.places, {"C2": whisker}, AT)[1][column]
        for whisker in (mouse_c2(), None)
    )
    assert known.notna().any()
    assert unknown.isna().all()


def test_an_end_that_light_moves_is_not_taken_for_the_tip(touching):
    """The trace's end is seen farther out by up to 0.55 mm where the angle is large."""
    places = touching.places
    angle = np.radians(touching.frames["base_angle_deg"].to_numpy())
    light = 0.55e-3 * (angle - angle.min()) / np.ptp(angle)
    rng = np.random.default_rng(3)
    lit = replace(places, last=places.last + light + rng.normal(0, 1e-5, len(angle)))
    origin, _ = arc_length_offset.origin_from_tip(
        lit, mouse_c2(), times(touching), DEFAULTS.forces
    )
    assert np.std(origin.per_row) < 0.7 * np.std(light)


def test_a_tip_out_of_view_shows_nothing(touching):
    rng = np.random.default_rng(1)
    n = len(touching.places)
    cut = replace(touching.places, last=touching.places.last - rng.uniform(0, 6e-3, n))
    short = replace(touching.places, last=np.full(n, 15e-3))
    for places in (cut, short):
        origin, _ = arc_length_offset.origin_from_tip(
            places, mouse_c2(), times(touching), DEFAULTS.forces
        )
        np.testing.assert_array_equal(origin.per_row, 0.0)
        assert (origin.se > 0.1e-3).all()


def test_without_touches_the_session_is_errors_in_conflict():
    motion = make_trial("free", 0, 0, 200).motion
    traced = traced_motion.trace(motion, noise_px=0.01)
    evidence, _ = forces.measure_forces(
        traced.places, mouse_c2(), traced.frames, AT, params=DEFAULTS.forces
    )
    assert evidence["origin_m"].abs().max() < 0.05e-3
    assert evidence["origin_se_m"].median() == pytest.approx(
        1e-3 * DEFAULTS.forces.hidden_length_sd_mm, rel=0.2
    )


def test_frames_that_a_codec_interpolated_are_not_asked(touching):
    """In two of three the whisker is drawn back from its bend by 4 µm, as B frames draw it."""
    places = touching.places
    touches = touching.true_frames["in_contact"].to_numpy(bool)
    interpolated = places.frame % 3 != 0
    along = np.arange(resampled.N_STATIONS) * places.spacing[0]
    back = -places.side[:, None] * np.sign(places.nearest[:, None] - along) * 4e-6
    back = back * (touches & interpolated)[:, None]
    steps = np.gradient(places.x, axis=1), np.gradient(places.y, axis=1)
    length = np.hypot(*steps)
    x, y = places.x - back * steps[1] / length, places.y + back * steps[0] / length
    drawn = replace(places, x=x, y=y, information=np.where(np.isfinite(x), places.information, 0))
    error = {}
    for given in (False, True):
        drawn = replace(drawn, interpolated=interpolated & given)
        evidence, _ = forces.measure_forces(
            drawn, mouse_c2(), touching.frames, AT, params=DEFAULTS.forces
        )
        error[given] = abs(np.median(evidence["origin_m"]))
    assert error[True] < origin_tolerance < error[False]


def test_the_standard_error_holds_what_is_common_to_all_frames():
    """Stations drawn aside alike in every touching frame: no number of frames takes that away."""
    noisy = traced_motion.trace(make_trial("noisy", 0, 0, 500).motion, noise_px=0.1)
    touches = noisy.true_frames["in_contact"].to_numpy(bool)
    places = noisy.places
    plain, _ = forces.measure_forces(places, mouse_c2(), noisy.frames, AT, params=DEFAULTS.forces)
    noise = np.median(places.information[places.information > 0]) ** -0.5
    along = np.arange(resampled.N_STATIONS) * places.spacing[0]
    share = []
    for seed in range(6):
        waves = np.random.default_rng(seed).normal(size=(2, 8))
        turns = 2 * np.pi * np.outer(along, np.linspace(0, 0.2, 8)) / 0.25e-3
        aside = (np.cos(turns) @ waves[0] + np.sin(turns) @ waves[1]) / np.sqrt(8)
        aside = LASTING_SHARE * noise * aside * touches[:, None]
        steps = np.gradient(places.x, axis=1), np.gradient(places.y, axis=1)
        length = np.hypot(*steps)
        x, y = places.x - aside * steps[1] / length, places.y + aside * steps[0] / length
        seen = np.where(np.isfinite(x), places.information, 0.0)
        moved = replace(places, x=x, y=y, information=seen)
        evidence, _ = forces.measure_forces(
            moved, mouse_c2(), noisy.frames, AT, params=DEFAULTS.forces
        )
        change = evidence["origin_m"] - plain["origin_m"]
        share.append(np.median(change / evidence["origin_se_m"]))
    assert 0.3 < np.sqrt(np.mean(np.square(share))) < 1.3  # and it is not simply large


def some_evidence(rng, rows=12, terms=4):
    """Evidence of random, sparse design, its dense form, matrix and right-hand side."""
    dense = rng.normal(size=(rows, terms)) * (rng.random((rows, terms)) < 0.7)
    root = rng.normal(size=(terms, terms))
    matrix, rhs, tip = root @ root.T + np.eye(terms), rng.normal(size=terms), rng.random(terms)
    params = DEFAULTS.forces
    design = sparse.csr_matrix(dense)
    return arc_length_offset._Evidence(design, matrix, rhs, tip, params), dense


def test_origins_and_their_errors_are_those_of_the_normal_equations():
    evidence, dense = some_evidence(np.random.default_rng(0))
    inverse = np.linalg.inv(evidence.matrix)
    origin, weight = evidence.solve(), np.linspace(0.2, 1, 5)
    np.testing.assert_allclose(origin.per_row, dense @ inverse @ evidence.rhs)
    np.testing.assert_allclose(origin.se**2, np.diag(dense @ inverse @ dense.T))
    assert origin.per_tip == pytest.approx(np.mean(dense @ inverse @ evidence.tip))
    rows = np.arange(3, 8)
    part = weight @ dense[rows] / weight.sum()
    expected = part @ inverse @ evidence.rhs, part @ inverse @ part
    assert evidence.mean(rows, weight) == pytest.approx(expected)


def test_a_common_error_is_one_more_unknown():
    """Beside the system with that error in it, solved as a whole."""
    rng = np.random.default_rng(1)
    evidence, dense = some_evidence(rng)
    bend, pull, sd = rng.uniform(0.5, 2, 12), rng.normal(size=12), 0.3
    wider = np.column_stack([dense, np.ones(12)])
    matrix = wider.T @ (bend[:, None] * wider)
    matrix[:-1, :-1] += evidence.matrix
    matrix[-1, -1] += sd**-2
    whole = np.linalg.solve(matrix, wider.T @ pull + np.append(evidence.rhs, 0.0))
    found = evidence.beside(evidence.design, bend, pull, sd)
    np.testing.assert_allclose(found.weights(), whole[:-1])
    np.testing.assert_allclose(np.linalg.inv(found.matrix), np.linalg.inv(matrix)[:-1, :-1])


@pytest.mark.filterwarnings("error")
def test_traces_that_end_anywhere_show_no_tip(touching):
    """A tenth of the ends lie 4 mm farther out, and none about where that tenth begins."""
    n = 30
    places = touching.places.rows(slice(n))
    last = np.where(np.arange(n) < 0.9 * n, 10e-3, 14e-3)
    end, _ = arc_length_offset.trace_ends(replace(places, last=last), DEFAULTS.forces)
    assert np.isnan(end).all()


@pytest.mark.parametrize(
    ("frames", "at_tip", "known"), [(200, 52, 0), (200, 68, 68), (12, 4, 0), (12, 6, 6)]
)
def test_the_tip_is_seen_in_five_frames_and_three_tenths(touching, frames, at_tip, known):
    """The others end anywhere before."""
    places = touching.places.rows(slice(frames))
    last = np.linspace(5e-3, 12e-3, frames)
    last[:at_tip] = 17e-3
    end, _ = arc_length_offset.trace_ends(replace(places, last=last), DEFAULTS.forces)
    assert np.isfinite(end).sum() == known


def test_a_slow_camera_has_400_spans_of_time_at_most():
    """So that the normal equations stay small."""
    for seconds, knots in ((350.0, 350), (1e5, 400)):
        design = arc_length_offset._design(np.linspace(0, seconds, 2000), 1.0)
        assert design.shape == (2000, knots + 2)  # and a constant


def test_errors_that_last_count_as_fewer():
    """Of means over 10 alike, the variance is that of ten times as large a one."""
    rng = np.random.default_rng(4)
    errors = np.repeat(rng.normal(0, 2.0, 4000), 10)
    assert arc_length_offset._lasting_variance(errors) == pytest.approx(10 * 4.0, rel=0.15)
    alone = rng.normal(0, 2.0, 40000)
    assert arc_length_offset._lasting_variance(alone) == pytest.approx(4.0, rel=0.25)


def test_steadiness_is_the_inverse_of_correlations():
    place = np.arange(6)
    cov = arc_length_offset.ALIKE ** np.abs(np.subtract.outer(place, place))
    np.testing.assert_allclose(arc_length_offset._steadiness(6) @ cov, np.eye(6), atol=1e-12)


def test_pulls_that_scatter_more_than_they_say_count_less():
    rng = np.random.default_rng(6)
    bend = rng.uniform(0.5, 2, 4000)
    pull = 0.7 * bend + 3 * np.sqrt(bend) * rng.normal(size=4000)
    wide, usual = (
        arc_length_offset._noise(some, bend)
        for some in (pull, 0.7 * bend + (pull - 0.7 * bend) / 3)
    )
    assert wide == pytest.approx(9 * usual, rel=0.01)
    assert usual == pytest.approx(arc_length_offset.CORRELATED_FRAMES, rel=0.1)
    calm = arc_length_offset._noise(0.7 * bend, bend)
    assert calm == pytest.approx(0.5 * usual, rel=0.1)


def test_the_bendings_answer_is_as_uncertain_as_the_stations(touching):
    """A fifth of the noise: a fifth of the standard error, or nearly so."""
    sharp = traced_motion.trace(make_trial("noisy", 0, 0, 500).motion, noise_px=0.002)
    usual, sharper = (
        forces.measure_forces(each.places, mouse_c2(), each.frames, AT, params=DEFAULTS.forces)[0][
            "bending_origin_se_m"
        ]
        for each in (touching, sharp)
    )
    assert sharper.median() < 0.3 * usual.median()


@pytest.mark.parametrize("away", [0.05e-3, 0.3e-3, 0.45e-3, 1.5e-3])
def test_a_contradicted_length_is_believed_as_far_as_it_is_likely_to_be_right(away):
    """Beside the posterior of the origin on a grid, mean and SD within 1 µm.

    Prior: hidden length; likelihood: a tip that is right, or wrong by an SD that explains `away`.
    """
    hidden, tip, wrong = 0.12e-3, 0.06e-3, arc_length_offset.LENGTH_WRONG
    grid = np.linspace(-1e-3, 3e-3, 40001)

    def bell(x, sd):
        return np.exp(-0.5 * (x / sd) ** 2) / sd

    wild = max(np.sqrt(max(away**2 - hidden**2, 0)), tip)
    likely = bell(grid - away, tip) + wrong * bell(grid - away, wild)
    posterior = bell(grid, hidden) * (
        likely if away > np.hypot(hidden, tip) else bell(grid - away, tip)
    )
    posterior /= posterior.sum()
    mean = posterior @ grid
    spread = np.sqrt(posterior @ (grid - mean) ** 2)
    sources = np.array(arc_length_offset._errors_in_conflict(away, hidden, tip))
    weight = sources**-2
    assert weight[1] * away / weight.sum() == pytest.approx(mean, abs=1e-6)
    assert weight.sum() ** -0.5 == pytest.approx(spread, abs=1e-6)


def test_a_tip_that_is_nowhere_contradicts_nothing():
    assert arc_length_offset._errors_in_conflict(1e-3, 0.12e-3, np.inf) == (0.12e-3, np.inf)


def test_a_pole_that_is_off_moves_the_answer_by_six_times_as_much():
    gap, side = np.array([2e-6, 2e-6, -5e-6, np.nan]), np.array([1, 1, -1, 1])
    assert arc_length_offset._misplaced_sd(gap, side) == pytest.approx(30e-6)
    assert arc_length_offset._misplaced_sd(np.full(4, np.nan), side) == 0.0
