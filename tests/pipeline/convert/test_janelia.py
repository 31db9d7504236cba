"""Folders that the Janelia tracker made become results; results become its files."""

import json
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
from results_folder import make_results
from tracked_files import settings_of, write_tracked

from pipeline.convert import janelia, janelia_files
from pipeline.convert.janelia_files import Segment
from pipeline.convert.results import read_results
from pipeline.errors import InputError
from pipeline.kinematics.given_lines import as_centrelines
from pipeline.run import analyse_lines
from pipeline.session.session_file import read_session
from synthetic.presets import make_trial
from synthetic.truth import contact_table

DATA = Path(__file__).parents[2] / "data"
edge_tolerance = 1  # frames
peak_force_tolerance = 0.05  # relative, or
peak_force_floor = 0.2  # µN
angle_tolerance = 0.3  # deg
place_tolerance = 0.5  # px


@lru_cache
def motion():
    return make_trial("noisy", 0, 0, 400).motion


@pytest.fixture(scope="module")
def tracked(tmp_path_factory):
    folder = tmp_path_factory.mktemp("tracked")
    write_tracked(folder, motion())
    return folder


@pytest.mark.slow
def test_contacts_and_forces_without_the_video(tracked):
    settings = read_session(tracked / "session.toml")
    lines, pole, n_frames = janelia.read_tracked(tracked / "trial.whiskers", settings)
    analysis = analyse_lines(lines, settings, pole, n_frames)
    truth, found = contact_table(motion(), "trial"), analysis.contacts
    assert analysis.messages == ()
    assert analysis.n_frames == 400
    assert len(found) == len(truth) > 2
    for edge in ("onset_frame", "offset_frame"):
        assert np.abs(found[edge] - truth[edge]).max() <= edge_tolerance
    error = np.abs(found["peak_force_uN"] - truth["peak_force_uN"])
    allowed = np.maximum(peak_force_tolerance * truth["peak_force_uN"], peak_force_floor)
    assert (error < allowed).all()


def test_lines_run_from_the_follicle_and_hairs_are_left_out(tracked):
    settings = read_session(tracked / "session.toml")
    lines, pole, _ = janelia.read_tracked(tracked / "trial.whiskers", settings)
    np.testing.assert_array_equal(lines.frame, np.arange(400))
    first = np.column_stack([lines.x_px, lines.y_px])[lines.offsets[:-1]]
    last = np.column_stack([lines.x_px, lines.y_px])[lines.offsets[1:] - 1]
    assert (first[:, 0] < last[:, 0]).all()
    x, y = motion().scene.to_pixels(motion().pole_x, motion().pole_y)
    np.testing.assert_allclose(pole.x_px, x, atol=1e-3)
    np.testing.assert_allclose(pole.y_px, y, atol=1e-3)


def test_without_names_in_the_session_whiskers_are_numbered(tracked):
    settings = settings_of(motion()).model_copy(update={"whisker": ()})
    lines, _, _ = janelia.read_tracked(tracked / "trial.whiskers", settings)
    assert lines.names == ("w1",)
    lines, _, _ = janelia.read_tracked(tracked / "trial.whiskers", settings, ["D3"])
    assert lines.names == ("D3",)


def test_a_whisker_of_another_name_is_reported(tracked):
    settings = settings_of(motion())
    lines, _, _ = janelia.read_tracked(tracked / "trial.whiskers", settings, ["D3"])
    with pytest.raises(InputError, match=r"D3 has no \[\[whisker\]\] table"):
        analyse_lines(lines, settings)


def test_what_is_missing_is_named(tmp_path, tracked):
    settings = settings_of(motion())
    path = tmp_path / "a.whiskers"
    path.write_bytes(b"a video, not lines")
    with pytest.raises(InputError, match=r"a\.whiskers: is not a binary \.whiskers file"):
        janelia.read_tracked(path, settings)
    path.write_bytes((tracked / "trial.whiskers").read_bytes())
    with pytest.raises(InputError, match=r"a\.measurements: no such file.*classify"):
        janelia.read_tracked(path, settings)
    table = janelia_files.read_measurements(tracked / "trial.measurements")
    table.label[:] = -1
    janelia_files.write_measurements(tmp_path / "a.measurements", table)
    with pytest.raises(InputError, match=r"no line is labelled a whisker; run `classify`"):
        janelia.read_tracked(path, settings)
    table.label[:3] = [0, 1, 2]
    janelia_files.write_measurements(tmp_path / "a.measurements", table)
    with pytest.raises(InputError, match=r"whiskers 0 to 2, but there are names for 1 \(C2\)"):
        janelia.read_tracked(path, settings)


def tracked_lines(count=4):
    """Lines of one whisker, one per frame, their measurements and the pole."""
    x = np.arange(60, dtype=np.float32)
    segments = [Segment(0, k, x, x + k, np.ones_like(x), np.ones_like(x)) for k in range(count)]
    table = janelia.measured(segments, "left")
    return segments, table, np.column_stack([np.arange(count + 2), *np.full((2, count + 2), 50.0)])


def read_back(folder, segments, table, bar):
    janelia_files.write_whiskers(folder / "a.whiskers", segments)
    janelia_files.write_measurements(folder / "a.measurements", table)
    janelia_files.write_bar(folder / "a.bar", bar)
    settings = settings_of(motion()).model_copy(update={"whisker": ()})
    return janelia.read_tracked(folder / "a.whiskers", settings)


def test_a_pole_may_be_seen_after_the_last_line(tmp_path):
    lines, _, n_frames = read_back(tmp_path, *tracked_lines())
    assert len(lines) == 4
    assert json.dumps(n_frames) == "6"  # for the record


def test_lines_that_are_no_numbers_are_left_out(tmp_path):
    segments, table, bar = tracked_lines()
    segments[1] = segments[1]._replace(x=segments[1].x * np.nan)
    segments[2].x[30] = np.nan
    lines, _, _ = read_back(tmp_path, segments, table, bar)
    assert list(lines.frame) == [0, 2, 3]
    nothing = replace(lines, x_px=lines.x_px * np.nan)
    assert len(as_centrelines(nothing)) == 0


@pytest.mark.parametrize(
    "traced_again", [lambda s: s._replace(frame=s.frame + 2), lambda s: s._replace(x=s.x + 9)]
)
def test_measurements_of_other_lines_are_refused(tmp_path, traced_again):
    segments, table, bar = tracked_lines()
    with pytest.raises(InputError, match=r"a\.measurements: is not of the lines in a\.whiskers"):
        read_back(tmp_path, [traced_again(each) for each in segments], table, bar)
    segments[1] = traced_again(segments[1])  # a person has drawn it anew
    assert list(read_back(tmp_path, segments, table, bar)[0].frame) == [0, 2, 3]


def test_damage_takes_no_memory_and_no_frame_far_away(tmp_path):
    segments, table, bar = tracked_lines()
    far = [*segments, segments[0]._replace(frame=2_000_000_000)]
    for damaged in ((far, bar), (segments, bar * [2e9, 1, 1]), (segments, bar * [1, 1e30, 1])):
        with pytest.raises(InputError, match=r"a\.whiskers, a\.bar: one of them is damaged"):
            read_back(tmp_path, damaged[0], table, damaged[1])
    table.label[2] = 1_000_000_000
    with pytest.raises(InputError, match="whiskers 0 to 1000000000 in 4 rows"):
        read_back(tmp_path, segments, table, bar)


def test_a_pole_holds_until_the_next_line():
    settings = settings_of(motion())
    pole = janelia.pole_of(np.array([[4.0, 7, 8], [1, 5, 6]]), settings, 6)
    np.testing.assert_array_equal(pole.x_px, [5, 5, 5, 5, 7, 7])
    np.testing.assert_array_equal(pole.y_px, [6, 6, 6, 6, 8, 8])
    assert pole.radius_px == pytest.approx(6.25)


# --- files that the tracker itself has written -------------------------------------------


def test_measurements_are_those_of_the_tracker():
    """Our measures of its lines, beside its own of the same lines."""
    segments = janelia_files.read_whiskers(DATA / "janelia_tracker.whiskers")
    theirs = janelia_files.read_measurements(DATA / "janelia_tracker.measurements")
    ours = janelia.measured(segments, "left")
    assert len(segments) == len(theirs) == 9
    order = np.lexsort([theirs.segment, theirs.frame])
    np.testing.assert_array_equal(ours.frame, theirs.frame[order])
    np.testing.assert_array_equal(ours.segment, theirs.segment[order])
    np.testing.assert_allclose(ours.values, theirs.values[order], atol=1e-4)
    assert (ours.face, ours.face_axis) == (theirs.face, theirs.face_axis)


def test_the_tracker_s_own_files_are_written_again_byte_by_byte(tmp_path):
    """But for the rows' numbers, which `classify` shuffles and every reader makes anew."""
    whiskers, table = (DATA / f"janelia_tracker.{s}" for s in ("whiskers", "measurements"))
    janelia_files.write_whiskers(tmp_path / "w", janelia_files.read_whiskers(whiskers))
    janelia_files.write_measurements(tmp_path / "m", janelia_files.read_measurements(table))
    assert (tmp_path / "w").read_bytes() == whiskers.read_bytes()
    bytes_per_row = 41 + 2 * 8 * 8
    theirs, ours = (np.frombuffer(p.read_bytes(), np.uint8) for p in (table, tmp_path / "m"))
    np.testing.assert_array_equal(theirs[:16], ours[:16])
    theirs, ours = (each[16:].reshape(-1, bytes_per_row)[:, 4:] for each in (theirs, ours))
    np.testing.assert_array_equal(theirs, ours)


# --- results → files ---------------------------------------------------------------------


def test_results_there_and_back(tmp_path):
    results = read_results(make_results(tmp_path / "results"))
    assert [video.name for video in results] == ["one", "two"]
    paths = janelia.write_tracked(tmp_path, results[0])
    assert [path.name for path in paths] == ["one.whiskers", "one.measurements", "one.bar"]
    lines, pole, n_frames = janelia.read_tracked(paths[0], results[0].settings)
    ours = results[0].lines()
    assert (lines.names, n_frames) == (("C2",), results[0].n_frames)
    for name in ("frame", "whisker", "offsets", "x_px", "y_px"):
        np.testing.assert_array_equal(getattr(lines, name), getattr(ours, name))
    assert (pole.x_px[5], pole.y_px[5], pole.radius_px) == (230, 240, 6.25)
    (thick, *_) = [s.thickness for s in janelia_files.read_whiskers(paths[0])]
    s_mm = 1.4 + 100 / 25
    assert thick[100] == pytest.approx(2 * 37e-3 * (1 - s_mm / 18.947) * 25, abs=0.01)


@pytest.mark.parametrize(
    ("face", "direction", "angle"),
    [("left", (1, 0), 90), ("right", (-1, 0), -90), ("top", (0, 1), 90), ("bottom", (0, -1), -90)],
)
def test_angles_are_from_the_face_s_axis(face, direction, angle):
    t = np.arange(30, dtype=np.float32)
    ones = np.ones_like(t)
    line = Segment(0, 0, 50 + direction[0] * t, 60 + direction[1] * t, ones, ones)
    table = janelia.measured([line], face)
    length, _, found, curvature, *ends = table.values[0]
    assert (length, found, curvature) == pytest.approx((29, angle, 0), abs=1e-4)
    np.testing.assert_allclose(ends[:2], [50, 60])


def test_an_empty_folder_is_no_results(tmp_path):
    with pytest.raises(InputError, match="is an empty folder"):
        read_results(tmp_path)
