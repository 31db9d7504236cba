"""Track whiskers through a whole video: frames go in, centrelines come out in chunks.

So memory does not grow with the length of the video.
"""

import itertools
from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np
from numba import njit

from pipeline.detection.line import Line
from pipeline.detection.line_end import PLACES_PX
from pipeline.detection.static_scene import StaticScene
from pipeline.detection.tracing_options import TracingOptions
from pipeline.scene.epochs import as_epochs
from pipeline.tables.centrelines import Centrelines
from pipeline.tracking.looking_back import RecentFrames, TrackedFrame
from pipeline.tracking.registry import WhiskerTemplate
from pipeline.tracking.tracker import Tracker

CHUNK_FRAMES = 500
UNSEEN = np.full(len(PLACES_PX), np.nan, np.float32)


class _Collector:
    """Gathers rows until they are handed out as one `Centrelines`."""

    def __init__(self, names: tuple[str, ...]):
        self.names = names
        self.rows = []  # frame, whisker, confidence, number of points, its end's thickness
        self.points = np.empty((5, 1 << 16), np.float32)  # x, y, offset, information, thickness
        self.filled = 0

    def add(self, frame: int, whisker: int, line: Line, trust: float) -> None:
        """Add a line; its confidence is its quality times `trust` in its name (0–1)."""
        while self.filled + line.n > self.points.shape[1]:
            self.points = np.concatenate([self.points, np.empty_like(self.points)], axis=1)
        _store(
            line.x, line.y, line.score, line.information, line.thickness, line.n,
            self.points, self.filled,
        )  # fmt: skip
        self.filled += line.n
        end = UNSEEN if line.end is None else line.end
        self.rows.append((frame, whisker, trust * line.quality, line.n, end))

    def take(self, spacing: float) -> Centrelines:
        """Hand out all rows so far, of lines with nodes `spacing` [px] apart, and begin anew."""
        rows, self.rows = self.rows, []
        x, y, offset, information, thickness = self.points[:, : self.filled].copy()
        self.filled = 0
        return Centrelines(
            names=self.names,
            frame=np.array([r[0] for r in rows], np.int32),
            whisker=np.array([r[1] for r in rows], np.int32),
            offsets=np.concatenate([[0], np.cumsum([r[3] for r in rows])]).astype(np.int64),
            x_px=x,
            y_px=y,
            se_px=(1 / np.sqrt(np.maximum(information * 1.3 * spacing, 1e-4))).astype(np.float32),
            confidence=np.array([r[2] for r in rows], np.float32),
            offset_px=offset,
            information=information,
            thickness_px=thickness,
            end_px=np.array([r[4] for r in rows], np.float16).reshape(len(rows), len(UNSEEN)),
        )


@njit(cache=True)
def _store(x, y, score, information, thickness, n, points, start):
    """Copy a line's nodes to the columns of `points` from `start` on."""
    for i in range(n):
        k = start + i
        points[0, k] = x[i]
        points[1, k] = y[i]
        points[2, k] = min(max(score[i] / max(information[i], 1e-6), -9.0), 9.0)
        points[3, k] = information[i]
        points[4, k] = thickness[i]


def track(
    frames: Iterable[np.ndarray],
    scene,
    templates: list[WhiskerTemplate],
    options: TracingOptions,
    chunk_frames: int = CHUNK_FRAMES,
) -> Iterator[Centrelines]:
    """Follow lines through the frames; yield centrelines chunk by chunk.

    `whisker` numbers tracks, which `pipeline.identity` names when the whole video has been seen.

    Parameters
    ----------
    frames : uint8 (height, width) images in order
    scene : StaticScene, or the video's epochs (`pipeline.scene.find_scenes`) where large things
        move in and out; while they move, the confidence is halved
    templates : of the whiskers that the video shows (`find_templates`)
    options : lengths in pixels (`options_for`)

    Yields
    ------
    Centrelines of up to `chunk_frames` frames; a line that is lost in a frame has no row.
    """
    scenes = _starting_scenes(scene)
    return _followed(frames, scenes, Tracker(scenes[0][0], templates, options), chunk_frames)


def _followed(frames, scenes, tracker, chunk_frames) -> Iterator[Centrelines]:
    """Chunks of the lines, with the numbers of their tracks."""
    collector = _Collector(())
    spacing = tracker.options.spacing_px
    index = -1
    for index, seen in enumerate(_tracked(frames, scenes, tracker)):
        for number, line in seen.lines.items():
            collector.add(index, number, line, seen.trust)
        if (index + 1) % chunk_frames == 0:
            yield collector.take(spacing)
    if collector.rows or index + 1 < chunk_frames:  # also that no line was followed at all
        yield collector.take(spacing)


def _tracked(frames, scenes, tracker) -> Iterator[TrackedFrame]:
    """Every frame with its lines, handed on when tracks that begin later cannot reach it."""
    recent = RecentFrames(tracker)
    trust = 1.0
    frames = _settled_in(tracker, iter(frames))
    for index, image in enumerate(frames):
        if index in scenes:
            present, trust = scenes[index]
            if index:
                yield from recent.hand_on()
                tracker.change_scene(present)
        tracker.step(image)
        yield from recent.add(image, trust)
    yield from recent.hand_on()


def _settled_in(tracker, frames):
    """The same frames; before, the tracker has gone through the first ones, there and back."""
    first = list(itertools.islice(frames, tracker.first_frames))
    if len(first) > 1:
        tracker.settle_in(first)
    return itertools.chain(first, frames)


def sample_lines(templates: list[WhiskerTemplate], options: TracingOptions) -> Centrelines:
    """The templates' sample lines, of frames from the whole video, as centrelines (frame 0)."""
    samples = _Collector(tuple(template.name for template in templates))
    for k, template in enumerate(templates):
        for line in template.samples:
            samples.add(0, k, line, 1.0)
    return samples.take(options.spacing_px)


def _starting_scenes(scene) -> dict[int, tuple[StaticScene, float]]:
    """First frame → the scene from there on, and the factor of the confidence in it."""
    epochs, out = as_epochs(scene), {}
    known = [epoch.scene for epoch in epochs]
    for i, epoch in enumerate(epochs):
        if epoch.scene is not None:
            out[epoch.start] = (epoch.scene, 1.0)
        else:
            beside = [s for s in (*known[i - 1 : i], *known[i + 1 : i + 2]) if s is not None]
            out[epoch.start] = (between(beside), 0.5)
    return out


def between(scenes: list[StaticScene]) -> StaticScene:
    """Return a scene for the frames in which one changes into the other: masked by both."""
    first, last = scenes[0], scenes[-1]
    obstacles = first.obstacle_mask | last.obstacle_mask
    background = np.maximum(first.background, last.background)
    return replace(
        first,
        background=np.where(obstacles, 0, background),  # nothing is seen through what moves
        face_mask=first.face_mask | last.face_mask,
        obstacle_mask=obstacles,
        pole=None,
    )
