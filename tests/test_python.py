"""What Python users have: what `analyse` takes and gives, plots, units, completion."""

import subprocess
import sys
import tempfile
import warnings
from contextlib import nullcontext

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

import pipeline
import synthetic
from pipeline import (
    PoleTrack,
    analyse,
    analyse_lines,
    open_video,
    read_results,
    read_session,
    write_session,
)
from pipeline.contacts.corrections import Verdict
from pipeline.errors import InputError, VideoError
from pipeline.reports.notebook_plots import plot_centrelines, plot_contacts, plot_course
from pipeline.tables import CONTACT_COLUMNS, FRAME_COLUMNS, files

pytestmark = pytest.mark.e2e

FORCE = 0.05  # relative, of the peak force, from lines instead of the video
EDGE_FRAMES = 2
SAME = {"follicle_x_px": 0.3, "base_angle_deg": 0.2, "contact_force_uN": 0.3}  # px, deg, µN

WRITES = """
import os, sys
sys.dont_write_bytecode = True
writes = []
def hook(event, arguments):
    if event == "open" and isinstance(arguments[2], int):
        if arguments[2] & (os.O_WRONLY | os.O_RDWR | os.O_CREAT):
            writes.append(arguments[0])
    if event in ("os.mkdir", "os.rename", "os.remove", "os.rmdir"):
        writes.append(arguments[0])
sys.addaudithook(hook)
open(sys.argv[1], "w").close()
import pipeline
dir(pipeline)
print(len(writes), *(name for name in ("numpy", "pandas", "numba") if name in sys.modules))
"""


@pytest.fixture(scope="module")
def frames(rendered):
    """The rendered video as an array."""
    with open_video(next(rendered.glob("*.avi"))) as video:
        return np.stack(list(video.frames()))


@pytest.fixture(scope="module")
def analysis(rendered, frames):
    """What is found in the array, with the settings' path."""
    return analyse(frames, rendered / "session.toml")


@pytest.fixture
def axis():
    return Figure().subplots()


def test_an_array_of_frames_gives_what_the_video_gives(analysis, video):
    """But for which frames the background is seen in: a file's are not found as quickly."""
    of_video = analyse(video)  # session.toml lies beside it
    for column, tolerance in SAME.items():
        np.testing.assert_allclose(
            analysis.frames[column], of_video.frames[column], atol=tolerance, err_msg=column
        )
    for edge in ("onset_frame", "offset_frame"):
        np.testing.assert_allclose(analysis.contacts[edge], of_video.contacts[edge], atol=1)
    assert of_video.settings == read_session(video.parent / "session.toml")


def test_a_table_of_lines_gives_the_same_contacts(analysis):
    settings = analysis.settings
    x, y = analysis.pole.x_px[0], analysis.pole.y_px[0]
    pole = settings.pole.model_copy(update={"x_px": float(x), "y_px": float(y)})
    settings = settings.model_copy(update={"pole": pole})
    found = analyse(analysis.centrelines, settings)
    assert len(found.contacts) == len(analysis.contacts) >= 2
    np.testing.assert_allclose(
        found.contacts["onset_frame"], analysis.contacts["onset_frame"], atol=EDGE_FRAMES
    )
    np.testing.assert_allclose(
        found.contacts["peak_force_uN"], analysis.contacts["peak_force_uN"], rtol=FORCE
    )


def test_a_pole_may_be_given_in_plain_numbers(analysis):
    x, y = float(analysis.pole.x_px[0]), float(analysis.pole.y_px[0])
    for pole in (PoleTrack(x, y, 6.25), PoleTrack([x], [y], 6.25)):
        found = analyse_lines(analysis.centrelines, analysis.settings, pole)
        assert len(found.contacts) == len(analysis.contacts)


def test_saved_tables_are_those_of_the_analysis(analysis, tmp_path):
    folder = analysis.save(tmp_path / "new" / "trial")
    pd.testing.assert_frame_equal(
        pd.read_parquet(folder / "frames.parquet"), analysis.frames, check_dtype=False
    )
    contacts = files.read_csv(folder / "contacts.csv", CONTACT_COLUMNS)
    assert set(contacts["video"]) == {"trial"}
    np.testing.assert_allclose(
        contacts["peak_force_uN"], analysis.contacts["peak_force_uN"], rtol=1e-5
    )
    lines = pd.read_parquet(folder / "centrelines.parquet")  # list columns: an array per row
    assert len(lines) == len(analysis.centrelines) == analysis.frames["tracked"].sum()
    for name in ("x_px", "y_px"):
        assert lines[name][7].dtype == np.float32
        np.testing.assert_array_equal(lines[name][7], analysis.centrelines[name][7])
    assert read_session(folder / "session.toml") == analysis.settings


def test_what_was_saved_is_read_again(analysis, tmp_path):
    (video,) = read_results(analysis.save(tmp_path / "trial"))
    assert (video.name, video.path) == ("trial", "trial")
    assert (video.whiskers, video.n_frames) == (analysis.whiskers, analysis.n_frames)
    assert len(video.contacts) == len(analysis.contacts)
    assert len(video.lines().frame) == len(analysis.centrelines)
    np.testing.assert_allclose(video.pole().x_px[0], analysis.pole.x_px[0], atol=1e-3)


def test_units_travel_with_the_tables(analysis, tmp_path):
    folder = analysis.save(tmp_path / "trial")
    expected = {c.name: c.unit for c in FRAME_COLUMNS}
    assert analysis.frames.attrs["units"] == expected
    assert pd.read_parquet(folder / "frames.parquet").attrs["units"] == expected
    assert analysis.contacts.attrs["units"]["peak_force_uN"] == "µN"
    assert pd.read_parquet(folder / "centrelines.parquet").attrs["units"]["x_px"] == "px"


def test_a_notebook_shows_contacts_and_messages(analysis):
    shown = analysis._repr_html_()
    assert f"{len(analysis.contacts)} contacts" in shown
    assert "data:image/svg+xml" in shown
    for force in analysis.contacts["peak_force_uN"][:10]:
        assert f"{force:.4g}" in shown
    assert repr(analysis) == (
        f"<Analysis: {analysis.n_frames} frames of C2; {len(analysis.contacts)} contacts>"
    )


def test_a_course_is_drawn_on_the_axes_given(analysis, axis):
    assert plot_course(analysis.frames, "base_angle_deg", "C2", axis) is axis
    time, angle = axis.lines[0].get_data()
    np.testing.assert_array_equal(time, analysis.frames["time_s"])
    np.testing.assert_array_equal(angle, analysis.frames["base_angle_deg"])
    assert axis.get_ylabel() == "base angle (deg)"
    assert len(axis.collections) == 1  # the 95 % interval
    assert len(axis.patches) == len(analysis.contacts)  # shaded


def test_contacts_and_centrelines_are_drawn_on_the_axes_given(analysis, axis):
    assert plot_contacts(analysis.contacts, ax=axis) is axis
    np.testing.assert_array_equal(axis.lines[0].get_ydata(), analysis.contacts["peak_force_uN"])
    other = Figure().subplots()
    assert analysis.plot_centrelines(other, step=20) is other
    assert len(other.lines) == -(-len(analysis.centrelines) // 20)
    assert other.yaxis_inverted()
    assert plot_centrelines(analysis.centrelines[:0], other) is other


def test_wrong_names_are_reported_with_those_there_are(analysis, axis):
    with pytest.raises(ValueError, match="whisker must be one of C2, got 'C3'"):
        plot_course(analysis.frames, whisker="C3", ax=axis)
    with pytest.raises(ValueError, match=r"contact_force_uN.*got 'force'"):
        plot_course(analysis.frames, "force", ax=axis)
    with pytest.raises(ValueError, match=r"one of frame, .*in_contact.*got 'whisker'"):
        plot_course(analysis.frames, "whisker", ax=axis)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda a, _: plot_centrelines(a.frames), "needs the column x_px"),
        (lambda a, _: plot_centrelines(a.lines[0]), "expected a table .*, got Centrelines"),
        (lambda a, _: analyse_lines([1], a.settings), "expected a table .*, got list"),
        (
            lambda a, _: analyse_lines(a.centrelines, a.settings, (300, 200, 6)),
            "pole: expected a `PoleTrack` or None, got tuple",
        ),
        (
            lambda a, _: analyse_lines(
                a.centrelines, a.settings, PoleTrack(np.zeros(7), np.zeros(7), 6.0)
            ),
            r"pole: expected one place .*, or one for each of \d+ frames .*, got 7 in x_px",
        ),
        (
            lambda a, folder: a.save(_file(folder) / "results"),
            r"^/.*ults: cannot write there \(.*e.txt is a file",
        ),
        (lambda _, folder: write_session(folder / "s.toml", {}), "`Settings`, got dict"),
    ],
)
def test_what_is_of_another_type_is_said_to_be(analysis, tmp_path, call, words):
    with pytest.raises(ValueError, match=words):
        call(analysis, tmp_path)


def _file(folder):
    (folder / "file.txt").touch()
    return folder / "file.txt"


def _lines(*frames):
    """A table of lines of one whisker in these frames."""
    line = np.arange(40, 90, dtype=np.float32)
    rows = [{"frame": f, "whisker": "C2", "x_px": line, "y_px": line} for f in frames]
    return pd.DataFrame(rows)


@pytest.mark.parametrize(
    ("video", "settings", "error", "words"),
    [
        (np.zeros((5, 40), np.uint8), "session.toml", VideoError, r"shape \(5, 40\)"),
        (np.zeros((5, 40, 40)), "session.toml", VideoError, "float64 pixels"),
        (np.zeros((5, 40, 40), np.uint8), None, InputError, "no settings"),
        (
            np.zeros((5, 40, 40), np.uint8),
            3,
            InputError,
            "settings: expected `Settings`.* got int",
        ),
        (3, "session.toml", VideoError, "3: expected the path of a video, or an array.*, got int"),
        ("gone.avi", None, VideoError, "gone.avi: does not exist; check the name"),
        (pd.DataFrame({"frame": [0]}), "session.toml", ValueError, "needs the column whisker"),
        (_lines(0.5), "session.toml", ValueError, r"row 0: frame is .*0\.5.*: expected a whole"),
        (_lines(-1), "session.toml", ValueError, "row 0: frame is .*-1.*: expected a whole"),
        (_lines(10**10), "session.toml", ValueError, "row 0: frame is 10000000000: expected a"),
        (
            _lines(0, 1).assign(whisker=["C2", None]),
            "session.toml",
            ValueError,
            "row 1: whisker is nan: expected its name",
        ),
        (
            _lines(0).assign(x_px="[1. 2.]"),
            "session.toml",
            ValueError,
            r"row 0: has '\[1\. 2\.\]' in place of a list of numbers",
        ),
        (
            _lines(4, 4),
            "session.toml",
            ValueError,
            "row 1: a second line of whisker C2 in frame 4",
        ),
    ],
)
def test_what_cannot_be_analysed_gets_a_message(rendered, video, settings, error, words):
    with pytest.raises(error, match=words):
        analyse(video, rendered / settings if isinstance(settings, str) else settings)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ("corrections.csv", "expected a table, as .*read_corrections.*, got str"),
        (pd.DataFrame({"frame": [1]}), "expected the columns whisker, verdict, .*, got frame$"),
        (pd.DataFrame(), "expected the columns .*, got none$"),
        ([("Contact", 5, 9)], "row 0: verdict is 'Contact', expected one of contact"),
        ([("free", 5, 9), ("free", 11.5, 15)], "row 1: expected whole numbers .*, got 11.5, 15.0"),
        ([("free", 5, 9), ("free", np.nan, 15)], "row 1: expected whole numbers .*, got nan"),
        ([("free", 5, 9), ("contact", 9, 5)], "row 1: onset_frame 9 and offset_frame 5"),
        ([("contact", 5, 9), ("contact", 8, 11)], "has frames of contact .5, 9. in row 0"),
        ([("free", 5, 9), ("contact", 5, 9)], "row 0: no contact of 'C2' in .*, but row 1 has"),
    ],
)
def test_corrections_are_checked_before_anything_is_analysed(given, words):
    if isinstance(given, list):
        rows = [("C2", verdict, a, b, min(a, b), max(a, b)) for verdict, a, b in given]
        given = pd.DataFrame([Verdict(*row) for row in rows])
    settings = {"recording": {"frames_per_second": 1e3, "pixels_per_mm": 25, "face": "left"}}
    with pytest.raises(InputError, match=words):
        analyse("gone.avi", settings, corrections=given)
    with pytest.raises(InputError, match=words):
        analyse_lines(_lines(0), settings, corrections=given)


def test_corrections_that_do_not_apply_are_said(analysis):
    rows = [Verdict("D1", "free", 1, 2, 1, 2), Verdict("C2", "free", 5, 10**6, 5, 10**6)]
    given = pd.DataFrame(rows)
    x, y = float(analysis.pole.x_px[0]), float(analysis.pole.y_px[0])
    pole = PoleTrack(x, y, 6.25)
    lines, settings = analysis.centrelines, analysis.settings
    found = analyse_lines(lines, settings, pole, corrections=given)
    assert "1 of 'D1', which is not a whisker of this video (C2): not applied" in str(
        found.messages
    )
    assert "1 reach beyond the video's end" in str(found.messages)
    fits = analyse_lines(lines, settings, pole, corrections=given.iloc[:0])
    assert "corrections" not in str(fits.messages)


def test_corrections_of_a_video_are_said_too(frames, rendered):
    given = pd.DataFrame([Verdict("D1", "free", 1, 2, 1, 2)])
    found = analyse(frames[:20], rendered / "session.toml", corrections=given)
    assert "'D1', which is not a whisker of this video" in str(found.messages)


@pytest.mark.parametrize("fails", [False, True])
def test_temporary_files_are_closed_when_the_analysis_ends(analysis, monkeypatch, fails):
    opened, usual = [], tempfile.TemporaryFile

    def temporary_file(*given, **how):
        opened.append(usual(*given, **how))
        return opened[-1]

    def no_memory(*given):
        raise MemoryError

    monkeypatch.setattr(tempfile, "TemporaryFile", temporary_file)
    if fails:
        monkeypatch.setattr("pipeline.run.forces_of", no_memory)
    with pytest.raises(MemoryError) if fails else nullcontext():
        analyse_lines(analysis.centrelines, analysis.settings)
    assert opened
    assert all(file.closed for file in opened)


def test_a_pole_may_never_be_in_view_and_a_count_be_a_float():
    settings = {"recording": {"frames_per_second": 1e3, "pixels_per_mm": 25, "face": "left"}}
    away = PoleTrack(np.array([np.nan]), np.array([np.nan]), 6.0)
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        found = analyse_lines(_lines(*range(6)), settings, away, 7.0)
    assert (found.n_frames, len(found.contacts)) == (7, 0)


def test_of_a_video_without_whiskers_only_a_message_is_said():
    frames = np.random.default_rng(0).integers(120, 130, (20, 120, 160), dtype=np.uint8)
    settings = {"recording": {"frames_per_second": 1e3, "pixels_per_mm": 25, "face": "left"}}
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        found = analyse(frames, settings)
    assert len(found.centrelines) == 0
    assert "no whiskers found" in found.messages[0]


def test_importing_is_quick_and_writes_nothing(tmp_path):
    """The hook sees a write: that of the file that the child opens itself, and no other."""
    command = [sys.executable, "-c", WRITES, str(tmp_path / "seen")]
    child = subprocess.run(command, capture_output=True, text=True, check=True)
    assert child.stdout.split() == ["1"]  # and neither NumPy nor pandas nor Numba is loaded


def test_errors_of_inputs_can_be_caught_by_their_public_names(tmp_path):
    (tmp_path / "notes.avi").write_text("no video")
    with pytest.raises(pipeline.VideoError):
        pipeline.open_video(tmp_path / "notes.avi")
    (tmp_path / "session.toml").write_text("[recording]")
    with pytest.raises(pipeline.SettingsError):
        pipeline.read_session(tmp_path / "session.toml")
    with pytest.raises(pipeline.InputError):
        pipeline.read_results(tmp_path / "nowhere")
    assert issubclass(pipeline.CorrectionsError, ValueError)


@pytest.mark.parametrize("package", [pipeline, synthetic, pipeline.calibrate])
def test_every_public_name_is_there_and_documented(package):
    names = [name for name in dir(package) if not name.startswith("_")]
    assert set(package.__all__) <= set(names)
    assert len(names) >= 5
    for name in names:
        assert getattr(package, name).__doc__, name
