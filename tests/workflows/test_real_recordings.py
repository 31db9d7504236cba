"""The program for real recordings: what it is given, and its tables of lines that are known."""

import argparse
import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
import real_recordings

from pipeline.runtime import Step
from pipeline.tables import Centrelines
from pipeline.video import open_video
from synthetic.encode import write_video
from synthetic.scene import Codec
from synthetic.session import render_session

FRAMES = 10


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


def test_or_what_init_writes_is_given(tmp_path):
    path = render_session(tmp_path, "single", seed=1, trials=1, frames=60)[0]
    settings = real_recordings.settings_for(path, "top", "init", 500.0)
    assert settings.recording.face == "left"  # found, not given
    assert settings.recording.pixels_per_mm == pytest.approx(25, rel=0.02)
    assert [whisker.name for whisker in settings.whisker] == ["w1"]


def test_time_is_counted_from_the_first_frame_to_the_last_name(monkeypatch):
    times = iter(range(10, 100))
    monkeypatch.setattr(real_recordings.time, "process_time", lambda: next(times))
    clock = real_recordings.FollowingClock()
    for stage, done in (("scene", 0), ("whiskers", 0), ("following", 1), ("following", 2)):
        clock(Step(stage, done, 2))
    clock(Step("forces"))
    clock(Step("contacts"))
    assert (clock.begun, clock.ended) == (10, 11)


def test_labels_of_other_videos_are_refused(tmp_path):
    assert real_recordings.labels_for(None, [Path("a.mp4")]) == {}
    path = tmp_path / "labels.json"
    path.write_text('[{"video": "b", "frame": 1, "whiskers": []}]', "utf-8")
    assert set(real_recordings.labels_for(path, [Path("a.mp4"), Path("b.mkv")])) == {"b"}
    with pytest.raises(ValueError, match=r"labels of b, expected some of a;"):
        real_recordings.labels_for(path, [Path("a.mp4")])


def follow_two(video, settings, keep, progress):
    """What `analyse` would find: a whisker that is known, and one that is known in some frames."""
    with open_video(video) as source:
        down = float(next(iter(source)).flat[0])  # 0 in the first frame forwards
    x = np.tile(np.arange(100, dtype=np.float32), 2 * FRAMES)
    y = np.repeat(np.tile([10.0, 40.0], FRAMES), 100) + (1.0 if down else 0.0)
    frame, whisker = np.repeat(np.arange(FRAMES), 2), np.tile([0, 1], FRAMES)
    confidence = np.where((whisker == 1) & (frame < 5), 0.3, 0.9)
    offsets = np.arange(2 * FRAMES + 1) * 100
    names = ("w1", "w2") if down else ("w2", "w1")
    progress(Step("following", 1, FRAMES))
    lines = Centrelines(names, frame, whisker, offsets, x, y, 0 * x, confidence)
    keep(lines)
    progress(Step("forces"))
    angles = dict.fromkeys(("base_angle_deg", "base_angle_se_deg", "visible_angle_deg"), 90.0)
    frames = pd.DataFrame({"frame": frame, "whisker": np.array(names)[whisker], "tracked": True})
    frames = frames.assign(confidence=confidence, **angles)
    return SimpleNamespace(frames=frames, n_frames=FRAMES)


def test_tables_of_what_was_found(tmp_path, monkeypatch, capsys):
    frames = (np.full((64, 128), 10 * k, np.uint8) for k in range(FRAMES))
    write_video(tmp_path / "a.avi", frames, Codec("ffv1"))
    whiskers = [{"kind": "clear", "xy": [[0, y], [99, y]]} for y in (10, 25)]
    entry = {"video": "a", "frame": 2, "whiskers": whiskers}
    (tmp_path / "labels.json").write_text(json.dumps([entry]), "utf-8")
    page = tmp_path / "page.md"
    page.write_text("<!-- real recordings: begin --><!-- real recordings: end -->", "utf-8")
    monkeypatch.setattr(real_recordings, "analyse", follow_two)
    monkeypatch.setattr(real_recordings.measuring, "limit_threads", lambda: None)
    given = f"{tmp_path / 'a.avi'}:left --scales 12 --labels {tmp_path / 'labels.json'}"
    assert real_recordings.main([*given.split(), "--backwards", "--write", str(page)]) == 0
    said = capsys.readouterr().out
    assert said.strip() in page.read_text("utf-8")
    table = [[c.strip() for c in line.split("|")[1:-1]] for line in said.splitlines()]
    forwards, backwards = (dict(zip(table[0], row, strict=True)) for row in table[2:4])
    for row in (forwards, backwards):
        assert float(row.pop("CPU")) >= 0
    same = {"video": "a", "face": "left", "px/mm": "12", "lines / frame": "2.0", "known": "75%"}
    same |= {"clear": "1 of 2 (50%)", "faint": "–", "wrong / frame": "1.00"}
    alone = {"direction": "forwards", "distance": "0.00", "names agree": "–", "links": "–"}
    assert forwards == same | alone
    # of the second whisker, five frames are unknown forwards, and five others backwards
    agree = {"distance": "1.00", "names agree": "10 of 10 (100%)", "links": "100.0%"}
    assert backwards == same | {"direction": "backwards"} | agree
    assert dict(zip(*table[5:8:2], strict=True))["known"] == "15"


def test_a_video_without_lines_gets_a_sentence():
    def row(video, known):
        return [video, "top", "12", "forwards", "0.0", known, *7 * "–"]

    lines = [row("a", "50%"), row("a", "–"), row("b", "–"), row("b", "–")]
    angles = [["a", "12", *10 * "1"], ["b", "12", *10 * "–"]]
    text = real_recordings.tables_text(lines, angles)
    assert [text.count(f"| {video} ") for video in "ab"] == [3, 0]
    assert text.endswith("No line was found in any of the 2 runs of b.")
