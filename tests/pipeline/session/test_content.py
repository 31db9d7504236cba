"""Whether a video is that of its results."""

import os

import cv2
import numpy as np
import pytest

from pipeline.errors import VideoError
from pipeline.session import content
from pipeline.session.content import check_video, same_input, sha256, stamp
from pipeline.tables.run_record import write_state


def state_of(video, **known):
    """A record as a run leaves it."""
    return {
        "version": "0.1.0", "video": "a", "path": str(video), "status": "done", "frames": 5,
        "frames_per_s": 9.0, "message": "", "contacts": 0, "stages": {}, "sha256": sha256(video),
        "pole": None, "settings_sha256": "", "input": stamp(video), **known,
    }  # fmt: skip


def test_another_video_of_the_same_name_and_size_is_not_taken_for_that_of_the_results(tmp_path):
    video, folder = tmp_path / "a.avi", tmp_path / "results" / "a"
    folder.mkdir(parents=True)
    video.write_bytes(b"monday")
    check_video(folder, video)  # nothing is known of it
    write_state(folder, state_of(video))
    os.utime(video, ns=(5, 5))  # copied from another disk
    check_video(folder, video)
    video.write_bytes(b"friday")
    with pytest.raises(VideoError, match=r"a\.avi: is not the video of these results"):
        check_video(folder, str(video))
    video.unlink()
    check_video(folder, video)  # who opens it says so


def test_a_video_that_was_moved_is_read_once(tmp_path, monkeypatch):
    video, read = tmp_path / "a.avi", []
    video.write_bytes(b"monday")
    state = state_of(video)
    os.utime(video, ns=(5, 5))
    whole = content.whole_files.sha256
    monkeypatch.setattr(
        content.whole_files, "sha256", lambda path: read.append(path) or whole(path)
    )
    assert all(same_input(state, video) for _ in range(3))
    assert len(read) == 1
    video.write_bytes(b"friday")
    assert not same_input(state, video)


@pytest.mark.parametrize("kind", ["images", "tracker"])
def test_what_belongs_to_a_video_counts_and_nothing_else(tmp_path, kind):
    if kind == "images":
        video, part, other = tmp_path, tmp_path / "1.png", tmp_path / ".DS_Store"
        for number in range(2):
            cv2.imwrite(str(tmp_path / f"{number}.png"), np.zeros((4, 4), np.uint8))
    else:
        video, part, other = (tmp_path / f"a{s}" for s in (".whiskers", ".measurements", ".toml"))
        video.write_bytes(b"lines")
        part.write_bytes(b"which whiskers they are")
    state = {"sha256": sha256(video), "input": stamp(video)}
    other.write_bytes(b"settings, or what a browser of files leaves")
    (tmp_path / "session.toml").write_text("[recording]")
    assert same_input(state, video)
    assert state["input"] == stamp(video)
    content = part.read_bytes()
    part.write_bytes(content[::-1])
    assert not same_input(state, video)
    part.write_bytes(content)
    assert same_input(state, video)
    part.unlink()
    assert not same_input(state, video)
