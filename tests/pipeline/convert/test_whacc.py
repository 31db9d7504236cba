"""WhACC's file of contacts, in and out."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import h5py
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.contacts.corrections import read_corrections
from pipeline.convert.whacc import (
    corrections_of,
    read_whacc,
    take_contacts,
    trial_numbers,
    write_whacc,
)
from pipeline.errors import InputError

DATA = Path(__file__).parents[2] / "data"


def write(path, names, parts, key="labels", **more):
    with h5py.File(path, "w") as file:
        file["full_file_names"] = np.array(names, "S")
        file["frame_nums"] = [len(part) for part in parts]
        file[key] = np.concatenate(parts)
        for name, values in more.items():
            file[name] = values
    return path


def test_contacts_there_and_back(videos, tmp_path):
    labels = read_whacc(write_whacc(tmp_path / "w.h5", videos))
    assert [each.video for each in labels] == ["one", "two"]
    for each, video in zip(labels, videos, strict=True):
        np.testing.assert_array_equal(each.touch, video.frames["in_contact"])


def test_a_person_s_labels_come_before_the_prediction(tmp_path):
    labels, predicted = np.array([-1, 0, 1, -1.0]), np.array([1, 1, 0, 0])
    path = write(tmp_path / "w.h5", [b"C:\\data\\a.mp4"], [labels], yhat=predicted)
    (found,) = read_whacc(path)
    assert found.video == "a"
    np.testing.assert_array_equal(found.touch, [1, 0, 1, 0])
    (found,) = read_whacc(write(tmp_path / "v.h5", [b"/data/a.mp4"], [labels]))
    np.testing.assert_array_equal(found.touch, [-1, 0, 1, -1])


def test_a_file_that_whacc_wrote():
    first, second = read_whacc(DATA / "whacc.h5")
    assert [first.video, second.video] == ["trial_0007", "trial_0012"]
    touching = np.isin(np.arange(40), np.arange(16, 30))
    np.testing.assert_array_equal(first.touch, touching)
    np.testing.assert_array_equal(second.touch[:-1], touching[:-1])
    assert second.touch[-1] == 1  # so a person said


def test_a_prediction_counts_while_the_pole_is_within_reach(tmp_path):
    labels, predicted = np.array([-1, -1, 1, -1.0]), np.array([1, 1, 0, 1])
    for in_range, expected in (
        ([0, 1, 0, 1], [0, 1, 1, 1]),
        ([np.nan] * 4, [1, 1, 1, 1]),  # as long as nobody has said when it is
        ([0, 0, 0, 0], [1, 1, 1, 1]),
    ):
        more = {"yhat": predicted, "in_range": np.array(in_range, float)}
        (found,) = read_whacc(write(tmp_path / "w.h5", [b"a.mp4"], [labels], **more))
        np.testing.assert_array_equal(found.touch, expected)


def test_labels_between_none_and_touch_are_read_as_whacc_draws_them(tmp_path):
    labels = np.array([0.2, 0.5, 0.8, -1, np.nan])
    (found,) = read_whacc(write(tmp_path / "w.h5", [b"a.mp4"], [labels]))
    np.testing.assert_array_equal(found.touch, [0, 0, 1, -1, -1])


@pytest.mark.parametrize(
    ("names", "numbers"),
    [
        (["AH0407x160609-12", "AH0407x160609-3"], [12, 3]),
        (["a_1-007", "b"], [1, 2]),  # one has none
        (["a_5", "b_5"], [1, 2]),  # twice the same
        ([f"a_{10**30}", "a_2"], [1, 2]),
    ],
)
def test_trials_have_the_numbers_of_their_files(names, numbers):
    np.testing.assert_array_equal(trial_numbers(names), numbers)


def test_every_frame_is_written_with_its_trial(videos, tmp_path):
    with h5py.File(write_whacc(tmp_path / "w.h5", videos)) as file:
        counts = file["frame_nums"][:]
        np.testing.assert_array_equal(file["file_name_nums"], np.repeat([1, 2], counts))
        np.testing.assert_array_equal(file["trial_nums_and_frame_nums"], [[1, 2], counts])


@given(touch=st.lists(st.sampled_from([-1, 0, 1]), min_size=1, max_size=30))
def test_every_stretch_is_a_verdict(touch):
    table = corrections_of(np.array(touch), "C2")
    back = np.full(len(touch), -1)
    for row in table.itertuples():
        back[row.onset_frame : row.offset_frame] = row.verdict == "contact"
        assert (row.covers_from, row.covers_to) == (row.onset_frame, row.offset_frame)
    np.testing.assert_array_equal(back, touch)


def test_contacts_are_taken_as_corrections(videos, tmp_path):
    touch = np.zeros(120)
    touch[10:20] = 1
    path = write(tmp_path / "w.h5", [b"one.mp4", b"other.mp4"], [touch, touch])
    (written,) = take_contacts(path, videos)
    assert written == videos[0].folder / "corrections.csv"
    table = read_corrections(videos[0].folder)
    assert list(table["verdict"]) == ["free", "contact", "free"]
    assert list(table["onset_frame"]) == [0, 10, 20]
    before = written.read_bytes()
    assert take_contacts(path, videos) == [written]  # as after an import that was killed
    assert written.read_bytes() == before
    written.write_text(before.decode().replace("contact", "confirmed"))
    with pytest.raises(InputError, match="holds corrections already"):
        take_contacts(path, videos)


@pytest.mark.parametrize(
    ("names", "count", "whisker", "message"),
    [
        ([b"x.mp4"], 120, "", "no video is in both"),
        ([b"one.mp4"], 99, "", "has 99 frames of one, its results 120"),
        ([b"one.mp4"], 120, "D1", "--whisker D1: .* has whiskers C2; say whose contacts"),
    ],
)
def test_what_does_not_fit_is_reported(videos, tmp_path, names, count, whisker, message):
    path = write(tmp_path / "w.h5", names, [np.zeros(count)])
    with pytest.raises(InputError, match=message):
        take_contacts(path, videos, whisker)


def test_no_video_gets_the_contacts_of_another_one_of_its_name(videos, tmp_path):
    one, two = (np.zeros(video.n_frames) for video in videos)
    path = write(tmp_path / "w.h5", [b"D:\\monday\\one.mp4", b"D:\\friday\\one.mp4"], [one, one])
    with pytest.raises(InputError, match=r"w\.h5: one is the name of two videos"):
        take_contacts(path, videos)
    path = write(tmp_path / "v.h5", [b"one.mp4", b"another.mp4"], [one, two])
    elsewhere = replace(videos[1], path="D:\\friday\\one.mp4")
    with pytest.raises(InputError, match=r"v\.h5: one is the name of two videos"):
        take_contacts(path, [videos[0], elsewhere])
    assert not list(tmp_path.glob("*/*/corrections.csv"))
    renamed = replace(videos[1], path="/data/another.mp4")
    written = [each.parent.name for each in take_contacts(path, [videos[0], renamed])]
    assert written == ["one", "two"]


def test_other_files_are_reported(tmp_path):
    path = tmp_path / "w.h5"
    for content in (b"", b"no HDF5"):
        path.write_bytes(content)
        with pytest.raises(InputError, match=r"w\.h5: cannot be read as WhACC's file"):
            read_whacc(path)
    write(path, [b"a.mp4"], [np.zeros(3)])
    with h5py.File(path, "a") as file:
        del file["labels"]
        file["labels"] = np.zeros(2)
    with pytest.raises(InputError, match="2 labels, 3 frames"):
        read_whacc(path)
    whole = write(path, [b"a.mp4"], [np.zeros(3)]).read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(InputError, match="copy it again"):
        read_whacc(path)


def test_of_a_file_of_another_video_it_is_said_what_to_do(tmp_path):
    write(tmp_path / "a.h5", [b"one.mp4"], [np.zeros(99)])
    video = SimpleNamespace(name="one", path="one.mp4", whiskers=("C2",), n_frames=120,
                            folder=tmp_path)  # fmt: skip
    with pytest.raises(InputError, match=r"cut off; name the file that was made of this video"):
        take_contacts(tmp_path / "a.h5", [video])
