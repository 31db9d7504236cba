"""StreamPix sequences: what the camera stored comes out; what is damaged is named."""

import os

import numpy as np
import pytest
from camera_files import streampix
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from pipeline.errors import VideoError
from pipeline.video.open import find_videos, open_video


def frames_of(n=5, height=6, width=10, bits=8):
    dtype = np.uint8 if bits == 8 else np.uint16
    rng = np.random.default_rng(n)
    return rng.integers(0, 1 << bits, (n, height, width)).astype(dtype)


def write(path, *args, **kwargs):
    path.write_bytes(streampix(*args, **kwargs))
    return path


@pytest.mark.parametrize("version", [3, 5])
def test_frames_and_header_come_out_as_stored(tmp_path, version):
    frames = frames_of()
    with open_video(write(tmp_path / "a.SEQ", frames, version=version, rate=500.0)) as video:
        assert (video.width, video.height, video.n_frames) == (10, 6, 5)
        assert video.exact_count
        assert video.header.frames_per_second == 500.0
        np.testing.assert_array_equal(list(video), frames)
        np.testing.assert_array_equal(list(video.frames(2, 4)), frames[2:4])


@pytest.mark.parametrize(
    ("bits", "said", "drop"), [(12, 12, 4), (10, 12, 4), (16, 16, 8), (16, 12, 8), (12, 16, 8)]
)
def test_deep_pixels_keep_their_highest_8_bits(tmp_path, bits, said, drop):
    """Of what the header says and what the pixels hold, the more counts: nothing is cut off."""
    frames = frames_of(bits=bits)
    frames[0, 0, 0] = (1 << bits) - 1
    with open_video(write(tmp_path / "a.seq", frames, true_bits=said)) as video:
        np.testing.assert_array_equal(list(video), frames >> drop)


@given(frames=arrays(np.uint8, st.tuples(*[st.integers(1, 5)] * 3)))
def test_any_frames_come_back(tmp_path_factory, frames):
    path = tmp_path_factory.mktemp("seq") / "a.seq"
    with open_video(write(path, frames)) as video:
        np.testing.assert_array_equal(list(video), frames)


def test_a_recording_broken_off_gives_its_whole_frames(tmp_path):
    path = write(tmp_path / "a.seq", frames_of(), count=0)
    path.write_bytes(path.read_bytes()[:-512])
    with open_video(path) as video:
        np.testing.assert_array_equal(list(video), frames_of()[:4])


def test_a_file_cut_off_fails_at_the_missing_frame(tmp_path):
    path = write(tmp_path / "a.seq", frames_of())
    path.write_bytes(path.read_bytes()[: 1024 + 3 * 512])
    with open_video(path) as video:
        frames = iter(video)
        np.testing.assert_array_equal([next(frames) for _ in range(3)], frames_of()[:3])
        with pytest.raises(VideoError, match=r"holds 3 .* header says 5.*copy it") as caught:
            next(frames)
    assert caught.value.frame == 3


def test_a_file_cut_off_while_it_is_read_gives_the_frames_before(tmp_path):
    """Were it mapped into memory, the system would end the program."""
    path = write(tmp_path / "a.seq", np.zeros((5, 64, 64), np.uint8))
    with open_video(path) as video:
        frames = iter(video)
        next(frames)
        os.truncate(path, 1024 + 64 * 64)
        with pytest.raises(VideoError, match=r"holds 1 frame, .*copy it again") as caught:
            next(frames)
    assert caught.value.frame == 1


@pytest.mark.parametrize("length", [0, 3, 300, 623, 1023])
def test_a_file_without_a_whole_frame_says_so(tmp_path, length):
    path = tmp_path / "a.seq"
    path.write_bytes(streampix(frames_of())[:length])
    with pytest.raises(VideoError, match=r"copy"):
        open_video(path)


@pytest.mark.parametrize(
    ("other", "message"),
    [
        ({"compression": 1}, "compression 1.*export it with StreamPix"),
        ({"image_format": 101}, "image format 101.*expected 0 and 100"),
    ],
)
def test_other_kinds_say_what_to_export(tmp_path, other, message):
    with pytest.raises(VideoError, match=message):
        open_video(write(tmp_path / "a.seq", frames_of(), **other))


@given(place=st.integers(548, 623), value=st.integers(0, 255))
def test_a_damaged_header_never_crashes(tmp_path_factory, place, value):
    """One byte is wrong: the frames come, or the error names the file."""
    data = bytearray(streampix(frames_of()))
    data[place] = value
    path = tmp_path_factory.mktemp("seq") / "a.seq"
    path.write_bytes(data)
    message = str(path)
    try:
        with open_video(path) as video:
            for _ in zip(video, range(9), strict=False):
                pass
    except VideoError as error:
        message = str(error)
    assert str(path) in message


def problems_of(path):
    with open_video(path) as video:
        for _ in video.watched():
            pass
        return list(video.problems())


def times_of(n, rate, dropped=(), late=0.0):
    """Times [s] at which a computer got n frames, each by up to `late` of a frame too late."""
    numbers = np.setdiff1d(np.arange(n + len(dropped)), dropped)
    return (numbers + np.random.default_rng(0).uniform(0, late, n)) / rate


@pytest.mark.parametrize(
    ("version", "rate"), [(3, 200.0), (3, 333.3), (3, 500.0), (5, 500.0), (5, 2000.0)]
)
@pytest.mark.parametrize("late", [0.0, 0.4])
def test_frames_that_the_camera_dropped_are_said(tmp_path, version, rate, late):
    """Times are given to a millisecond before version 5, to a microsecond since."""
    frames = frames_of(300)
    whole = times_of(300, rate, late=late)
    assert problems_of(write(tmp_path / "a.seq", frames, version=version, times=whole)) == []
    times = times_of(300, rate, [100, 200, 201, 202], late)
    (said,) = problems_of(write(tmp_path / "a.seq", frames, version=version, times=times))
    assert said == (
        "4 missing by the file's own times, before frames 100, 199: later times are too early"
    )


@pytest.mark.parametrize(("rate", "least"), [(999.0, 9), (1000.0, 9), (2000.0, 8)])
@pytest.mark.parametrize("late", [0.0, 0.4])
def test_many_dropped_frames_are_said_also_where_a_millisecond_is_no_less_than_a_frame(
    tmp_path, rate, least, late
):
    """A single one is no more than the times are rounded by."""
    frames = frames_of(300)
    for dropped, said in (
        ([], []),
        ([100], []),
        (
            [100, *range(200, 210)],
            [f"at least {least} missing by the file's own times, before frame 199: later times "
             "are too early"],
        ),
    ):  # fmt: skip
        times = times_of(300, rate, dropped, late)
        assert problems_of(write(tmp_path / "a.seq", frames, times=times)) == said


def test_frames_that_only_come_late_are_none_that_are_missing(tmp_path):
    """As where the computer was busy: those behind them follow sooner."""
    times = times_of(300, 1000.0)
    times[120:128] = np.maximum(times[120:128], times[128])
    assert problems_of(write(tmp_path / "a.seq", frames_of(300), version=5, times=times)) == []


@pytest.mark.parametrize("times", [
    np.zeros(300),  # none
    times_of(300, 900.0),  # to a millisecond, where a frame takes as long
    -times_of(300, 100.0),
    np.cumsum(np.repeat([0.01, 0.03], [158, 142])),  # two rates, half of the time each
])  # fmt: skip
def test_times_that_tell_nothing_say_nothing(tmp_path, times):
    path = write(tmp_path / "a.seq", frames_of(300), times=times + 10)
    assert problems_of(path) == []


def test_a_sequence_without_times_is_read(tmp_path):
    """Where the next frame begins at once, and at the end of a file that is cut off."""
    frames = frames_of(80, height=16, width=64)  # 1024 bytes
    path = write(tmp_path / "a.seq", frames)
    data = bytearray(path.read_bytes())
    data[580:584] = (1024).to_bytes(4, "little")
    path.write_bytes(bytes(data[:1024]) + frames.tobytes())
    assert problems_of(path) == []
    np.testing.assert_array_equal(list(open_video(path)), frames)


def test_a_sequence_is_found_in_a_folder(tmp_path):
    path = write(tmp_path / "a.seq", frames_of())
    assert find_videos([tmp_path]) == [path]
