"""What all kinds of video share: grey frames in order, and samples of them."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from pipeline.errors import VideoError, counted
from pipeline.video.frame_faults import FrameFaults

BIT_DEPTHS = (8, 10, 12, 14, 16)
MOST_PIXELS = 2**25  # of a frame: more than any high-speed camera has; they take some 2 GB


class Video:
    """Grey frames of one input, streamed; several passes may run at once.

    Attributes
    ----------
    path : Path
    width, height : int [px]
    n_frames : int or None
        What the container states, or an estimate; only reading all frames is certain.
    exact_count : bool
        `n_frames` is the container's own count, not an estimate from duration and rate.
    interpolated : set of int
        Those of the frames read until now that the codec made out of frames before and after.
    faults : FrameFaults
        What is wrong with single frames, as far as they have been `watched`.
    unreadable : set of int
        Those of the frames read until now that cannot be read, while later ones can: they are
        black. `some` and `sampled` leave them out.
    ended_by : VideoError or None
        Why no more frames could be read when they were last `watched`.
    shifts : list of (x, y) [px], or None
        Of a shaking camera's frames (`Steadied`), as far as they have been `watched`.
    """

    shifts = None

    def __init__(self, path, width: int, height: int, n_frames: int | None, exact_count=True):
        self.path = Path(path)
        check_pixels(path, width, height)
        self.width, self.height = int(width), int(height)
        self.n_frames = n_frames
        self.exact_count = exact_count and n_frames is not None
        self.interpolated, self.unreadable = set(), set()
        self.faults, self.ended_by = FrameFaults(), None
        self.notes = ()  # sentences on the input as a whole

    @property
    def shape(self) -> tuple[int, int]:
        """(height, width) of every frame."""
        return self.height, self.width

    def __iter__(self) -> Iterator[np.ndarray]:
        return self.frames()

    def __enter__(self):
        return self

    def __exit__(self, *exception):
        self.close()

    def __repr__(self):
        frames = counted(self.n_frames, "frame")
        return f"<Video {self.path.name}: {frames} of {self.width}×{self.height}>"

    def close(self):
        """Close open files."""

    def frames(self, start: int = 0, stop: int | None = None) -> Iterator[np.ndarray]:
        """Yield the frames [start, stop), uint8 (height, width), each in memory of its own.

        Raises
        ------
        VideoError
            At the frame from which on none can be read, or that has another size.
        """
        if start < 0 or (stop is not None and stop < start):
            raise ValueError(f"start, stop must be 0 <= start <= stop, got {start!r}, {stop!r}")
        return self._read(start, stop)

    def lent(self) -> Iterator[np.ndarray]:
        """Yield all frames as `frames` does, but read-only: faster for some codecs.

        They may lie in the decoder's memory, and other frames may refer to them.
        """
        return self.frames()

    def watched(self) -> Iterator[np.ndarray]:
        """Yield all frames that can be read, as `lent` does; note what is wrong with them.

        Raises
        ------
        VideoError
            Where no frame can be read.
        """
        self.faults, self.ended_by = FrameFaults(), None
        try:
            for image in self.lent():
                self.faults.see(image)
                yield image
        except VideoError as error:
            if not error.frame:
                raise
            self.ended_by = error

    def problems(self) -> Iterator[str]:
        """Yield sentences on what is wrong with the input, after a `watched` pass."""
        if self.ended_by is not None:
            read = counted(self.faults.count, "frame")
            yield f"{self.ended_by.problem}; until then, results are of {read} only"
        yield from self.notes
        yield from self.faults.sentences()

    def some(self, numbers) -> Iterator[tuple[int, np.ndarray]]:
        """Yield (number, frame) in ascending order, for those of `numbers` that can be read."""
        for number in sorted(set(numbers)):
            try:
                image = next(self.frames(number, number + 1), None)
            except VideoError:
                continue
            if image is not None and number not in self.unreadable:
                yield number, image

    def _without(self, index: int) -> np.ndarray:
        """A black frame in the place of one that cannot be read; note that it is damaged."""
        self.unreadable.add(index)
        self.faults.damaged.add(index)
        return np.zeros(self.shape, np.uint8)

    def starts(self, numbers) -> list[int]:
        """For each of the frames `numbers`, the one from which on it must be decoded."""
        return [0 for _ in numbers]

    def sample(self, n: int = 48) -> tuple[np.ndarray, np.ndarray]:
        """Return about `n` frames spread over the video, at a small part of a full pass's cost.

        Returns
        -------
        indices : int64 (k,), ascending; they may be off by a few where frame times are uneven
        frames : uint8 (k, height, width), k between 1 and about n

        Raises
        ------
        VideoError
            If not even one frame can be read.
        """
        indices, frames = zip(*self.sampled(n), strict=True)
        return np.array(indices, np.int64), np.stack(frames)

    def sampled(self, n: int = 48) -> Iterator[tuple[int, np.ndarray]]:
        """Yield (index, frame) of a sample one by one, as `sample` does."""
        if n < 1:
            raise ValueError(f"n must be at least 1, got {n!r}")
        last = -1
        for index, frame in self._sampled(n):
            if index > last:
                yield index, frame
                last = index
        if last < 0:
            raise self.no_frames()

    def _read(self, start, stop):
        raise NotImplementedError

    def _sampled(self, n):
        """Read everything; keep every k-th frame, k doubling as frames come, at most n at once."""
        stride = max(1, -(-self.n_frames // n)) if self.n_frames else 1
        kept = []
        try:
            for i, frame in enumerate(self.frames()):
                if i % stride or i in self.unreadable:
                    continue
                kept.append((i, frame))
                if len(kept) > n:
                    kept, stride = kept[::2], 2 * stride
        except VideoError:
            if not kept:
                raise
        yield from kept

    def no_frames(self) -> VideoError:
        """Return the error for an input without a single frame."""
        return VideoError(
            self.path, "holds no frames: expected at least one; record or export it again", 0
        )

    def check_size(self, frame: np.ndarray, index: int) -> None:
        """Raise a VideoError if `frame` is not of the size of the first frame."""
        if frame.shape[:2] != self.shape:
            height, width = frame.shape[:2]
            raise VideoError(
                self.path,
                f"frame {index} is {width}×{height} px, the frames before it are "
                f"{self.width}×{self.height}: expected one size throughout; split the input "
                f"at that frame",
                index,
            )


def check_pixels(path, width, height) -> None:
    """Raise a VideoError where frames of this size would take all memory."""
    if not 0 < width * height <= MOST_PIXELS:
        raise VideoError(
            path,
            f"has frames of {width}×{height} px: expected at most {MOST_PIXELS / 1e6:.0f} "
            "megapixels; it is damaged, or must be cut or made smaller",
            0,
        )


class RandomAccessVideo(Video):
    """A video whose frames can be read in any order at no extra cost: `_load(i)`."""

    def _load(self, index: int) -> np.ndarray:
        raise NotImplementedError

    def starts(self, numbers):
        """The frames themselves: nothing else needs to be read."""
        return list(numbers)

    def _read(self, start, stop):
        stop = self.n_frames if stop is None else min(stop, self.n_frames)
        for i in range(start, stop):
            yield self._load(i)

    def _sampled(self, n):
        wrong, any_good = None, False
        for i in np.unique(np.linspace(0, self.n_frames - 1, n).round().astype(int)):
            try:
                frame = self._load(i)
            except VideoError as error:
                wrong = error
            else:
                any_good = True
                yield int(i), frame
        if wrong is not None and not any_good:
            raise wrong


def bits_to_drop(largest: int) -> int:
    """Return how many low bits to drop so that pixels up to `largest` fit into 8 bits.

    Cameras store 10, 12 or 14 bits in 16: the least of the usual depths that holds `largest`.

    >>> bits_to_drop(255), bits_to_drop(4000), bits_to_drop(65535)
    (0, 4, 8)
    """
    return next(depth for depth in BIT_DEPTHS if largest < 1 << depth) - 8


def to_8_bit(image: np.ndarray, drop: int) -> np.ndarray:
    """Return a uint8 copy of a uint8 or uint16 `image` without its `drop` low bits, clipped."""
    if image.dtype == np.uint8:
        return np.array(image, order="C")
    return np.minimum(image >> drop, 255).astype(np.uint8)
