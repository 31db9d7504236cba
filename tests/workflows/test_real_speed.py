"""The program that compares speeds on real recordings."""

from types import SimpleNamespace

import numpy as np
import pytest
import real_speed

from synthetic.encode import write_video
from synthetic.scene import Codec

FRAMES = 12
START_UP_S, PER_FRAME_S = 2.0, 0.25  # of the peer below


class Peer:
    """A peer that takes a known time, and finds three lines a frame."""

    def trace(self, video):
        with real_speed.open_video(video) as source:
            count = sum(1 for _ in source.frames())
        return [None] * 3 * count, 0.0, START_UP_S + PER_FRAME_S * count


@pytest.fixture
def video(tmp_path):
    frames = (np.full((64, 128), 10 * k, np.uint8) for k in range(FRAMES))
    path = tmp_path / "a.avi"
    write_video(path, frames, Codec("ffv1"))
    return path


@pytest.fixture
def ours(monkeypatch):
    times = iter([0.2, 0.1, 0.4])  # s per frame, of three runs

    def processed(path, settings):
        return SimpleNamespace(lines=[None] * 24, n_frames=FRAMES, cpu=next(times))

    monkeypatch.setattr(real_speed, "processed", processed)


ARGS = SimpleNamespace(scale="16", frames_per_second=1000.0)


def test_start_up_is_taken_off_and_the_least_time_counts(video, ours):
    row = real_speed.row_of(video, "left", Peer(), ARGS)
    assert row[:5] == ["a", "128 × 64", "2.0", "100.0", "10"]
    assert row[5:8] == ["3.0", "250", "2.5 (MISSED: 5)"]
    assert row[8:] == ["76", "0.8 (MISSED: 3)"]


def test_without_a_peer_its_columns_are_empty(video, ours):
    row = real_speed.row_of(video, "left", None, ARGS)
    assert row[3] == "100.0"
    assert set(row[5:]) == {"–"}
