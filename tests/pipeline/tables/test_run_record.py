"""The record of one video's results."""

import os

import pytest

from pipeline.errors import VideoError
from pipeline.tables.run_record import check_video, found_video, stamp, write_state
from pipeline.tables.whole_files import sha256


@pytest.mark.parametrize("recorded", ["/lab/videos/a.avi", r"C:\lab\videos\a.avi", "a.avi"])
@pytest.mark.parametrize("place", [".", ".."])
def test_a_video_is_found_beside_results_that_come_from_another_computer(
    tmp_path, recorded, place
):
    folder = tmp_path / "results" / "a"
    folder.mkdir(parents=True)
    assert str(found_video(folder, recorded)) == recorded
    there = (folder.parent / place).resolve() / "a.avi"
    there.touch()
    assert found_video(folder, recorded) == there
    assert str(found_video(folder, "/lab/images/a")) == "/lab/images/a"  # not the results


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
