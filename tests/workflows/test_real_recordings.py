"""The program for real recordings: what it is given, and one rendered video with true labels."""

import argparse
import json
from pathlib import Path

import numpy as np
import pytest
import real_recordings

from pipeline.runtime import Step
from pipeline.tables.centrelines import read_centrelines


def test_video_and_face():
    assert real_recordings.video_and_face("a:b.mp4:top") == (Path("a:b.mp4"), "top")
    with pytest.raises(argparse.ArgumentTypeError, match="expected VIDEO:SIDE"):
        real_recordings.video_and_face("a.mp4")


def test_scales():
    assert real_recordings.arguments(["a.mp4:top"]).scales == ["12", "16", "25"]
    assert real_recordings.scales("12.5,init") == ["12.5", "init"]
    for wrong in ("12,", "-3", "nan", "guess"):
        with pytest.raises(argparse.ArgumentTypeError, match="expected pixels per mm or init"):
            real_recordings.scales(wrong)


def test_only_face_scale_and_rate_are_given():
    settings = real_recordings.settings_for(Path("a.mp4"), "top", "12", 500.0)
    recording = settings.recording
    assert (recording.face, recording.pixels_per_mm) == ("top", 12.0)
    assert recording.frames_per_second == 500.0
    assert settings.whisker == ()


def test_time_is_counted_from_the_first_frame_to_the_last_name(monkeypatch):
    times = iter(range(10, 100))
    monkeypatch.setattr(real_recordings.time, "process_time", lambda: next(times))
    clock = real_recordings.FollowingClock()
    for stage, done in (("scene", 0), ("whiskers", 0), ("following", 1), ("following", 2)):
        clock(Step(stage, done, 2))
    clock(Step("forces"))
    clock(Step("contacts"))
    assert (clock.begun, clock.ended) == (10, 11)


def labels_of(video, folder, frames):
    """The true whisker in some frames, clear, and beside it one that is not there, faint."""
    truth = read_centrelines(video.parent / "truth" / video.stem / "centrelines.parquet")
    entries = []
    for frame in frames:
        line = truth.row(int(np.flatnonzero(truth.frame == frame)[0])).astype(float)
        whiskers = [
            {"kind": kind, "xy": (line[40:-60] + np.array([0, shift])).tolist()}
            for kind, shift in (("clear", 0), ("faint", 40))
        ]
        entry = {"video": video.stem, "frame": frame, "whiskers": whiskers, "ignore": []}
        entries.append(entry)
    path = folder / "labels.json"
    path.write_text(json.dumps(entries), "utf-8")
    return path


def test_labels_of_other_videos_are_refused(tmp_path):
    assert real_recordings.labels_for(None, [Path("a.mp4")]) == {}
    path = tmp_path / "labels.json"
    path.write_text('[{"video": "b", "frame": 1, "whiskers": []}]', "utf-8")
    assert set(real_recordings.labels_for(path, [Path("a.mp4"), Path("b.mkv")])) == {"b"}
    with pytest.raises(ValueError, match=r"labels of b, expected some of a;"):
        real_recordings.labels_for(path, [Path("a.mp4")])


@pytest.mark.slow
@pytest.mark.e2e
def test_a_rendered_whisker_is_found_in_both_directions(video, tmp_path, capsys):
    labels = labels_of(video, tmp_path, [20, 130, 250])
    given = [f"{video}:left", "--scales", "25", "--labels", str(labels), "--backwards"]
    assert real_recordings.main(given) == 0
    lines = capsys.readouterr().out.splitlines()
    table = [[cell.strip() for cell in line.split("|")[1:-1]] for line in lines]
    header, _, forwards, backwards, _, angles, *_ = table
    assert header == real_recordings.HEADER
    assert angles == real_recordings.real_angles.HEADER
    for row, direction in ((forwards, "forwards"), (backwards, "backwards")):
        cells = dict(zip(header, row, strict=True))
        assert cells["direction"] == direction
        assert cells["clear"] == "3 of 3 (100%)"
        assert cells["faint"] == "0 of 3 (0%)"
        assert cells["wrong / frame"] == "0.00"
        assert float(cells["distance"]) < 0.1  # px
        assert float(cells["CPU"]) > 0
    assert cells["names agree"].endswith("(100%)")
