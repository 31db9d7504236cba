"""What the header of a video file says of its frames: their duration, number and last time."""

from fractions import Fraction

import av
import numpy as np

COUNTED_BY_DURATION = ("mxf", "cine")  # containers whose duration is a number of frames
TIMED_BY_FRAMES = ("cine",)  # containers whose time base is the duration of a frame
WITHOUT_TIMES = ("avi", "mxf", *TIMED_BY_FRAMES)  # containers in which all frames last as long


def frame_duration(stream):
    """Duration of a frame in units of the stream's time base, or None."""
    if stream.container.format.name in TIMED_BY_FRAMES:
        return Fraction(1)
    if not stream.average_rate or not stream.time_base:
        return None
    return Fraction(1) / (Fraction(stream.average_rate) * stream.time_base)


def last_pts(container, stream, step):
    """Time stamp of the last frame after the header's duration; None where it says nothing."""
    if step is None or stream.start_time is None:
        return None
    if stream.duration:
        return stream.start_time + stream.duration - step
    if container.duration and len(container.streams) == 1:
        seconds = Fraction(container.duration, av.time_base)
        return stream.start_time + seconds / stream.time_base - step
    return None


def uneven_times(container, stream, first, step):
    """Times of all frames from time `first` on, in order; None where they are a `step` apart.

    Reads the file once, without decoding, unless its header tells that the times are even.
    """
    if container.format.name in WITHOUT_TIMES or _is_even(stream):
        return None
    times = []
    try:
        for packet in container.demux(stream):
            if packet.size and packet.pts is None:
                return None
            if packet.size and not packet.is_discard:
                times.append(packet.pts)
    except av.FFmpegError:
        pass  # cut off or damaged: the times of what is there
    times = np.sort([time for time in times if time >= first])
    even = first + np.arange(len(times)) * float(step)
    return times if (np.abs(times - even) >= step / 2).any() else None


def _is_even(stream) -> bool:
    """Whether the frames that the header counts take as long as at the rate of the first ones."""
    if not (stream.frames and stream.average_rate and stream.base_rate):
        return False
    return abs(stream.frames * (stream.base_rate / stream.average_rate - 1)) < 0.5


def frame_count(container, stream):
    """Number of frames and whether the container itself counts them."""
    if stream.frames > 0:
        return stream.frames, True
    if container.format.name in COUNTED_BY_DURATION and frame_duration(stream):
        return max(1, round(stream.duration / frame_duration(stream))), True
    if stream.duration and stream.average_rate:
        return max(1, round(stream.duration * stream.time_base * stream.average_rate)), False
    if container.duration and stream.average_rate:
        seconds = Fraction(container.duration, av.time_base)
        return max(1, round(seconds * stream.average_rate)), False
    return None, False
