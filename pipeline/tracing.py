"""Whiskers through a whole video: found once, followed from frame to frame, identities kept.

`Tracer` holds the state; `trace` feeds it a video and hands out centrelines in chunks, so that
memory does not grow with the video's length.
"""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np
from numba import njit
from scipy.optimize import linear_sum_assignment

from pipeline import detection, following, profiles
from pipeline.detection import ImageModel, Line, TracingOptions, Workspace
from pipeline.follicle import FollicleFinder
from pipeline.fur_trust import FurTrust
from pipeline.records import Centrelines, Recording, StaticScene

CHUNK_FRAMES = 500
SHORTEST_M = 4e-3  # a line that is seen over less is no whisker, where no lengths are given
FUR_SHARE = 0.22  # of the strongest line's length × absorbance: less is a hair of the fur
GOOD_QUALITY = 0.6  # part of the expected contrast found: below, the wider search is tried
LOST_QUALITY = 0.35
NARROW_PX, WIDE_PX = 10, 30  # half-width of the search strip
BESIDE_PX = NARROW_PX + 8.0  # nearer whiskers are seen in the search strip
SHARED_PX = 8.0  # nearer ones share pixels of their cross-sections
DOUBLE_SHARE = 0.6  # part of two lines that may coincide before one of them is given up
LARGEST_TURN = np.radians(150)  # no whisker bends further from its base to its tip
SHARPEST_BASE = np.radians(35)  # turn within HOOK_M of the base: beyond, it follows the fur's edge
HOOK_M = 2.5e-3
DISORDER = 3.0  # strangeness of a base on the wrong side of another whisker's
STRANGEST = 4.0  # a found line less like the missing whisker than this is left alone
RECENT_FRAMES = 40  # a whisker lost for less than this is expected where it was
SEARCH_EVERY = 20  # frames between two full detections while a whisker is missing


@dataclass(frozen=True)
class Slot:
    """What is known beforehand of one whisker: where it leaves the face, how long it is seen."""

    name: str
    base_xy: np.ndarray
    visible_px: float
    samples: tuple = ()  # detection.Line


@dataclass
class Track:
    """One whisker's present state: its line, the line before, and how long it has been lost.

    `whole` is the line when nothing hid its tip the last time.
    """

    slot: Slot
    line: Line | None = None
    before: Line | None = None
    whole: Line | None = None
    lost_for: int = 0

    def __post_init__(self):
        self.whole = max(self.slot.samples, key=lambda line: line.n, default=None)


def options_for(recording: Recording, lengths_m=(), hidden_m=(), cone_m=()) -> TracingOptions:
    """Derive the tracer's lengths from the scale and, where known, the whiskers' own lengths.

    Parameters
    ----------
    recording : frame rate and scale
    lengths_m, hidden_m : follicle-to-tip lengths of the expected whiskers and their parts
        hidden in the fur [m]; empty where unknown
    cone_m : their follicle-to-apex lengths [m]; empty where unknown
    """
    scale = recording.pixels_per_m
    visible = [(a - b) * scale for a, b in zip(lengths_m, hidden_m, strict=True)]
    shortest = min(5e-3 * scale, 0.35 * min(visible)) if visible else SHORTEST_M * scale
    return TracingOptions(
        spacing_px=max(0.64e-3 * scale, 8.0),
        shortest_px=max(shortest, 40.0),
        base_gap_px=max(2.0e-3 * scale, 25.0),
        bridge_px=int(max(1.2e-3 * scale, 15)),
        longest_px=1.06 * max(visible) + 6 if visible else np.inf,
        hidden_px=tuple(scale * h for h in hidden_m),
        cone_px=tuple(scale * c for c in cone_m),
        pixels_per_m=scale,
    )


class Tracer:
    """Follow the whiskers of a roster through consecutive frames of one static scene."""

    def __init__(self, scene: StaticScene, roster: list[Slot], options: TracingOptions):
        self.options = options
        self.tracks = [Track(slot) for slot in roster]
        height, width = scene.background.shape
        self.workspace = Workspace(int(1.6 * np.hypot(height, width)))
        self.change_scene(scene)
        self.since_search = SEARCH_EVERY
        self.face_direction = np.array([0, 1] if scene.face_side in ("left", "right") else [1, 0])
        self.pixels = np.zeros(len(roster) * self.workspace.limit * 16, np.int64)
        self.values = np.zeros(len(self.pixels), np.float32)

    def change_scene(self, scene: StaticScene) -> None:
        """Go on before another background: something large has moved."""
        self.model = ImageModel.from_scene(scene)

    def step(self, image) -> list[Track]:
        """Advance by one frame; return the tracks, `line` None where a whisker is lost."""
        gain = profiles.frame_gain(image, self.model.background, 12, self.model.free)
        self._follow_all(image, gain)
        missing = [t for t in self.tracks if t.line is None]
        self.since_search += 1
        just_lost = any(t.lost_for in (1, 2) for t in missing)
        if missing and (just_lost or self.since_search >= SEARCH_EVERY):
            self._search(missing, image, gain)
            self.since_search = 0
        return self.tracks

    def _follow_all(self, image, gain) -> None:
        """Follow every present whisker, each against a background that holds its neighbours."""
        present = [t for t in self.tracks if t.line is not None]
        lines = {id(t): predicted(t, True) for t in present}
        beside = {id(t): self._neighbours(t, present, lines) for t in present}
        for track in present:
            with self._painted([lines[id(t)] for t in beside[id(track)]]):
                self._follow(track, image, gain)
            if track.line is not None:
                lines[id(track)] = track.line
        for track in present:
            # again beside those whose lines are known now, where their pixels are shared
            sharing = [
                lines[id(t)]
                for t in beside[id(track)]
                if track.line is not None and _come_near(track.line, lines[id(t)], SHARED_PX)
            ]
            if sharing:
                with self._painted(sharing):
                    detection.refine(
                        image, self.model, gain, track.line, self.options, self.workspace
                    )
                self._give_up_if_poor(track)
        self._drop_doubles(present)

    def _neighbours(self, track: Track, present, lines) -> list[Track]:
        """Tracks whose predicted lines come near to this one's."""
        a = lines[id(track)]
        return [t for t in present if t is not track and _come_near(a, lines[id(t)], BESIDE_PX)]

    @contextmanager
    def _painted(self, lines: list[Line]):
        """Hold other whiskers in the background for a while."""
        count = 0
        background = self.model.background
        for line in lines:
            count = profiles.paint(
                background, line.x, line.y, line.n, line.amplitude, line.sigma,
                self.pixels, self.values, count,
            )  # fmt: skip
        try:
            yield
        finally:
            profiles.unpaint(background, self.pixels, self.values, count)

    def _drop_doubles(self, present: list[Track]) -> None:
        """Of two tracks on one whisker, give up the one that fits worse."""
        for i, a in enumerate(present):
            for b in present[i + 1 :]:
                if a.line is None or b.line is None or not _come_near(a.line, b.line, 2.0):
                    continue
                if min(_near(a.line, b.line, 2.0), _near(b.line, a.line, 2.0)) > DOUBLE_SHARE:
                    worse = min(
                        (a, b), key=lambda t: t.line.quality * t.line.n / t.slot.visible_px
                    )
                    worse.line, worse.lost_for = None, 1

    def _follow(self, track: Track, image, gain) -> None:
        """Find the track's whisker near its prediction, in a wider strip where that fails."""
        present = track.line
        best = None
        for half, with_velocity in ((NARROW_PX, True), (NARROW_PX, False), (WIDE_PX, False)):
            line = predicted(track, with_velocity)
            self._carry_on(line, track)
            self._capture(line, image, gain, half)
            if best is None or line.n * line.quality > best.n * best.quality:
                best = line
            if best.quality > GOOD_QUALITY and best.n > 0.8 * present.n:
                break
        track.before, track.line, track.lost_for = present, best, 0
        self._give_up_if_poor(track)

    def _carry_on(self, line: Line, track: Track) -> None:
        """Lengthen a track's predicted line by what something hides of it, if anything does."""
        n, whole = line.n, track.whole
        if whole is not None and whole.n > n:
            line.n = following.carry_on(
                line.x, line.y, line.amplitude, n, whole.x, whole.y, whole.amplitude, whole.n,
                self.model.weight, self.options.bridge_px,
            )  # fmt: skip
        if line.n == n:
            track.whole = track.line

    def _give_up_if_poor(self, track: Track) -> None:
        """Call a whisker lost where hardly any of it was found, or it is none any more."""
        line = track.line
        if (
            line.n < 0.4 * self.options.shortest_px
            or line.quality < LOST_QUALITY
            or self._base_jump(track) > 0.5 * self.options.base_gap_px
            or turning_range(line.x, line.y, line.n) > LARGEST_TURN
            or self._hooked(line)
            or not detection.leaves_face(line, self.model.outside)
        ):
            track.line, track.lost_for = None, 1

    def _hooked(self, line: Line) -> bool:
        """Whether a line turns sharply near its base: there it is no whisker, but fur."""
        n = min(line.n, int(max(HOOK_M * self.options.pixels_per_m, 30)))
        return turning_range(line.x, line.y, n) > SHARPEST_BASE

    def _base_jump(self, track: Track) -> float:
        """How far the whisker's first point moved since the last frame [px]."""
        before = track.before
        if before is None or before.n == 0:
            return 0.0
        return float(np.hypot(track.line.x[0] - before.x[0], track.line.y[0] - before.y[0]))

    def _capture(self, line: Line, image, gain, half) -> None:
        m, w = self.model, self.workspace
        following.capture(
            image, m.background, m.weight, gain, line.x, line.y, line.n,
            line.amplitude, line.sigma, half, w.work,
        )  # fmt: skip
        line.n = following.resample(line.x, line.y, line.n, w.work[8:10])
        detection.refine(image, m, gain, line, self.options, w)

    def _search(self, missing: list[Track], image, gain) -> None:
        """Look at the whole frame for the missing whiskers."""
        found = detection.detect(image, self.model, gain, self.options, self.workspace)
        present = [t.line for t in self.tracks if t.line is not None]
        found = [c for c in found if all(detection.shared_fraction(c, p) < 0.4 for p in present)]
        cost = np.array([[self._strangeness(t, line) for line in found] for t in missing])
        for track in missing:
            track.lost_for += 1
        if not found:
            return
        pairs = zip(*linear_sum_assignment(np.minimum(cost, 1e6)), strict=True)
        pairs = [(row, column) for row, column in pairs if cost[row, column] < STRANGEST]
        lines = sorted((found[column] for _, column in pairs), key=self._along_face)
        tracks = sorted((missing[row] for row, _ in pairs), key=self._along_face)
        for track, line in zip(tracks, lines, strict=True):
            track.line, track.before, track.lost_for = line, None, 0

    def _along_face(self, item: Track | Line) -> float:
        """Where the base of a line, or that of a track's slot, is along the face [px]."""
        base = item.slot.base_xy if isinstance(item, Track) else item.points[0]
        return float(base @ self.face_direction)

    def _disorder(self, track: Track, line: Line) -> float:
        """Cost of the present whiskers whose bases a line of this track would pass.

        Whiskers cross, but not at their bases.
        """
        place, own = self._along_face(line), self._along_face(track)
        cost = 0.0
        for other in self.tracks:
            if other.line is not None:
                apart = (place - self._along_face(other.line)) * np.sign(
                    own - self._along_face(other)
                )
                cost += DISORDER * (apart < -0.1 * self.options.base_gap_px)
        return cost

    def _strangeness(self, track: Track, line: Line) -> float:
        """How badly a found line fits a missing whisker: base, length, order, recent shape."""
        unit = self.options.base_gap_px  # 2 mm
        last = track.before if track.lost_for < RECENT_FRAMES else None
        base = track.slot.base_xy if last is None else last.points[0]
        off_base = np.hypot(*(line.points[0] - base)) / unit
        if off_base > 1.5 or turning_range(line.x, line.y, line.n) > LARGEST_TURN:
            return np.inf
        cost = 3 * off_base + abs(1 - line.n / track.slot.visible_px)
        cost += self._disorder(track, line)
        if last is not None:
            n = min(line.n, last.n)
            apart = np.hypot(line.x[:n] - last.x[:n], line.y[:n] - last.y[:n])
            cost += np.median(apart) / unit
        return cost


def _come_near(a: Line, b: Line, near_px: float) -> bool:
    """Whether two lines may come within `near_px` of each other."""
    return profiles.come_near(a.x, a.y, a.n, b.x, b.y, b.n, near_px)


def _near(a: Line, b: Line, near_px: float) -> float:
    """Fraction of line `a` within `near_px` of line `b`."""
    return profiles.closeness(a.x, a.y, a.n, b.x, b.y, b.n, near_px, 4)


@njit(cache=True)
def turning_range(x, y, n):
    """Largest less smallest direction along a line, over chords of 10 nodes [rad]."""
    low = 0.0
    high = 0.0
    total = 0.0
    for i in range(10, n - 10, 5):
        ax = x[i] - x[i - 10]
        ay = y[i] - y[i - 10]
        bx = x[i + 5] - x[i - 5]
        by = y[i + 5] - y[i - 5]
        total += np.arctan2(ax * by - ay * bx, ax * bx + ay * by)
        low = min(low, total)
        high = max(high, total)
    return high - low


def predicted(track: Track, with_velocity: bool) -> Line:
    """Return the line where it should be now: a copy, moved on by the last frame's motion."""
    line = track.line.copy()
    before = track.before
    if with_velocity and before is not None and before.n > 20:
        advance(line.x, line.y, line.n, before.x, before.y, before.n)
    return line


@njit(cache=True)
def advance(x, y, n, before_x, before_y, m):
    """Add the motion since the frame before to the nodes, smoothed over ±20 nodes, in place."""
    half = 20
    count = min(n, m)
    sx = np.empty(count + 1)
    sy = np.empty(count + 1)
    sx[0] = 0.0
    sy[0] = 0.0
    for i in range(count):
        sx[i + 1] = sx[i] + x[i] - before_x[i]
        sy[i + 1] = sy[i] + y[i] - before_y[i]
    for i in range(n):
        k = min(i, count - 1)
        reach = min(half, k, count - 1 - k)
        width = 2 * reach + 1
        dx = (sx[k + reach + 1] - sx[k - reach]) / width
        dy = (sy[k + reach + 1] - sy[k - reach]) / width
        x[i] += dx
        y[i] += dy


def find_roster(frames, scene, options: TracingOptions, names=None, indices=None) -> list[Slot]:
    """Learn from some frames which whiskers there are, in order along the face.

    Parameters
    ----------
    frames : uint8 (k, height, width), taken from the whole video
    scene : StaticScene, or the video's epochs, which need `indices`
    names : names of the whiskers, anterior → posterior; None: as many as are mostly seen,
        called w1, w2, …
    indices : frame numbers of `frames`; None: whichever, the scene is always the same

    Returns
    -------
    One slot per whisker, in the order of `names`. Fewer than `names` where some are never seen.
    """
    found = []
    for present, chosen in _by_scene(frames, scene, indices):
        model = ImageModel.from_scene(present)
        workspace = Workspace(int(1.6 * np.hypot(*present.background.shape)))
        for image in chosen:
            gain = profiles.frame_gain(image, model.background, 12, model.free)
            lines = detection.detect(image, model, gain, options, workspace)
            found.append(lines if names else without_fur(lines))
        scene_side = present.face_side
    counts = np.array([len(lines) for lines in found])
    if not counts.any():
        return []
    n = len(names) if names else int(np.median(counts[counts > 0]))
    n = min(n, counts.max())
    axis = 1 if scene_side in ("left", "right") else 0
    complete = [
        sorted(lines[:n], key=lambda line: line.points[0][axis])
        for lines in found
        if len(lines) >= n
    ]
    bases = np.median([[line.points[0] for line in lines] for lines in complete], axis=0)
    lengths = np.median([[line.n for line in lines] for lines in complete], axis=0)
    slots = [
        Slot("", base, float(length), tuple(lines[k] for lines in complete))
        for k, (base, length) in enumerate(zip(bases, lengths, strict=True))
    ]
    if _posterior_first(slots):
        slots = slots[::-1]
    names = names or [f"w{i + 1}" for i in range(n)]
    return [replace(slot, name=name) for name, slot in zip(names, slots, strict=False)]


def without_fur(lines: list[Line]) -> list[Line]:
    """Drop lines that are faint and short beside the strongest: long hairs of the fur."""
    strength = [detection.contrast_length(line) for line in lines]
    return [
        line
        for line, each in zip(lines, strength, strict=True)
        if each >= FUR_SHARE * max(strength)
    ]


def _by_scene(frames, scene, indices):
    """Pairs of a scene and the frames that belong to it, transitions left out."""
    if isinstance(scene, StaticScene):
        return [(scene, frames)]
    if indices is None:
        raise ValueError("indices of the frames are needed where the scene changes, got None")
    starts = [epoch.start for epoch in scene]
    owner = np.searchsorted(starts, indices, side="right") - 1
    pairs = [(e.scene, frames[owner == k]) for k, e in enumerate(scene) if e.scene is not None]
    return [(s, f) for s, f in pairs if len(f)]


def _posterior_first(slots: list[Slot]) -> bool:
    """Whether the order along the face runs posterior → anterior: whiskers get thinner anteriorly.

    Thickness tells better than length, which the picture's border may cut.
    """
    if len(slots) < 2:
        return False
    thickness = [
        np.median([np.nanmedian(line.thickness[10 : line.n // 3]) for line in slot.samples])
        for slot in slots
    ]
    slope = np.polyfit(np.arange(len(slots)), thickness, 1)[0]
    if abs(slope) > 0.02 * np.mean(thickness):
        return slope < 0
    return np.polyfit(np.arange(len(slots)), [s.visible_px for s in slots], 1)[0] < 0


class _Collector:
    """Gathers rows until they are handed out as one `Centrelines`."""

    def __init__(self, names: tuple[str, ...]):
        self.names = names
        self.rows = []  # frame, whisker, confidence, number of points
        self.points = np.empty((5, 1 << 16), np.float32)  # x, y, offset, information, thickness
        self.filled = 0

    def add(self, frame: int, whisker: int, line: Line, trust: float) -> None:
        while self.filled + line.n > self.points.shape[1]:
            self.points = np.concatenate([self.points, np.empty_like(self.points)], axis=1)
        _store(
            line.x, line.y, line.score, line.information, line.thickness, line.n,
            self.points, self.filled,
        )  # fmt: skip
        self.filled += line.n
        self.rows.append((frame, whisker, trust * line.quality, line.n))

    def take(self, spacing: float) -> Centrelines:
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


def trace(
    frames: Iterable[np.ndarray],
    scene,
    roster: list[Slot],
    options: TracingOptions,
    chunk_frames: int = CHUNK_FRAMES,
) -> Iterator[Centrelines]:
    """Trace the roster's whiskers through the frames; yield centrelines chunk by chunk.

    Parameters
    ----------
    frames : uint8 (height, width) images in order
    scene : StaticScene, or the video's epochs (`scene_finding.find_scenes`) where large things
        move in and out; while they move, what is seen counts half
    roster : the whiskers to follow (`find_roster`)
    options : lengths in pixels (`options_for`)

    Yields
    ------
    Centrelines of up to `chunk_frames` frames; a whisker that is lost in a frame has no row.
    """
    scenes = _starting_scenes(scene)
    tracer = Tracer(scenes[0][0], roster, options)
    collector = _Collector(tuple(slot.name for slot in roster))
    place = _follicle_finder(roster, options)
    trust = 1.0
    index = -1
    for index, image in enumerate(frames):
        if index in scenes:
            present, trust = scenes[index]
            if index:
                tracer.change_scene(present)
        for k, track in enumerate(tracer.step(image)):
            if track.line is not None:
                collector.add(index, k, track.line, trust)
        if (index + 1) % chunk_frames == 0:
            yield place(collector.take(options.spacing_px))
    if collector.rows or index < 0:
        yield place(collector.take(options.spacing_px))


def _follicle_finder(roster: list[Slot], options: TracingOptions):
    """Return a function that adds the hidden length to every row of centrelines.

    It also tells how much less is known where fur clings (`fur_trust`).
    """
    if len(options.hidden_px) != len(roster) or not all(slot.samples for slot in roster):
        return lambda lines: lines
    samples = _Collector(tuple(slot.name for slot in roster))
    for k, slot in enumerate(roster):
        for line in slot.samples:
            samples.add(0, k, line, 1.0)
    samples = samples.take(options.spacing_px)
    trust = FurTrust(samples, options.pixels_per_m)
    finder = FollicleFinder(
        trust.weigh(samples),
        options.hidden_px,
        options.pixels_per_m,
        options.cone_px or None,
    )

    def place(lines):
        lines = trust.weigh(lines)
        return replace(lines, hidden_px=finder.hidden(lines))

    return place


def _starting_scenes(scene) -> dict[int, tuple[StaticScene, float]]:
    """First frame → scene from there on and the trust in what is seen before it."""
    if isinstance(scene, StaticScene):
        return {0: (scene, 1.0)}
    known = [epoch.scene for epoch in scene]
    out = {}
    for i, epoch in enumerate(scene):
        if epoch.scene is not None:
            out[epoch.start] = (epoch.scene, 1.0)
        else:
            beside = [s for s in (*known[i - 1 : i], *known[i + 1 : i + 2]) if s is not None]
            out[epoch.start] = (between(beside), 0.5)
    return out


def between(scenes: list[StaticScene]) -> StaticScene:
    """Return a scene for the time in which one goes over into the other: masked by both."""
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
