"""A video's negative: bright whiskers on a dark ground become dark on a light one."""

from collections.abc import Iterator

import numpy as np

from pipeline.video.base import Video


class Negative:
    """The negative of a `Video`, to be used in its place; its frames are in memory of their own.

    Parameters
    ----------
    video : the video as it is
    """

    def __init__(self, video: Video):
        self._video = video

    def __getattr__(self, name):
        return getattr(self._video, name)

    def __iter__(self) -> Iterator[np.ndarray]:
        return self.frames()

    def frames(self, start: int = 0, stop: int | None = None) -> Iterator[np.ndarray]:
        """Yield the frames [start, stop), as `Video.frames` does."""
        return map(np.invert, self._video.frames(start, stop))

    def lent(self) -> Iterator[np.ndarray]:
        """Yield all frames."""
        return map(np.invert, self._video.lent())

    def watched(self) -> Iterator[np.ndarray]:
        """Yield all frames, and note what is wrong with single ones, as they were recorded."""
        return map(np.invert, self._video.watched())

    def some(self, numbers) -> Iterator[tuple[int, np.ndarray]]:
        """Yield (number, frame), as `Video.some` does."""
        return ((number, np.invert(frame)) for number, frame in self._video.some(numbers))

    def sample(self, n: int = 48) -> tuple[np.ndarray, np.ndarray]:
        """Return about `n` frames spread over the video, as `Video.sample` does."""
        indices, frames = self._video.sample(n)
        return indices, np.invert(frames)

    def sampled(self, n: int = 48) -> Iterator[tuple[int, np.ndarray]]:
        """Yield (index, frame) of a sample one by one, as `Video.sampled` does."""
        return ((index, np.invert(frame)) for index, frame in self._video.sampled(n))
