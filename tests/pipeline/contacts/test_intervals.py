"""What makes a contact of frames that probably touch, each rule on evidence made for it."""

import numpy as np
import pandas as pd
import pytest

from pipeline.contacts.intervals import _is_held, _is_stopped, find_intervals
from pipeline.session.parameters import DEFAULTS
from pipeline.tables.columns import split_flags

PARAMS = DEFAULTS.contacts
N, FIRST, LAST = 130, 50, 70  # frames, and those of a contact
UN, UM = 1e-6, 1e-6


def course(rows, value, rest=0.0):
    out = np.full(N, rest)
    out[rows] = value
    return out


def evidence(**columns):
    """A whisker that is pushed by 5 µN in its touch and free before and after.

    In free frames, forces of 0.1 µN and gaps of 10 µm alternate in sign.
    """
    inside, turn = slice(FIRST, LAST), np.where(np.arange(N) % 2, 1.0, -1.0)
    table = {
        "whisker": "C2",
        "frame": np.arange(N),
        "probability": course(inside, 0.995),
        "side": course(inside, 1.0).astype(int),
        "distance_m": course(inside, 0.0, 1e-3),
        "gap_m": course(inside, 0.0, 1e-3) + 10 * UM * turn,
        "gap_se_m": 5 * UM,
        "shape_force_N": course(inside, 5 * UN) + 0.1 * UN * turn,
        "shape_force_se_N": 0.1 * UN,
        "point_force_N": course(inside, 5 * UN) + 0.1 * UN * turn,
        "origin_force_se_N": 0.0,
        "contact_m": 12e-3,
        "lateral_per_force": 1.0,
        "chi2": 1.0,
        "bending_origin_m": 0.0,
        "bending_origin_se_m": 10 * UM,
        "rest_known": True,
        "base_angle_rad": 0.0,
    }
    return pd.DataFrame(table | columns)


def spans(table):
    return list(zip(table["onset_frame"], table["offset_frame"], strict=True))


def flags_of(**columns):
    return split_flags(
        find_intervals(evidence(**columns), params=DEFAULTS.contacts).iloc[0]["flags"]
    )


def test_a_plain_touch():
    probability = course(slice(FIRST, LAST), 1.0)
    probability[FIRST : FIRST + 10] = 0.9
    found = find_intervals(evidence(probability=probability), params=DEFAULTS.contacts)
    assert spans(found) == [(FIRST, LAST)]
    row = found.iloc[0]
    assert (row["side"], row["slip"], row["flags"]) == (1, False, "")
    assert row["probability"] == pytest.approx(0.95)


def test_a_blurred_frame_of_a_slip_is_no_other_contact():
    """The whisker is beyond the pole already, and no rod can be fitted to it."""
    side, force = (
        course(slice(FIRST, LAST), 1).astype(int),
        evidence()["shape_force_N"].to_numpy(copy=True),
    )
    side[LAST - 1], force[LAST - 1] = -1, np.nan
    found = find_intervals(evidence(side=side, shape_force_N=force), params=DEFAULTS.contacts)
    assert spans(found) == [(FIRST, LAST - 1)]
    assert found.iloc[0]["slip"]


def test_a_touch_ends_where_the_pole_changes_sides():
    """Frames in which no side is known belong to the contact before."""
    side = course(slice(FIRST, LAST), 1).astype(int)
    side[60:LAST], side[58:60] = -1, 0
    found = find_intervals(evidence(side=side), params=DEFAULTS.contacts)
    assert spans(found) == [(FIRST, 60), (60, LAST)]
    assert found["side"].tolist() == [1, -1]
    assert found["slip"].tolist() == [True, False]


@pytest.mark.parametrize(("late", "slips"), [(0, True), (3, True), (4, False)])
def test_a_slip_is_the_pole_on_the_other_side_within_4_ms(late, slips):
    side = course(slice(FIRST, LAST), 1).astype(int)
    side[LAST + late :] = -1
    assert find_intervals(evidence(side=side), params=DEFAULTS.contacts)["slip"].tolist() == [
        slips
    ]


@pytest.mark.parametrize(("share", "number"), [(0.4, 0), (0.6, 1)])
def test_half_of_a_touch_is_near_the_pole(share, number):
    """Nearer than 0.2 mm."""
    distance = course(slice(FIRST, LAST), 0.25e-3, 1e-3)
    distance[FIRST : FIRST + round(share * (LAST - FIRST))] = 0.15e-3
    assert len(find_intervals(evidence(distance_m=distance), params=DEFAULTS.contacts)) == number


@pytest.mark.parametrize(
    ("peak_in_errors", "scatter", "found"),
    [
        (6.0, 5.0, True),  # of its own errors, however forces of free frames scatter
        (2.0, 1.0, False),
        (2.0, 2 / 9.5, True),  # 9.5 times what free frames scatter by
        (2.0, 2 / 6.5, False),
    ],
)
def test_a_touch_pushes_by_its_error_or_by_others_scatter(peak_in_errors, scatter, found):
    """`scatter`: of free frames, in errors of the force. The gap says nothing: it is far off."""
    rng = np.random.default_rng(0)
    force = 1 * UN * scatter * rng.normal(size=N)
    force[FIRST:LAST] = peak_in_errors * UN
    columns = {"shape_force_N": force, "point_force_N": force, "shape_force_se_N": 1 * UN}
    assert len(find_intervals(evidence(**columns), params=DEFAULTS.contacts)) == found
    if not found or peak_in_errors > 2.5:
        return
    columns["point_force_N"] = 0 * force  # both estimates have to stand out
    assert len(find_intervals(evidence(**columns), params=DEFAULTS.contacts)) == 0


def test_what_origin_and_base_add_to_the_error_makes_no_touch_faint():
    wide = {"shape_force_se_N": 10 * UN, "origin_force_se_N": np.sqrt(100 - 1) * UN}
    assert flags_of(**wide) == []
    assert "faint_force" in flags_of(shape_force_se_N=10 * UN)


def columns_of(**columns):
    table = evidence(**columns)
    return {name: table[name].to_numpy() for name in table}


@pytest.mark.parametrize(("errors", "stops"), [(3.0, False), (4.0, True)])
@pytest.mark.parametrize(("spread", "gap_se"), [(2 * UM, 5 * UM), (5 * UM, 2 * UM)])
def test_a_gap_off_any_smooth_course_is_a_stop(errors, stops, spread, gap_se):
    """`errors`: what a cubic through the contact and 6 frames on both sides leaves, per frame."""
    time, frames = np.linspace(-1, 1, N), slice(FIRST - 6, LAST + 6)
    kink = course(slice(FIRST + 4, LAST - 4), 1.0)
    left = np.polyval(np.polyfit(time[frames], kink[frames], 3), time[frames]) - kink[frames]
    usual = np.sqrt((left**2).sum() / (len(left) - 4))
    gap = errors * 5 * UM / usual * kink + 1e-3 * np.polyval([3, -1, 2, 0.2], time)
    gap[: FIRST - 6] = gap[LAST + 6 :] = 0.5e-3  # what is farther off does not count
    assert _is_stopped(columns_of(gap_m=gap, gap_se_m=gap_se), FIRST, LAST, spread) == stops


@pytest.mark.parametrize(("known", "enough"), [(2, False), (3, True)])
def test_a_stop_is_seen_beside_some_frames_outside(known, enough):
    gap = course(slice(FIRST, LAST, 2), 1e-3, -1e-3)
    gap[: FIRST - known], gap[LAST:] = np.nan, np.nan
    assert _is_stopped(columns_of(gap_m=gap), FIRST, LAST, 5 * UM) == enough


@pytest.mark.parametrize(("away", "held"), [(1.7, True), (2.3, False)])
@pytest.mark.parametrize(("spread", "gap_se"), [(5 * UM, 10 * UM), (10 * UM, 5 * UM)])
def test_a_touch_whose_force_is_hidden_lies_where_others_do(away, held, spread, gap_se):
    """Within 2 of the larger error, in 3 frames; it stops there."""
    place, gap = 30 * UM, np.full(N, 1e-3)
    gap[FIRST : FIRST + 3] = place + away * 10 * UM
    part = columns_of(gap_m=gap, gap_se_m=gap_se)
    assert _is_held(part, FIRST, LAST, place, spread) == held
    gap[FIRST] = 1e-3
    assert not _is_held(columns_of(gap_m=gap, gap_se_m=gap_se), FIRST, LAST, place, spread)


@pytest.mark.parametrize(("place", "number"), [(5 * UM, 2), (200 * UM, 1)])
def test_a_hidden_touch_counts_where_firm_ones_show_the_place(place, number):
    """A second stretch, in which the force's error is large, stops where the first does."""
    second, error = slice(95, 105), np.full(N, 0.1 * UN)
    probability, side = course(slice(FIRST, LAST), 1.0), course(slice(FIRST, LAST), 1)
    force, gap = (evidence()[name].to_numpy(copy=True) for name in ("shape_force_N", "gap_m"))
    probability[second], side[second], error[80:] = 1.0, 1, 5 * UN
    force[second], gap[second] = UN, place
    columns = {"shape_force_N": force, "point_force_N": 0 * force, "gap_m": gap, "side": side}
    columns |= {"shape_force_se_N": error, "probability": probability, "distance_m": 0.0}
    columns["side"] = side.astype(int)
    found = find_intervals(evidence(**columns), params=DEFAULTS.contacts)
    assert spans(found) == [(FIRST, LAST), (95, 105)][:number]
    assert all("faint_force" in flags for flags in found["flags"][1:])
    force[second] = np.nan  # as where no rod can be fitted, though the shape at rest is known
    again = find_intervals(evidence(**columns), params=DEFAULTS.contacts)
    pd.testing.assert_series_equal(again["flags"], found["flags"])


@pytest.mark.parametrize(
    ("misfit", "where", "flagged"), [(6.0, 0.6, True), (3.0, 0.6, False), (6.0, 0.4, False)]
)
def test_a_misfit_under_load_is_flagged(misfit, where, flagged):
    """χ² over that of free frames, 1.5, where the force is `where` of the largest."""
    rows = slice(FIRST, LAST)
    force, chi2 = course(rows, 5 * UN), np.full(N, 1.5)
    loaded = slice(FIRST + 2, LAST - 2)
    force[loaded], chi2[loaded] = where * 5 * UN, 1.5 * misfit
    assert ("bends_unlike_rod" in flags_of(shape_force_N=force, chi2=chi2)) == flagged


def test_free_frames_that_fit_too_well_lower_no_limit():
    chi2 = course(slice(FIRST, LAST), 3.0, 0.2)
    assert "bends_unlike_rod" not in flags_of(chi2=chi2)
    assert "bends_unlike_rod" in flags_of(chi2=2 * chi2)


def tilted(degrees):
    return course(slice(FIRST, LAST), np.cos(np.deg2rad(degrees)), 0.1)


@pytest.mark.parametrize(
    ("columns", "flag", "flagged"),
    [
        ({"lateral_per_force": tilted(30.0)}, "large_deflection", False),
        ({"lateral_per_force": -tilted(40.0)}, "large_deflection", True),
        ({"contact_m": 6.6e-3}, "contact_near_curvature_window", False),
        ({"contact_m": 6.4e-3}, "contact_near_curvature_window", True),
        ({"bending_origin_m": -0.4e-3}, "base_contradicted", True),
        ({"bending_origin_m": 0.2e-3}, "base_contradicted", False),
        ({"bending_origin_m": 0.4e-3, "bending_origin_se_m": 0.2e-3}, "base_contradicted", False),
        ({"bending_origin_m": 0.4e-3, "bending_origin_se_m": 0.1e-3}, "base_contradicted", True),
        ({"probability": course(slice(FIRST, LAST), 0.98)}, "doubtful", True),
        ({"probability": course(slice(FIRST, LAST), 0.995)}, "doubtful", False),
        ({"rest_known": False}, "no_rest_curvature", True),
        ({"base_angle_rad": course(60, np.nan)}, "gaps_in_trace", True),
        ({"contact_m": course(60, np.nan, 12e-3)}, "gaps_in_trace", True),
        ({"contact_m": np.nan, "rest_known": False}, "gaps_in_trace", False),
    ],
)
def test_flags(columns, flag, flagged):
    assert (flag in flags_of(**columns)) == flagged


def test_touches_that_the_video_cuts():
    table = evidence()
    late, early = table.iloc[FIRST + 5 :], table.iloc[: LAST - 5]
    for part, flag in ((late, "starts_before"), (early, "ends_after")):
        (flags,) = find_intervals(part, params=DEFAULTS.contacts)["flags"]
        assert split_flags(flags) == [flag]
