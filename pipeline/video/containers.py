"""Video files, read through PyAV (FFmpeg)."""

import contextlib
import errno
from functools import cached_property
from itertools import groupby, islice, repeat

import av
import numpy as np
from av.codec.codec import Capabilities
from av.codec.context import ThreadType
from av.video.frame import PictureType

from pipeline.errors import VideoError, counted
from pipeline.video.base import Video, bits_to_drop, check_pixels
from pipeline.video.decoder_log import ENDED_EARLY, decoder_log
from pipeline.video.endings import is_cut
from pipeline.video.header import frame_count, frame_duration, last_pts, uneven_times
from pipeline.video.luma import LumaReader

NOT_VIDEO_CODECS = ("ansi", "xbin", "bintext", "idf")
BURST_STEP = 3  # in long bursts, every third frame: whiskers must have moved in between
LONGEST_BURST = 3  # samples; more of them would show the same posture again
FEWEST_SAMPLES = 24  # but a background takes so many
FRAMES_AHEAD = 16  # lent at once: taking turns, decoder and caller spoil each other's cache
FEWEST_KEYS = 4  # fewer key frames may miss when things move
TIED_CODECS = ("ffv1",)  # a frame is decoded with what the decoder learnt from the one before
HEADER_MEMORY = 2**26  # bytes: more than a sound header needs at once
HELD_BACK = 16  # frames: as many come out of a decoder at most between a packet and its own frame


class ContainerVideo(Video):
    """A video file read through PyAV (FFmpeg)."""

    def __init__(self, path, threads: int = 1):
        self._threads = threads
        self._luma = LumaReader()
        with decoder_log() as log, self._open(path) as container:
            stream = container.streams.video[0]
            if stream.codec_context.width:  # a raw stream does not say before it is decoded
                check_pixels(path, stream.codec_context.width, stream.codec_context.height)
            log.new()  # what was said of the container
            first, failure = next(_decoded(container, stream), (None, None))
            broken = failure is not None or bool(log.new())
            if first is None:
                raise VideoError(path, _no_frames_message(container), 0)
            self._step = frame_duration(stream)
            # AVI times frames in the order in which they are decoded
            self._in_order = (
                container.format.name != "avi" or not stream.codec_context.has_b_frames
            )
            starts_earlier = broken and self._in_order and stream.start_time is not None
            self._first_pts = stream.start_time if starts_earlier else first.pts
            self._last_pts = last_pts(container, stream, self._step)
            count, exact = frame_count(container, stream)
            self._format, self._indexed = container.format.name, stream.frames > 0
            super().__init__(path, first.width, first.height, count, exact)
        if self._luma.largest(first) is not None:
            some = [first, *(frame for _, frame in self._some_frames(16))]
            self._luma.drop = bits_to_drop(max(map(self._luma.largest, some)))

    @contextlib.contextmanager
    def _open(self, path):
        with _opened(path) as container:
            if not container.streams.video:
                raise VideoError(path, "holds no video stream: expected one; name a video file")
            stream = container.streams.video[0]
            if stream.codec_context is None:
                raise VideoError(path, "has an unknown codec; export it as AVI or MP4")
            if stream.codec_context.name in NOT_VIDEO_CODECS:
                raise VideoError(path, "is a text file, not a video; name a video file")
            stream.thread_type = self._thread_type(stream.codec_context.name)
            stream.codec_context.thread_count = self._threads
            try:
                yield container
            finally:
                # A decoding thread that has something to log waits for the interpreter, and who
                # frees the decoder holds it while waiting for the thread: neither would go on.
                stream.codec_context.flush_buffers()

    def _thread_type(self, codec):
        """What the decoder's threads share: parts of a frame, or frames too where that is safe.

        Behind a broken frame, FFmpeg's threads do not wait for each other: of a codec whose frames
        are tied, the next good one would spoil those that are still being decoded before it.
        """
        if self._threads == 1:
            return "NONE"
        return "SLICE" if codec in TIED_CODECS else "AUTO"

    # ---- all frames -----------------------------------------------------------------------

    def lent(self):
        """Yield all frames, in the decoder's memory where their rows are stored without gaps."""
        return self._read(0, None, lend=True)

    def _read(self, start, stop, lend=False):
        with decoder_log() as log, self._open(self.path) as container:
            stream = container.streams.video[0]
            index, pts, self._ended_early = start, None, False
            try:
                frames = _with_log(self._filled(container, stream, start), log)
                for frame, logged in _ahead(frames, FRAMES_AHEAD) if lend else frames:
                    if stop is not None and index >= stop:
                        return
                    if frame is None:
                        yield self._without(index)
                    else:
                        self._note(frame, index, pts)
                        self._note_faults(logged, index + _in_work(stream.codec_context))
                        yield self._luma(frame, lend)
                    index, pts = index + 1, frame and frame.pts
            except av.FFmpegError as error:
                if not (self.exact_count and index >= self.n_frames):
                    check_memory(error)
                    raise self._broken(index, error) from error
            self._note_faults(log.new(), index - 1)
        if stop is None or index < stop:
            self._check_end(index, pts)

    def _note(self, frame, index, before):
        """Keep in mind what is peculiar about a frame; VideoError where it is of another size."""
        if (frame.height, frame.width) != self.shape:
            self.check_size(np.empty((frame.height, frame.width)), index)
        if frame.pict_type == PictureType.B:
            self.interpolated.add(index)
        if frame.is_corrupt:
            self.faults.damaged.add(index)
        if self._timed and before is not None and frame.pts is not None:
            missing = round((frame.pts - before) / float(self._step)) - 1
            if missing > 0:
                self.faults.gaps.append((index, missing))

    def _note_faults(self, logged, index):
        """Take what the decoder logged for a fault of this frame."""
        for text in logged:
            if ENDED_EARLY in text:
                self._ended_early = True
            elif index >= 0:
                self.faults.damaged.add(index)
                self.faults.said = self.faults.said or text

    @property
    def _timed(self) -> bool:
        """Whether the frames' times are known."""
        return self._step is not None and self._first_pts is not None

    def _filled(self, container, stream, start):
        """Decode from frame `start` on; None for each frame that cannot be decoded.

        How many these are, the times of the frames around them say. Raises the decoder's error
        where they do not, or where no frame follows.
        """
        before = self._pts(start - 1) if self._timed else None
        watched = 0 if start else 1  # frames before which others may have been lost
        for frame, failure in self._decode_from(container, stream, start):
            watched = HELD_BACK if failure is not None else watched - 1
            lost = self._lost(before, frame.pts) if watched >= 0 else 0
            if lost is None and failure is not None:
                raise failure
            if lost is not None and lost < 0:
                continue  # shown out of order: its place is taken
            yield from repeat(None, lost or 0)
            yield frame
            before = frame.pts

    def _lost(self, before, pts) -> int | None:
        """How many frames are missing between two times; None where these do not tell."""
        if not (self._timed and self._in_order) or None in (before, pts):
            return None
        lost = self._index_at(pts) - self._index_at(before) - 1
        return lost if lost <= (self.n_frames or 0) else None

    def _decode_from(self, container, stream, start):
        """Decode from frame `start` on, by seeking where times are known, as of `_decoded`."""
        first = self._just_before(start) if start and self._timed else None
        if first is not None:
            container.seek(self._pts(start), stream=stream)
        for i, (frame, failure) in enumerate(_decoded(container, stream, first)):
            if i >= start if first is None else frame.pts is None or frame.pts > first:
                yield frame, failure

    def _check_end(self, index, pts):
        """Raise if the file ended long before the count or duration that its header gives."""
        missing = None
        if self.exact_count and index < self.n_frames - max(1, self.n_frames // 200):
            missing = None if self._reaches_end(pts) else f"{self.n_frames} frames"
        elif not self.exact_count and pts is not None and self._last_pts is not None:
            expected = self._last_pts - self._first_pts
            if pts - self._first_pts < 0.9 * expected - 3 * self._step:
                missing = f"about {self.n_frames} frames"
        if missing:
            raise self._cut(index, f"its header says {missing}")
        if self._ended_early or is_cut(self.path, self._format):
            about = f" (of about {self.n_frames})" if (self.n_frames or 0) > index else ""
            raise self._cut(index, f"then it ends within the data{about}")
        if self.faults.damaged and max(self.faults.damaged) >= index - 1 and not self._indexed:
            raise self._cut(index, "the last one is damaged")

    def _reaches_end(self, pts) -> bool:
        """The last frame is shown at the end that the header gives: those missing were dropped."""
        if not self._timed or pts is None:
            return False
        return pts - self._first_pts >= (self.n_frames - 1.5) * self._step

    def _cut(self, index, why):
        return VideoError(
            self.path,
            f"gives {counted(index, 'frame')}, {why}: the file is cut off or damaged; copy it "
            "again from the recording computer",
            index,
        )

    def _broken(self, index, error):
        return VideoError(
            self.path,
            f"frame {index} cannot be decoded ({reason_of(error)}): the file is cut off or "
            "damaged; copy it again from the recording computer",
            index,
        )

    # ---- a few frames ---------------------------------------------------------------------

    def some(self, numbers):
        """Yield (number, frame) in ascending order, for those of `numbers` that can be read."""
        left = sorted(set(numbers))
        if self._timed:
            try:
                for number, frame in self._some_by_key_frame(left):
                    yield number, self._luma(frame)
                    left = [n for n in left if n > number]
            except av.FFmpegError:
                pass  # those behind the damage are tried one by one
        yield from super().some(left)

    def starts(self, numbers):
        """The key frames before them; the first frame where these are not known."""
        if not self._timed:
            return super().starts(numbers)
        with self._open(self.path) as container:
            stream = container.streams.video[0]
            times = [self._key_frame_before(container, stream, n) for n in numbers]
        return [0 if time is None else self._index_at(time) for time in times]

    def _some_by_key_frame(self, numbers):
        """Yield (number, frame); those behind the same key frame are decoded in one go."""
        with self._open(self.path) as container:
            stream = container.streams.video[0]
            keys = [self._key_frame_before(container, stream, n) for n in numbers]
            for _, group in groupby(zip(keys, numbers, strict=True), key=lambda pair: pair[0]):
                yield from self._decode_these(container, stream, [n for _, n in group])

    def _decode_these(self, container, stream, numbers):
        """Yield (number, frame) for ascending numbers behind one key frame."""
        container.seek(self._pts(numbers[0]), stream=stream)
        left = numbers
        for packet in container.demux(stream):
            first = self._just_before(left[0])
            for frame in _frames_in(packet, stream, first):
                index = self._index(frame)
                if index in left and (frame.height, frame.width) == self.shape:
                    yield index, frame
                left = [n for n in left if index is None or n > index]
                if not left:
                    return

    def _key_frame_before(self, container, stream, number):
        """Time of the key frame at which decoding towards a frame begins; None if unknown."""
        container.seek(self._pts(number), stream=stream)
        packet = next(container.demux(stream), None)
        return packet.pts if packet is not None and packet.is_keyframe else None

    def _sampled(self, n):
        found = False
        try:
            for index, frame in self._some_frames(n):
                found = True
                yield index, self._luma(frame)
        except av.FFmpegError:
            pass  # damaged: what came before is a sample too
        if not found:
            yield from super()._sampled(n)

    def _some_frames(self, n):
        """Yield (index, frame): key frames, in bursts where they are few; else reference frames.

        Nothing where the frames' times are not known.
        """
        if not self._timed or self.n_frames is None:
            return
        if self._times is not None and not self.exact_count:
            self.n_frames = len(self._times)  # else from a rate that these frames do not have
        with self._open(self.path) as container:
            stream = container.streams.video[0]
            keys = self._key_frames(container, stream, n) if self.n_frames > 2 * n else []
            if len(keys) >= FEWEST_KEYS:
                enough = max(-(-FEWEST_SAMPLES // len(keys)), LONGEST_BURST)
                offsets = _burst_offsets(min(-(-n // len(keys)), enough))
                for key in keys:
                    yield from self._burst(container, stream, key, offsets)
                return
        with self._open(self.path) as container:
            yield from self._strided(container, container.streams.video[0], n)

    def _strided(self, container, stream, n):
        """Yield about n frames at equal distances; decodes only those that others refer to."""
        stream.codec_context.skip_frame = "NONREF"
        targets = iter(np.linspace(0, self.n_frames - 1, n))
        target = next(targets)
        for frame, _ in _decoded(container, stream):
            index = self._index(frame)
            if index is None or index < target or (frame.height, frame.width) != self.shape:
                continue
            yield index, frame
            target = next((t for t in targets if t > index), None)
            if target is None:
                return

    def _key_frames(self, container, stream, n):
        """Return the times of up to `n` distinct key frames, found without decoding."""
        keys = set()
        for i in np.linspace(0, self.n_frames - 1, n):
            keys.add(self._key_frame_before(container, stream, i))
        return sorted(keys - {None})

    def _burst(self, container, stream, key, offsets):
        """Yield the frames that are so many frames behind the key frame at time `key`."""
        times = [key + round(n * self._step) for n in offsets]
        due = 0
        for last in (times[-1], np.inf):  # farther only where times are uneven
            for frame in self._decode_at(container, stream, key, times, last):
                if frame.pts is None or frame.pts < times[due] - self._step / 2:
                    continue
                if (frame.height, frame.width) == self.shape:
                    yield self._index(frame), frame
                due += 1
                if due == len(times):
                    return

    def _decode_at(self, container, stream, key, times, last):
        """Decode from time `key` to `last` the frames shown at `times` and those others refer to.

        The other ones in between, and those behind `last`, cost nothing.
        """
        container.seek(key, stream=stream)
        left = len(times)
        for packet in container.demux(stream):
            timed = packet.pts is not None
            near = timed and any(abs(packet.pts - t) < self._step / 2 for t in times)
            stream.codec_context.skip_frame = "DEFAULT" if near or not timed else "NONREF"
            with contextlib.suppress(av.FFmpegError):  # the others are a sample, too
                yield from packet.decode()
            left -= near
            if not left or (packet.dts is not None and packet.dts > last):
                yield from stream.decode(None)  # what the decoder has held back
                return

    def _index(self, frame):
        return None if frame.pts is None else self._index_at(frame.pts)

    # ---- times and numbers of frames ------------------------------------------------------

    @cached_property
    def _times(self):
        """The frames' times in order where they are uneven, as of a camera that dropped frames."""
        with self._open(self.path) as container:
            return uneven_times(container, container.streams.video[0], self._first_pts, self._step)

    def _index_at(self, pts):
        if pts <= self._first_pts or self._times is None:
            return round((pts - self._first_pts) / self._step)
        return int(np.searchsorted(self._times, pts, "right")) - 1

    def _pts(self, index):
        if index <= 0 or self._times is None or index >= len(self._times):
            return int(self._first_pts + round(index * self._step))
        return int(self._times[int(index)])

    def _just_before(self, index):
        """A time between those of a frame and the one before it."""
        margin = self._step / 2 if self._times is None else 0.5  # times are whole numbers
        return self._pts(index) - margin


def _in_work(codec) -> int:
    """How many frames behind the one that comes out the decoder has in its threads, and logs."""
    can = codec.codec.capabilities & Capabilities.frame_threads
    by_frame = can and codec.thread_type & ThreadType.FRAME
    return codec.thread_count - 1 if by_frame else 0


def _with_log(frames, log):
    """Yield (frame, what the decoder logged before it came)."""
    for frame in frames:
        yield frame, log.new()


def _opened(path):
    """Open a container; VideoError where its header asks for memory that no sound one needs."""
    try:
        return av.open(str(path), metadata_errors="replace")
    except av.error.MemoryError as error:
        if not _can_get(HEADER_MEMORY):
            raise
        raise VideoError(
            path,
            "cannot be read as a video: its header asks for more memory than can be; it is "
            "damaged: copy it again from the recording computer",
        ) from error


def _can_get(size) -> bool:
    """Whether the system gives this process so many bytes of memory."""
    try:
        np.empty(size, np.uint8)
    except MemoryError:
        return False
    return True


def _ahead(frames, count):
    """Yield frames one by one, decoded `count` at a time; a failure comes after the good ones."""
    failure = None
    while failure is None:
        some = []
        try:
            some.extend(islice(frames, count))
        except av.FFmpegError as error:
            failure = error
        yield from some
        if not some and failure is None:
            return
    raise failure


def _burst_offsets(length):
    """Which frames behind a key frame make a burst of so many.

    A long one, of few key frames, is to show several postures. A short one is to show the scene
    as most frames have it, which a key frame, encoded by itself, does not: of the frames behind it
    the background becomes as good as of twice as many apart from each other, which cost more.
    """
    if length > LONGEST_BURST:
        return [BURST_STEP * i for i in range(length)]
    return list(range(1, length + 1)) if length > 1 else [0]


def _decoded(container, stream, first=None):
    """Yield (frame, the decoder's error on a packet since the last frame, or None).

    first : time before which only those frames are decoded that others refer to; None: all are
    Raises the error after the last frame, if no packet behind the broken one could be decoded.
    """
    failure = None
    for packet in container.demux(stream):
        try:
            frames = _frames_in(packet, stream, first)
        except av.FFmpegError as error:
            failure = failure or error
            continue
        for frame in frames:
            yield frame, failure
            failure = failure if packet.size == 0 else None  # at the end come those held back
    if failure is not None:
        raise failure


def _frames_in(packet, stream, first=None):
    """Decode a packet; of the frames before time `first`, only those that others refer to."""
    if first is not None:
        before = packet.pts is not None and packet.pts < first
        stream.codec_context.skip_frame = "NONREF" if before else "DEFAULT"
    return packet.decode()


def _no_frames_message(container):
    return (
        f"holds no frames (container {container.format.name}): expected at least one; it is "
        "empty or cut off, record or export it again"
    )


def check_memory(error) -> None:
    """Raise a MemoryError where FFmpeg, or a thread of it, failed because it got no memory."""
    if getattr(error, "errno", None) in (errno.ENOMEM, errno.EAGAIN):
        raise MemoryError(str(error)) from error


def reason_of(error) -> str:
    """Return what FFmpeg says of a failure."""
    return getattr(error, "strerror", None) or str(error)
