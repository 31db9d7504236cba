"""Frames of a video in any order."""

import time

import numpy as np
import pytest
from curated import PATIENCE_S

from pipeline.curate.frames import BLOCK, FrameReader
from pipeline.errors import VideoError

pytestmark = pytest.mark.e2e


def test_frames_in_any_order_are_the_videos_own(video):
    path, frames = video
    reader = FrameReader(path, len(frames), cache_bytes=3 * BLOCK * frames[0].nbytes)
    order = np.random.default_rng(1).permutation(len(frames))[:25]
    for i in [*order, *range(len(frames) - 1, len(frames) - 70, -1), 0, len(frames) - 1]:
        np.testing.assert_array_equal(reader.frame(int(i)), frames[i])
    reader.close()


def test_the_cache_keeps_to_its_size(video):
    path, frames = video
    limit = 4 * BLOCK * frames[0].nbytes
    reader = FrameReader(path, len(frames), cache_bytes=limit)
    for i in range(0, len(frames), 5):
        reader.frame(i)
    held = sum(len(block) for block in reader._blocks.values()) * frames[0].nbytes
    reader.close()
    assert held <= limit


def test_who_cannot_wait_is_called_when_the_frame_is_there(video):
    path, frames = video
    reader = FrameReader(path, len(frames))
    there = []
    reader.when_there(200, lambda: there.append(200))
    deadline = time.monotonic() + PATIENCE_S
    while not there and time.monotonic() < deadline:
        time.sleep(0.01)
    assert there == [200]
    np.testing.assert_array_equal(reader.frame(200, timeout=0), frames[200])
    reader.close()


def test_who_waits_is_called_when_the_reader_is_closed(video):
    """Another tab that leaves the video closes it: this one must ask anew for its picture."""

    class Idle(FrameReader):
        def _next_run(self):
            return None

    path, frames = video
    reader, called = Idle(path, len(frames)), []
    reader.when_there(200, lambda: called.append(200))
    assert called == []
    reader.close()
    assert called == [200]


def test_frames_that_are_not_there_raise_and_do_not_hang(video):
    path, frames = video
    reader = FrameReader(path, len(frames) + 40)
    with pytest.raises(VideoError, match="ends before frame"):
        reader.frame(len(frames) + 10)
    with pytest.raises(ValueError, match="index must be in"):
        reader.frame(len(frames) + 40)
    np.testing.assert_array_equal(reader.frame(5), frames[5])
    reader.close()
