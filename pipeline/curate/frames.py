"""Frames of a video in any order, at once: decoded in blocks, ahead of the person's steps."""

import contextlib
import threading
import time
from collections import OrderedDict

import numpy as np

from pipeline.errors import VideoError
from pipeline.video.open import open_video

BLOCK = 32  # frames decoded together
CACHE_BYTES = 256_000_000
PAUSE_S = 0.3  # after a jump, before its surroundings are read: another jump may follow
LONGEST_SKIP = 12  # frames decoded and passed over rather than to seek


class FrameReader:
    """Random access to the frames of one video, from a thread of its own.

    A wanted frame's block of frames is decoded and kept, then the blocks beside it, so that the
    next steps forwards or backwards find theirs. Blocks seen longest ago are given up when the
    cache is full.
    """

    def __init__(self, path, n_frames: int, cache_bytes: int = CACHE_BYTES):
        self.path = path
        self.n_frames = n_frames
        self._cache_bytes = cache_bytes
        self._blocks = OrderedDict()  # block → {frame: image}, the last used at the end
        self._faults = {}  # block → VideoError
        self._wanted = []  # frames somebody waits for, the latest at the end
        self._centre = 0
        self._jumped = 0.0  # when
        self._callbacks = {}
        self._closed = False
        self._changed = threading.Condition()
        self._video = self._stream = None
        self._position = 0
        self._thread = threading.Thread(target=self._work, name="frames", daemon=True)
        self._thread.start()

    def close(self):
        """Stop the thread and let go of the file; who waits for a frame may ask another reader."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()
        self._thread.join()
        self._notify()
        self._forget_stream()
        if self._video is not None:
            self._video.close()

    def frame(self, index: int, timeout: float | None = None) -> np.ndarray | None:
        """Return frame `index`, uint8 (height, width); None if it takes more than `timeout` [s].

        Raises
        ------
        VideoError
            If it cannot be read.
        """
        if not 0 <= index < self.n_frames:
            raise ValueError(f"index must be in [0, {self.n_frames}), got {index!r}")
        with self._changed:
            self._move_to(index)
            self._wanted.append(index)
            self._changed.notify_all()
            try:
                self._changed.wait_for(lambda: self._settled(index), timeout)
            finally:
                self._wanted.remove(index)
            return self._look(index)

    def when_there(self, index: int, callback, who=None) -> None:
        """Call `callback()` from the reading thread as soon as frame `index` can be had.

        A later wish of the same `who` takes the place of this one.
        """
        with self._changed:
            self._move_to(index)
            if not self._settled(index):
                self._callbacks[who] = index, callback
                self._changed.notify_all()
                return
        callback()

    # ---- both threads, under the lock -----------------------------------------------------

    def _move_to(self, index):
        if abs(index - self._centre) > BLOCK:
            self._jumped = time.monotonic()
        self._centre = index

    def _settled(self, index):
        return self._closed or index in self._of(index) or index // BLOCK in self._faults

    def _of(self, index):
        return self._blocks.get(index // BLOCK, {})

    def _look(self, index):
        frames = self._of(index)
        if index in frames:
            self._blocks.move_to_end(index // BLOCK)
            return frames[index]
        if index // BLOCK in self._faults:
            raise self._faults[index // BLOCK]
        return None

    # ---- the reading thread ---------------------------------------------------------------

    def _work(self):
        while (run := self._next_run()) is not None:
            self._decode(*run)

    def _next_run(self):
        """Wait until there are frames [start, stop) to be read; None once closed."""
        with self._changed:
            while not self._closed:
                pause = self._jumped + PAUSE_S - time.monotonic()
                run = self._wished_run() or (self._near_run() if pause <= 0 else None)
                if run is not None:
                    return run
                self._changed.wait(pause if pause > 0 else None)
        return None

    def _wished_run(self):
        """[start, stop) of the one frame that was wished for last and is not there, or None."""
        wishes = [*(i for i, _ in self._callbacks.values()), *self._wanted]
        missing = (i for i in reversed(wishes) if not self._settled(i))
        return next(((i, i + 1) for i in missing), None)

    def _near_run(self):
        """Frames [start, stop) around the last wish that are not there, or None."""
        centre = self._centre // BLOCK
        for block in (centre, centre + 1, centre - 1):
            frames = range(max(block, 0) * BLOCK, min((block + 1) * BLOCK, self.n_frames))
            missing = [i for i in frames if not self._settled(i)]
            ahead = [i for i in missing if i >= self._centre] or missing
            if ahead:
                return ahead[0], self._run_end(ahead[0])
        return None

    def _run_end(self, start):
        """End of the run of frames from `start` on that are not there, within its block."""
        block = start // BLOCK
        frames = range(start, min((block + 1) * BLOCK, self.n_frames))
        return next((i for i in frames if i in self._of(i)), frames.stop)

    def _decode(self, start, stop):
        """Put frames into the cache one by one, unless others are wanted more."""
        try:
            for index, image in self._frames_from(start):
                if not self._keep(index, image) or index == stop - 1:
                    return
            raise VideoError(self.path, f"ends before frame {stop - 1}", start)
        except VideoError as error:
            self._forget_stream()
            with self._changed:
                self._faults[start // BLOCK] = error
        self._notify()

    def _frames_from(self, start):
        """Yield (index, image) from `start` on; go on reading where that is quicker."""
        if self._video is None:
            self._video = open_video(self.path, threads=0)
        if not (self._stream and 0 <= start - self._position <= LONGEST_SKIP):
            self._forget_stream()
            self._stream, self._position = self._video.frames(start), start
        for image in self._stream:
            index = self._position
            self._position += 1
            if index >= start:
                yield index, image

    def _forget_stream(self):
        if self._stream is not None:
            self._stream.close()
            self._stream = None

    def _keep(self, index, image) -> bool:
        """Store a frame; False if another block is to be decoded first."""
        block = index // BLOCK
        with self._changed:
            self._blocks.setdefault(block, {})[index] = image
            self._give_up_old(block, image.nbytes)
            wish = self._wished_run()
            going_on = not self._closed and (wish is None or wish[0] // BLOCK == block)
        self._notify()
        return going_on

    def _give_up_old(self, block, frame_bytes):
        held = sum(len(frames) for frames in self._blocks.values())
        for old in list(self._blocks):
            if held * frame_bytes <= self._cache_bytes:
                return
            if abs(old - self._centre // BLOCK) > 1 and old != block:
                held -= len(self._blocks.pop(old))

    def _notify(self):
        """Wake waiting threads, and run the callbacks of frames that are there."""
        with self._changed:
            due = [who for who, (i, _) in self._callbacks.items() if self._settled(i)]
            calls = [self._callbacks.pop(who)[1] for who in due]
            self._changed.notify_all()
        for call in calls:
            with contextlib.suppress(RuntimeError):  # the page has been closed
                call()
