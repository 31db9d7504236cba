"""Contacts over the trials: where the bars lie, and the mean force from the onsets on."""

import numpy as np
import pandas as pd
import pytest
from matplotlib.colors import to_hex
from results_folder import CONTACTS, make_results

from pipeline.reports import trials
from pipeline.reports.time_courses import (
    HIGH,
    MOST_POINTS,
    UNKNOWN,
    WIDE,
    overlay_link,
    read_courses,
    thinned,
    time_courses,
)
from pipeline.reports.whisker_styles import style_of, whisker_styles
from pipeline.tables import files
from pipeline.tables.columns import CONTACT_COLUMNS


def table(rows=CONTACTS):
    return files.as_table(pd.DataFrame(rows), CONTACT_COLUMNS)


def test_bars_begin_with_the_first_contact_of_their_trial():
    figure = trials.draw_raster(["two", "one"], table())
    (bars,) = figure.axes[0].collections
    ends = [segment[:, 0] for segment in bars.get_segments()]
    np.testing.assert_allclose(ends, [[0, 10], [30, 50], [0, 40]], atol=1e-9)  # ms
    assert [segment[0, 1] for segment in bars.get_segments()] == [2, 2, 1]  # trials


def test_mean_force_is_that_of_the_contacts(tmp_path):
    results = make_results(tmp_path / "r")
    average = trials.OnsetAverage()
    for video in ("one", "two"):
        average.add(read_courses(results, video), table().query("video == @video"))
    (line,) = [each for each in average.draw().axes[0].lines if "n = 3" in str(each.get_label())]
    time, mean = line.get_data()
    at = {t: m for t, m in zip(time, mean, strict=True)}
    assert at[-5] == 0
    forces = [  # µN, 5 ms behind each onset
        read_courses(results, video).set_index("frame")["contact_force_uN"][onset + 5]
        for video, onset in (("one", 30), ("one", 60), ("two", 30))
    ]
    assert at[5] == pytest.approx(np.mean(forces))
    assert at[80] == pytest.approx(0)  # of those contacts only whose video goes on so long


def test_a_whisker_has_the_colour_of_its_time_courses(tmp_path):
    results = make_results(tmp_path / "r")
    frames = pd.concat(
        [read_courses(results, "one").assign(whisker=name) for name in ("C1", "C2")]
    )
    own = table().query("video == 'one'")
    styles = whisker_styles(name for name, _ in time_courses(frames, own, "one").whiskers)
    (bars,) = trials.draw_raster(["one", "two"], table(), styles).axes[0].collections
    colour = styles["C2"].colour
    assert {to_hex(each) for each in bars.get_colors()} == {colour} != {styles["C1"].colour}
    average = trials.OnsetAverage()
    average.add(frames, own)
    lines = average.draw(styles).axes[0].lines
    assert [each.get_color() for each in lines if "C2" in str(each.get_label())] == [colour]


def test_lines_of_no_known_whisker_are_grey_and_have_no_name(tmp_path):
    frames = read_courses(make_results(tmp_path / "r"), "one").assign(whisker="w1")
    other = frames.assign(whisker="w2", confidence=0.4)
    courses = time_courses(pd.concat([other, frames]), table(CONTACTS[:0]), "one")
    assert [name for name, _ in courses.whiskers] == ["w1"]
    (below, _), *above = courses.panels[0].paths  # drawn first
    assert below == courses.unknown == UNKNOWN
    assert [style for style, _ in above] == [style_of(0)]


def test_lines_of_no_known_whisker_leave_the_axis_to_the_others(tmp_path):
    frames = read_courses(make_results(tmp_path / "r"), "one").assign(whisker="w1")
    frames["base_angle_deg"] = 10 * np.sin(frames["frame"])
    other = frames.assign(whisker="w2", base_angle_deg=frames["frame"] - 170.0, confidence=0.4)
    alone, both, unknown = (
        time_courses(each, table(CONTACTS[:0]), "one").panels[0].ticks
        for each in (frames, pd.concat([frames, other]), other)
    )
    assert both == alone
    assert [text[0] for _, text in unknown] == ["−"] * len(unknown)


def test_where_a_name_is_not_known_the_line_is_grey(tmp_path):
    frames = read_courses(make_results(tmp_path / "r"), "one")
    frames["confidence"] = np.where(frames["frame"] < 40, 0.3, 0.9)
    (below, early), (above, late) = (
        time_courses(frames, table(CONTACTS[:0]), "one").panels[0].paths
    )
    assert (below, above) == (UNKNOWN, style_of(0))
    last, first = early.split("L")[-1].split()[0], late[1:].split()[0]
    assert [float(last), float(first)] == pytest.approx(
        [WIDE * 39 / 119, WIDE * 40 / 119], abs=0.1
    )


def test_without_contacts_there_are_no_empty_panels_of_forces(tmp_path):
    frames = read_courses(make_results(tmp_path / "r"), "one").assign(contact_force_uN=0.0)
    courses = time_courses(frames, table(CONTACTS[:0]), "one")
    assert [panel.name for panel in courses.panels] == ["angle"]


def test_time_courses_lie_where_their_values_are(tmp_path):
    results = make_results(tmp_path / "r")
    courses = time_courses(read_courses(results, "one"), table(CONTACTS[:2]), "one", "one/o.mp4")
    assert [panel.name for panel in courses.panels] == ["angle", "force"]  # all that is known
    ((_, path),) = courses.panels[1].paths
    points = np.array([p.split() for p in path[1:].replace("M", "L").split("L")], float)
    peak = points[np.argmin(points[:, 1])]
    assert peak[0] == pytest.approx(WIDE * 70 / 119, abs=0.1)  # frame 70 of 0 to 119
    half = points[np.argmin(abs(points[:, 1] - (peak[1] + points[:, 1].max()) / 2))]
    ticks = {text: HIGH / 100 * top for top, text in courses.panels[1].ticks}  # µN
    assert half[1] == pytest.approx(ticks["5"], abs=HIGH / 20)  # the peak is 10
    assert points[:, 1].max() == pytest.approx(ticks["0"], abs=0.1)
    second = courses.contacts[1]
    assert (second.left, second.width) == pytest.approx((WIDE * 60 / 119, WIDE * 20 / 119))
    assert second.link == "one/o.mp4#t=1.80,3.80"  # frames 45 to 95 at 25 frames/s
    assert "frames 60 to 80, 20 ms, peak 10 µN" in second.words


def test_lanes_are_for_whiskers_that_touch(tmp_path):
    frames = read_courses(make_results(tmp_path / "r"), "one")
    frames = pd.concat([frames.assign(whisker=name) for name in ("C1", "C2", "C3")])
    courses = time_courses(frames, table(CONTACTS[:2]), "one")
    assert [name for name, _ in courses.lanes] == ["C2"]
    assert courses.lanes[0] in courses.whiskers
    assert {each.lane for each in courses.contacts} == {0}


@pytest.mark.parametrize("turn", [0.7, 7.0, 70.0, 190.0, 700.0])  # degrees, either way
def test_every_axis_tells_its_scale(tmp_path, turn):
    frames = read_courses(make_results(tmp_path / "r"), "one")
    frames["base_angle_deg"] = turn * np.sin(frames["frame"] / 10)
    ticks = time_courses(frames, table([]), "one").panels[0].ticks
    assert len({text for _, text in ticks}) >= 2


def test_links_to_other_overlays_name_no_time():
    assert overlay_link("a b/overlay.avi", 10, 20) == "a%20b/overlay.avi"


def test_unknown_stretches_break_the_curve(tmp_path):
    frames = read_courses(make_results(tmp_path / "r"), "one")
    frames.loc[20:30, "base_angle_deg"] = np.nan
    frames["base_angle_deg"] += np.arange(len(frames))
    courses = time_courses(frames, table([]), "one")
    assert courses.panels[0].paths[0][1].count("M") == 2


def test_thinning_keeps_extremes():
    time = np.arange(20_000) / 1000
    values = np.sin(time)
    values[12_345], values[777] = 5.0, -5.0
    shorter_time, shorter = thinned(time, values)
    assert len(shorter) <= 1.05 * MOST_POINTS
    assert (shorter.max(), shorter.min()) == (5.0, -5.0)
    assert np.all(np.diff(shorter_time) >= 0)
    assert abs(shorter_time[np.argmax(shorter)] - 12.345) < 0.05  # s
