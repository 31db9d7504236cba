"""A video whose frames are looked at in another way: as a negative, steadied, in other light."""

from collections.abc import Iterator

import numpy as np

from pipeline.video.base import Video


class Changed:
    """A `Video` with every frame changed, to be used in its place; the frames are new ones.

    Parameters
    ----------
    video : the video as it is
    change : makes of a frame, uint8 (height, width), another one of that size
    """

    def __init__(self, video: Video, change):
        self._video, self._change = video, change

    def __getattr__(self, name):
        return getattr(self._video, name)

    def __iter__(self) -> Iterator[np.ndarray]:
        return self.frames()

    def frames(self, start: int = 0, stop: int | None = None) -> Iterator[np.ndarray]:
        """Yield the frames [start, stop), as `Video.frames` does."""
        return map(self._change, self._video.frames(start, stop))

    def lent(self) -> Iterator[np.ndarray]:
        """Yield all frames."""
        return map(self._change, self._video.lent())

    def watched(self) -> Iterator[np.ndarray]:
        """Yield all frames, and note what is wrong with single ones, as they were recorded."""
        return map(self._change, self._video.watched())

    def some(self, numbers) -> Iterator[tuple[int, np.ndarray]]:
        """Yield (number, frame), as `Video.some` does."""
        return ((number, self._change(frame)) for number, frame in self._video.some(numbers))

    def sample(self, n: int = 48) -> tuple[np.ndarray, np.ndarray]:
        """Return about `n` frames spread over the video, as `Video.sample` does."""
        indices, frames = self._video.sample(n)
        return indices, np.stack([self._change(frame) for frame in frames])

    def sampled(self, n: int = 48) -> Iterator[tuple[int, np.ndarray]]:
        """Yield (index, frame) of a sample one by one, as `Video.sampled` does."""
        return ((index, self._change(frame)) for index, frame in self._video.sampled(n))


class Negative(Changed):
    """A video's negative: bright whiskers on a dark ground become dark on a light one."""

    def __init__(self, video: Video):
        super().__init__(video, np.invert)


class Steadied(Changed):
    """A shaking camera's video as one at rest would have recorded it.

    Parameters
    ----------
    video : the video as it is
    steady : makes of a frame another one, and the shift x, y [px] between them, by which things
        lie farther right and down in the frame as recorded

    Attributes
    ----------
    shifts : that of every frame, as far as they have been `watched`
    """

    def __init__(self, video: Video, steady):
        super().__init__(video, lambda frame: steady(frame)[0])
        self._steady, self.shifts = steady, []

    def watched(self) -> Iterator[np.ndarray]:
        """Yield all frames, and note their shifts and what is wrong with single ones."""
        self.shifts.clear()
        for frame in self._video.watched():
            steadied, shift = self._steady(frame)
            self.shifts.append(shift)
            yield steadied
