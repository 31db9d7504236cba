"""NWB files: valid, without complaint of the inspector, and the same when read back."""

import os
import warnings
from dataclasses import replace
from datetime import datetime

import numpy as np
import pandas as pd
import pynwb
import pytest
from nwbinspector import Importance, inspect_nwbfile

from pipeline.convert import results
from pipeline.convert.nwb import write_nwb
from pipeline.errors import InputError, VideoError
from pipeline.session.session_file import session_text

START = "2024-05-31T14:30:00+02:00"
ANIMAL = {"subject_id": "m1", "species": "Mus musculus", "sex": "F", "age": "P90D"}


@pytest.fixture
def written(videos, tmp_path):
    (path,) = write_nwb(tmp_path, videos[0], START, **ANIMAL)
    return path, videos[0]


def read(path):
    return pynwb.NWBHDF5IO(path, "r")


def test_everything_reads_back_equal(written):
    path, video = written
    with read(path) as file:
        nwb = file.read()
        assert nwb.session_start_time == datetime.fromisoformat(START)
        series = nwb.processing["behavior"]["whiskers"].time_series
        for name, column, factor, unit in [
            ("C2_base_angle", "base_angle_deg", np.pi / 180, "radians"),
            ("C2_curvature", "curvature_per_m", 1, "1/meters"),
            ("C2_contact_force", "contact_force_uN", 1e-6, "newtons"),
            ("C2_contact_force_se", "contact_force_uN_se", 1e-6, "newtons"),
            ("C2_base_moment", "base_moment_nN_m", 1e-9, "newton meters"),
            ("C2_contact_arc_length", "contact_arc_length_mm", 1e-3, "meters"),
            ("C2_follicle_x_px", "follicle_x_px", 1, "pixels"),
            ("C2_in_contact", "in_contact", 1, "a.u."),
        ]:
            assert (series[name].unit, series[name].rate) == (unit, 1000.0)
            expected = factor * video.frames[column].to_numpy(float)
            np.testing.assert_array_equal(series[name].data[:], expected)
        contacts = nwb.intervals["contacts"].to_dataframe()
        for column in ("onset_frame", "peak_force_uN", "flags", "whisker", "vibration_ratio"):
            np.testing.assert_array_equal(contacts[column], video.contacts[column])
        np.testing.assert_array_equal(contacts["start_time"], video.contacts["onset_s"])
        np.testing.assert_allclose(
            contacts["stop_time"] - contacts["start_time"], 1e-3 * video.contacts["duration_ms"]
        )
        assert nwb.get_scratch("session_toml") == session_text(video.settings)


def test_a_name_may_have_letters_that_the_format_has_not(videos, tmp_path):
    video = replace(videos[0])
    video.__dict__["frames"] = videos[0].frames.assign(whisker="left: C/2")
    (path,) = write_nwb(tmp_path, video, START)
    with read(path) as file:
        series = file.read().processing["behavior"]["whiskers"].time_series
        assert series["left_ C_2_base_angle"].description.startswith("whisker left: C/2: ")


def test_names_that_the_format_cannot_keep_apart_are_refused(videos, tmp_path):
    video, frames = replace(videos[0]), videos[0].frames
    same = [frames.assign(whisker=name) for name in ("a/b", "a_b")]
    video.__dict__["frames"] = pd.concat(same)
    with pytest.raises(InputError, match=r'whiskers "a/b" and "a_b": .* be called a_b_tracked'):
        write_nwb(tmp_path, video, START)
    assert not (tmp_path / f"{video.name}.nwb").exists()


def test_centrelines_and_pole_read_back_equal(written):
    path, video = written
    with read(path) as file:
        module = file.read().processing["behavior"]
        table, lines = module["centrelines"], video.lines()
        np.testing.assert_array_equal(table["frame"].data[:], lines.frame)
        assert set(table["whisker"].data[:]) == {"C2"}
        for row in (0, 7, 119):
            points = np.column_stack([table["x_px"][row], table["y_px"][row]])
            np.testing.assert_array_equal(points, lines.row(row))
        pole = module["pole_position"]["pole"].data[:]
        np.testing.assert_array_equal(pole[5], [230, 240])


@pytest.mark.slow
def test_valid_and_nothing_wrong_for_the_inspector(written):
    path, _ = written
    assert not pynwb.validate(path=str(path))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = list(inspect_nwbfile(nwbfile_path=str(path)))
    bad = [m for m in found if m.importance.value > Importance.BEST_PRACTICE_SUGGESTION.value]
    assert bad == []


@pytest.mark.slow
def test_the_video_is_referred_to_where_it_is(videos, tmp_path):
    (tmp_path / "films").mkdir()
    (tmp_path / "films" / "one.avi").write_bytes(b"")
    (tmp_path / "nwb").mkdir()
    video = replace(videos[0], path=str(tmp_path / "films" / "one.avi"))
    (path,) = write_nwb(tmp_path / "nwb", video, **ANIMAL)
    with read(path) as file:
        series = file.read().acquisition["video"]
        assert series.external_file[:].tolist() == ["../films/one.avi"]
        assert series.rate == 1000.0
    found = inspect_nwbfile(nwbfile_path=str(path))
    assert [m for m in found if m.importance.value >= Importance.CRITICAL.value] == []


def test_another_video_of_that_name_is_not_referred_to(videos, tmp_path, monkeypatch):
    (tmp_path / "one.avi").write_bytes(b"")
    os.utime(tmp_path / "one.avi", (5, 5))
    video = replace(videos[0], path=str(tmp_path / "one.avi"))

    def is_another(folder, path):
        assert (folder, str(path)) == (video.folder, video.path)
        raise VideoError(path, "is another")

    monkeypatch.setattr(results, "check_video", is_another)
    (path,) = write_nwb(tmp_path, video)
    with read(path) as file:
        nwb = file.read()
        assert not nwb.acquisition
        assert nwb.session_start_time.year > 1970


@pytest.mark.parametrize("start", ["yesterday", "0001-01-01"])
def test_a_wrong_date_is_reported(videos, tmp_path, start):
    with pytest.raises(InputError, match=f"--start {start}: is not a date"):
        write_nwb(tmp_path, videos[0], start)


@pytest.mark.parametrize("age", ["P90D", "P2Y6M", "PT12H", "P1D/P3D", "P90Y/"])
def test_ages_and_ranges_of_them_are_durations(videos, tmp_path, age):
    (path,) = write_nwb(tmp_path, videos[0], age=age)
    with read(path) as file:
        assert file.read().subject.age == age


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"sex": "male"}, "--sex male: expected F .*M"),
        ({"age": "90"}, "--age 90: .*such as P90D"),
        ({"age": "P90"}, "--age P90: .*such as P90D"),
        ({"age": "P1D/PT"}, "--age P1D/PT: .*such as P90D"),
        ({"species": "mouse"}, "--species mouse: expected its Latin name"),
    ],
)
def test_what_the_format_does_not_know_of_an_animal_is_refused(videos, tmp_path, given, words):
    with pytest.raises(InputError, match=words):
        write_nwb(tmp_path, videos[0], **given)
