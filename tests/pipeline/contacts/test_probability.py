"""What one frame says about touch: densities integrated directly, an offset and scatter learnt."""

import numpy as np
import pandas as pd
import pytest
from scipy.integrate import quad
from scipy.stats import expon, norm

from pipeline.contacts.probability import (
    FORCE_OUTLIERS,
    GAP_OUTLIERS,
    _log_odds,
    changes_per_frame,
    force_noise,
    frame_log_odds,
    posterior,
)
from pipeline.session.parameters import DEFAULTS

PARAMS = DEFAULTS.contacts
GAP, FORCE = 1e-3, 8e-6  # m, N: typical of free and of touching frames
GAP_SD, FORCE_SD = 20e-6, 0.5e-6


def blurred(x, sd, scale):
    """Density of an exponential of mean `scale`, measured with normal errors of `sd`."""
    low, high = max(x - 9 * sd, 0.0), max(x + 9 * sd, 9 * sd)
    blur = lambda t: norm.pdf(x, t, sd) * expon.pdf(t, scale=scale)  # noqa: E731
    return quad(blur, low, high, points=[max(x, 0.0)], epsabs=0, epsrel=1e-9)[0]


def either_is_zero(zero, zero_sd, any_zero, other, other_sd, any_other, scale, correlation):
    """Density of both, of which the first is truly zero; either may say nothing at all.

    Errors are correlated; what is left of the other's is never less than a tenth of them.
    """
    left = other - correlation * other_sd / zero_sd * zero
    left_sd = max(np.sqrt(1 - correlation**2), 0.1) * other_sd
    sound = norm.pdf(zero, 0, zero_sd) * (blurred(left, left_sd, scale) + any_other)
    return sound + any_zero * (blurred(other, other_sd, scale) + any_other)


@pytest.mark.parametrize("correlation", [0.0, 0.6, -0.8, 0.999])
@pytest.mark.parametrize(
    ("gap_sds", "force_sds"), [(0.5, 1.0), (-1.0, 6.0), (2.5, 2.0), (8.0, 3.0), (1.0, -9.0)]
)
def test_odds_are_those_of_densities_integrated_directly(gap_sds, force_sds, correlation):
    gap, force = gap_sds * GAP_SD, force_sds * FORCE_SD
    any_gap, any_force = GAP_OUTLIERS / (2 * GAP), FORCE_OUTLIERS / (10 * FORCE)
    seen_gap, seen_force = (gap, GAP_SD, any_gap), (force, FORCE_SD, any_force)
    contact = either_is_zero(*seen_gap, *seen_force, FORCE, correlation)
    free = either_is_zero(*seen_force, *seen_gap, GAP, correlation)
    found = _log_odds(
        gap, GAP_SD, force, FORCE_SD, correlation * GAP_SD * FORCE_SD, DEFAULTS.contacts
    )
    assert found == pytest.approx(np.log(contact / free), abs=1e-6)


@pytest.mark.parametrize("gap", [-30e-6, 10e-6, 45e-6])
def test_without_a_force_the_gap_decides(gap):
    expected = np.log(norm.pdf(gap, 0, GAP_SD) / blurred(gap, GAP_SD, GAP))
    assert _log_odds(gap, GAP_SD, np.nan, FORCE_SD, 0.0, DEFAULTS.contacts) == pytest.approx(
        expected, abs=1e-6
    )


def test_without_a_force_nothing_is_certain():
    far, inside = _log_odds(
        np.array([1e-3, -1e-3]), GAP_SD, np.nan, FORCE_SD, 0.0, DEFAULTS.contacts
    )
    assert 1e-6 < np.exp(far) < 1e-4
    assert 100 < np.exp(inside) < 1000


def test_contacts_begin_and_end_at_rates_of_time():
    """10 begin and 30 end per second; at few frames a second, a frame still says something."""
    assert changes_per_frame(1000.0, PARAMS) == pytest.approx((0.01, 0.03))
    assert changes_per_frame(50.0, PARAMS) == pytest.approx((0.2, 0.3))


def test_a_wrong_origin_makes_no_force():
    columns = {
        "shape_force_se_N": np.array([5e-8, 3e-8]),
        "origin_force_se_N": np.array([3e-8, 5e-8]),
    }
    np.testing.assert_allclose(force_noise(columns), [4e-8, 0.0])


def simulated(offsets, extra, seed=0, n=3000, gap_sd=3e-6, pulled=0.05e-6):
    """Evidence of a whisker between two poles, one frame in four in touch, and who touches.

    `offsets`: gap [m] of touches on sides −1 and +1; `extra`: their scatter beyond gap_sd [m].
    """
    rng = np.random.default_rng(seed)
    touching, side = (np.arange(n) // 25) % 4 == 0, np.where(np.arange(n) % 2000 < 1000, -1, 1)
    place = np.where(side < 0, *offsets) + extra * rng.normal(size=n)
    gap = np.where(touching, place, place + rng.exponential(GAP, n)) + gap_sd * rng.normal(size=n)
    force = np.where(touching, rng.exponential(FORCE, n), 0.0) + pulled * rng.normal(size=n)
    return touching, pd.DataFrame(
        {
            "whisker": "C2",
            "gap_m": gap,
            "gap_se_m": gap_sd,
            "distance_m": gap,
            "shape_force_N": force,
            "shape_force_se_N": pulled,
            "origin_force_se_N": 0.0,
            "gap_force_cov": 0.0,
            "rest_known": True,
            "side": side,
            "pole_known": True,
            "nearest_m": 10e-3,
            "base_angle_rad": 0.0,
        }
    )


@pytest.mark.parametrize(("extra", "gap_sd"), [(10e-6, 3e-6), (10e-6, 8e-6), (0.0, 0.5e-6)])
def test_where_the_pole_is_and_how_places_scatter_is_learnt_on_each_side(extra, gap_sd):
    """As if both were known: medians of 375 frames, so within some tenths of the evidence."""
    offsets = np.array([30e-6, -45e-6])
    touching, evidence = simulated(offsets, extra, gap_sd=gap_sd)
    found = frame_log_odds(evidence, 1000.0, DEFAULTS.contacts)
    offset = offsets[(evidence["side"] > 0).to_numpy(int)]
    sd = np.hypot(gap_sd, max(extra, 1.6e-6))
    force = evidence["shape_force_N"].to_numpy()
    known = _log_odds(
        evidence["gap_m"].to_numpy() - offset, sd, force, 0.05e-6, 0.0, DEFAULTS.contacts
    )
    strong = touching & (force > 0.5e-6)
    near = ~touching & (evidence["gap_m"] - offset < 8 * sd).to_numpy()
    for some in (strong, near):
        assert np.median(np.abs(found - known)[some]) < 0.1 * np.median(np.abs(known[some])) + 0.1
    assert ((found > 0) == touching).mean() > 0.99


def test_what_is_pushed_far_from_the_pole_does_not_say_where_it_is():
    """As where another whisker lies over this one, in more frames than there are touches."""
    touching, evidence = simulated((20e-6, 20e-6), 5e-6)
    rows = np.flatnonzero(~touching)[:1500]
    evidence.loc[rows, "gap_m"] = 0.25e-3 + 5e-6 * np.random.default_rng(1).normal(size=1500)
    evidence.loc[rows, "shape_force_N"] = 15e-6
    found = frame_log_odds(evidence, 1000.0, DEFAULTS.contacts)
    force = evidence["shape_force_N"].to_numpy()
    gap = evidence["gap_m"].to_numpy() - 20e-6
    known = _log_odds(gap, np.hypot(3e-6, 5e-6), force, 0.05e-6, 0.0, DEFAULTS.contacts)
    assert (found[touching] > 0).mean() > 0.98
    assert np.median(np.abs(found - known)[touching]) < 0.1 * np.median(known[touching])


def test_pushes_of_nine_standard_errors_say_where_the_pole_is():
    """Touches 40 µm short of it, none stronger: as where that is known, odds within a tenth."""
    touching, evidence = simulated((-40e-6, -40e-6), 0.0, n=2000, gap_sd=1e-6)
    rng = np.random.default_rng(3)
    force = np.where(touching, 9 * 0.05e-6, 0.0) + 0.05e-6 * rng.normal(size=2000)
    evidence["shape_force_N"] = force
    found = frame_log_odds(evidence, 1000.0, DEFAULTS.contacts)
    gap = evidence["gap_m"].to_numpy() + 40e-6
    known = _log_odds(gap, np.hypot(1e-6, 1.6e-6), force, 0.05e-6, 0.0, DEFAULTS.contacts)
    np.testing.assert_allclose(found[touching], known[touching], rtol=0.1, atol=0.5)


def test_pushes_of_a_seventh_of_the_largest_say_where_the_pole_is():
    """Touches 60 µm beyond it; three strong ones are too few to show that."""
    touching, evidence = simulated((60e-6, 60e-6), 0.0, n=1000, gap_sd=1e-6)
    rng = np.random.default_rng(3)
    pushes = np.where(touching, 8 * 0.05e-6, 0.0)
    pushes[np.flatnonzero(touching)[:3]] *= 7
    evidence["shape_force_N"] = pushes + 0.05e-6 * rng.normal(size=1000)
    assert ((frame_log_odds(evidence, 1000.0, DEFAULTS.contacts) > 0) == touching).mean() > 0.99


def test_where_no_rod_is_fitted_the_traced_distance_decides():
    """It errs by 0.016 mm; what is pushed shows more, here nothing is: 0.0064 mm are allowed."""
    _, evidence = simulated((0.0, 0.0), 16e-6, n=40)
    evidence["shape_force_N"], evidence["rest_known"] = np.nan, False
    evidence["distance_m"] = np.linspace(-30e-6, 60e-6, 40)
    expected = _log_odds(
        evidence["distance_m"], np.hypot(16e-6, 6.4e-6), np.nan, 1.0, 0.0, DEFAULTS.contacts
    )
    np.testing.assert_allclose(
        frame_log_odds(evidence, 1000.0, DEFAULTS.contacts), expected, atol=1e-6
    )


@pytest.mark.parametrize(("lost", "bridged"), [(12, True), (20, False)])
def test_a_short_loss_of_the_trace_does_not_end_a_contact(lost, bridged):
    """By hand, 16 frames: an end and a start, log(0.03 · 0.01), are worth 0.52 a frame."""
    _, evidence = simulated((0.0, 0.0), 5e-6)
    evidence.loc[100 : 99 + lost, ["gap_m", "distance_m", "shape_force_N"]] = np.nan
    odds = np.full(len(evidence), 8.0)  # in touch
    away = slice(100, 100 + lost)
    odds[away] = frame_log_odds(evidence, 1000.0, DEFAULTS.contacts)[away]
    assert (posterior(odds, 0.01, 0.03)[100 + lost // 2] > 0.5) == bridged
