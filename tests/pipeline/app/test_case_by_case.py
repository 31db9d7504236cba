"""Which whisker of some videos is meant, and what is left out."""

from types import SimpleNamespace

import pytest

from pipeline.app import cli
from pipeline.app.case_by_case import each, one_whisker
from pipeline.convert.results import VideoResults
from pipeline.errors import InputError, VideoError

VIDEOS = [SimpleNamespace(whiskers=["C2", "D1"]), SimpleNamespace(whiskers=["C2"])]


def test_the_only_whisker_needs_no_name():
    assert one_whisker(VIDEOS[1:], None) == "C2"
    assert one_whisker(VIDEOS, "D1") == "D1"


@pytest.mark.parametrize(
    ("wanted", "message"),
    [(None, "--whisker: expected one of C2, D1"), ("E1", "--whisker E1: expected one of C2, D1")],
)
def test_a_whisker_that_is_not_clear_is_asked_for(wanted, message):
    with pytest.raises(ValueError) as caught:
        one_whisker(VIDEOS, wanted)
    assert str(caught.value) == message


def test_numbered_whiskers_are_named_in_their_order():
    many = [SimpleNamespace(whiskers=[f"w{k}" for k in range(1, 13)])]
    with pytest.raises(ValueError, match=r"one of w1 to w12$"):
        one_whisker(many, None)


def test_a_video_with_damaged_tables_names_no_whisker_and_hides_none(tmp_path):
    (tmp_path / "frames.parquet").write_text("damaged")
    damaged = VideoResults("one", tmp_path, "one.avi")
    assert one_whisker([damaged, *VIDEOS[1:]], None) == "C2"
    with pytest.raises(ValueError, match=r"frames\.parquet: damaged"):
        one_whisker([damaged], "C2")


def test_what_cannot_be_measured_or_read_is_left_out_and_the_rest_measured():
    reasons = [ValueError("shows\nnone"), VideoError("a.avi", "gone"), OSError(5, "", "b.avi")]

    def measure(case):
        if isinstance(case, Exception):
            raise case
        return case

    said = []

    def measured_of(*cases):
        return each(cases, measure, str, said.append, lambda case: "left: ", none="2 cases")

    measured, faults = measured_of(*reasons, 7)
    assert measured == [7]
    assert faults == ["left: shows none", "left: a.avi: gone", "left: b.avi: Input/output error"]
    assert said == [*(f"left out: {fault}" for fault in faults), "7"]
    with pytest.raises(InputError, match="--start"):  # the same for all
        measured_of(InputError("--start soon"), 7)
    with pytest.raises(InputError, match=r"^2 cases; the first: left: shows none$"):
        measured_of(*reasons[:2])


@pytest.mark.parametrize("left_out", [[], ["one"]])
@pytest.mark.parametrize("command", ["geometry", "ringdown", "dust", "views"])
def test_the_exit_status_says_whether_something_was_left_out(
    monkeypatch, tmp_path, command, left_out
):
    module = f"pipeline.app.calibrate_{command}"
    monkeypatch.setattr(f"{module}.run_{command}", lambda *arguments: left_out)
    paths = [tmp_path, tmp_path] if command == "views" else [tmp_path]
    options = ["--points", tmp_path] if command == "views" else []
    with pytest.raises(SystemExit) as caught:
        cli.main([str(w) for w in ("calibrate", command, *paths, "--out", tmp_path, *options)])
    assert caught.value.code == len(left_out)
