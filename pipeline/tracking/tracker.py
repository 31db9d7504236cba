"""Whiskers followed from frame to frame, identities kept: `Tracer` holds the state."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit

from pipeline.detection import detect, image_model, line_fit, settling, tails
from pipeline.detection.detect import TracingOptions
from pipeline.detection.image_model import ImageModel
from pipeline.detection.line import Line, Workspace
from pipeline.detection.static_scene import StaticScene
from pipeline.numerics import polyline
from pipeline.session.parameters import DEFAULTS
from pipeline.session.quantities import frames_in, pixels_in
from pipeline.session.recording import Recording
from pipeline.tracking import matching, row_rotation, search
from pipeline.tracking.matching import Ruler
from pipeline.tracking.registry import WhiskerTemplate

FORETOLD_PX = 1.0  # a line that is nearer to its prediction is fitted without a search
DOUBLE_SHARE = 0.6  # part of two lines that may coincide before one of them is given up
NEAR_SHIFTS = np.radians([-8, -4, 0, 4, 8])  # of all angles, where some whiskers are followed
KEPT = 0.95  # part of two lines that must still be found when they have exchanged far parts
RELIT = 0.3  # change of the light from one frame to the next: what was too dark may be seen


@dataclass
class Track:
    """One whisker's present state: its line, the line before, and how long it has been lost.

    `whole` is the line when nothing hid its tip the last time; `turn`: what it turns by beside
    its last motion [rad], and how far behind its base [px].
    """

    template: WhiskerTemplate
    line: Line | None = None
    before: Line | None = None
    whole: Line | None = None
    lost_for: int = 0
    turn: tuple[float, float] = (0.0, 0.0)
    number: int = 0
    age: int = 0

    def __post_init__(self):
        self.whole = max(self.template.samples, key=lambda line: line.n, default=None)

    def take(self, line: Line | None, before: Line | None = None, lost_for: int = 0) -> None:
        """Go on with another line, which may be as long as this whisker."""
        self.line, self.before, self.lost_for = line, before, lost_for
        if line is not None:
            line.longest = self.template.longest_px

    def lose(self) -> None:
        """Give the line up: the whisker is lost since this frame."""
        self.line, self.lost_for = None, 1


class Bends(NamedTuple):
    """How far a whisker's line may turn: in all, and in its first `hook` nodes [rad]."""

    largest: float
    hook: int
    at_hook: float


def options_for(
    recording: Recording, lengths_m=(), hidden_m=(), cone_m=(), params=DEFAULTS
) -> TracingOptions:
    """Derive the tracer's lengths from the scale and, where known, the whiskers' own lengths.

    Parameters
    ----------
    recording : frame rate and scale
    lengths_m, hidden_m : follicle-to-tip lengths of the expected whiskers and their parts
        hidden in the fur [m]; empty where unknown
    cone_m : their follicle-to-apex lengths [m]; empty where unknown
    params : `Parameters` of all rooms
    """
    scale, own = recording.pixels_per_m, params.tracking
    visible = [(a - b) * scale for a, b in zip(lengths_m, hidden_m, strict=True)]
    longest = [1.03 * length + 4 for length in visible]
    if visible:
        shortest = max(min(5e-3 * scale, 0.35 * min(visible)), 30.0)
    else:
        shortest = max(own.shortest_line_mm / 1e3 * scale, 40.0)
    return TracingOptions(
        spacing_px=max(own.knot_spacing_mm / 1e3 * scale, 8.0),
        shortest_px=shortest,
        base_gap_px=max(own.base_gap_mm / 1e3 * scale, 25.0),
        bridge_px=int(max(own.bridge_mm / 1e3 * scale, 15)),
        longest_px=max(longest, default=np.inf),
        visible_px=tuple(longest),
        hidden_px=tuple(scale * h for h in hidden_m),
        cone_px=tuple(scale * c for c in cone_m),
        pixels_per_m=scale,
        frames_per_second=recording.frames_per_second,
        params=params,
    )


class Tracer:
    """Follow the whiskers of the templates through consecutive frames of one static scene."""

    crowded = False  # whether whiskers stand so close that they pass for each other

    def __init__(
        self, scene: StaticScene, templates: list[WhiskerTemplate], options: TracingOptions
    ):
        self.options = options
        self.names = tuple(template.name for template in templates)
        self.tracks = [Track(template, number=k) for k, template in enumerate(templates)]
        height, width = scene.background.shape
        self.workspace = Workspace(int(1.6 * np.hypot(height, width)))
        self.change_scene(scene)
        self.params = options.params.tracking
        self._set_limits(options)
        self.since_search = self.search_every
        self.gain = 1.0
        self.frame = -1
        self.ruler = Ruler.of(scene.face_side, options)

    def _set_limits(self, options):
        """The room's parameters in pixels, frames and radians."""
        params, scale = self.params, options.pixels_per_m
        self.narrow = int(np.clip(1e-3 * scale * params.narrow_strip_mm, 4, 10))
        self.wide = int(np.clip(1e-3 * scale * params.wide_strip_mm, 10, 30))
        self.neighbour_px = pixels_in(params.neighbour_mm, scale)
        self.shared_px = pixels_in(params.shared_pixels_mm, scale)
        self.same_px = pixels_in(params.same_line_mm, scale)
        hook = int(max(options.px(params.hook_mm), 30))
        turns = np.radians([params.largest_turn_deg, params.hook_deg])
        self.bends = Bends(float(turns[0]), hook, float(turns[1]))
        times = params.search_every_s, params.established_s
        frames = [max(frames_in(time, options.frames_per_second), 1) for time in times]
        self.search_every, self.established = frames

    def change_scene(self, scene: StaticScene) -> None:
        """Go on before another background: something large has moved."""
        self.model = ImageModel.from_scene(scene, self.options.params.detection)

    def step(self, image) -> list[Track]:
        """Advance by one frame; return the tracks, `line` None where a whisker is lost."""
        self.frame += 1
        gain, before = self.model.gain(image), self.gain
        relit, self.gain = abs(gain - before) > RELIT * max(gain, before), gain
        with image_model.lines_in_background(self.model):
            self._follow_all(image, gain)
            missing = [t for t in self.tracks if t.line is None]
            self.since_search += 1
            just_lost = any(t.lost_for in (1, 2) for t in missing)
            if missing and (just_lost or relit or self.since_search >= self.search_every):
                self._search(missing, image, gain)
                self.since_search = 0
        return self.tracks

    def _follow_all(self, image, gain) -> None:
        """Follow every present whisker, each against a background that holds its neighbours.

        Afterwards it still holds them.
        """
        present = [t for t in self.tracks if t.line is not None]
        self._foresee(present, image, gain)
        lines = {id(t): predicted(t, True) for t in present}
        beside = _beside(present, list(lines.values()), self.neighbour_px)
        held = self.model.held
        held.hold([lines[id(t)] for t in present if beside[id(t)]])
        for track in present:
            if beside[id(track)]:
                held.take_out(lines[id(track)])
            self._follow(track, image, gain, lines[id(track)])
            lines[id(track)] = track.line or foretold(track.before, None)
            if beside[id(track)]:
                held.put_in(lines[id(track)])
        # again beside those whose lines are known now, where their pixels are shared
        sharing = _beside(present, list(lines.values()), self.shared_px)
        for track in present:
            if sharing[id(track)]:
                held.put_in(lines[id(track)])
        crossing = [
            self._refine_shared(track, lines, sharing[id(track)], image, gain) for track in present
        ]
        self._drop_doubles(present)
        if any(crossing):
            self._uncross(present, image, gain)
        if self.crowded:
            self._part_crowd(present)

    def _refine_shared(self, track: Track, lines, beside, image, gain) -> bool:
        """Fit a track's line again if it may share pixels with others; whether it may.

        lines : by the track's id, all held in the background; beside : the tracks of those others
        """
        if track.line is None or not beside:
            return False
        held = self.model.held
        held.take_out(track.line)
        detect.refine(image, self.model, gain, track.line, self.options, self.workspace)
        if not self.crowded:  # there, whiskers do lie upon each other
            self._untangle(track, [lines[id(t)] for t in beside], image, gain)
        held.put_in(track.line)
        self._give_up_if_poor(track)
        return True

    def _untangle(self, track: Track, beside: list[Line], image, gain) -> None:
        """Take a line back from another whisker's far part, onto which it went at a crossing.

        Without it, a rendered row's line stays there for up to ten frames (test_tracker).
        """
        line, known = track.line, track.before
        for other in beside:
            start = tails.shared_tail(line.x, line.y, line.n, other.x, other.y, other.n)
            if known is None or line.n - start < tails.LEAST:
                continue
            n = tails.regrow(line.x, line.y, line.n, start, known.x, known.y, known.n)
            if n > 0:
                line.n = n
                detect.refine(image, self.model, gain, line, self.options, self.workspace)
                again = tails.shared_tail(line.x, line.y, line.n, other.x, other.y, other.n)
                if line.n - again >= tails.LEAST:
                    line.n = max(again, 1)

    def _foresee(self, present: list[Track], image, gain) -> None:
        """Set what the tracks turn by, where more is known than each line's own motion."""

    def _drop_doubles(self, present: list[Track]) -> None:
        """Of two tracks on one whisker, give up the one that fits worse."""
        tracks = [t for t in present if t.line is not None]
        near = self.same_px
        for i, j in np.argwhere(np.triu(polyline.near_pairs([t.line for t in tracks], near))):
            a, b = tracks[i], tracks[j]
            if a.line is None or b.line is None:
                continue
            both = (a.line, b.line), (b.line, a.line)
            if all(_near(one, other, near) > DOUBLE_SHARE for one, other in both):
                min((a, b), key=self._claim).lose()

    def _claim(self, track: Track) -> float:
        """How rightly a track is on its line, to be compared with another one on the same."""
        return track.line.quality * track.line.n / track.template.visible_px

    def _uncross(self, present: list[Track], image, gain) -> None:
        """Let lines that have turned off onto each other go on with their own far parts.

        Rows of real whiskers need it: without it, fewer of the whiskers that a person has
        followed are found (a mouse's 24 of 26 for 25, a rat's faint ones 8 of 12 for 10).
        """
        tracks = [t for t in present if t.line is not None]
        changed = detect.uncrossed([t.line for t in tracks], self.options)
        if not changed:
            return
        self.model.held.hold([])
        with image_model.lines_in_background(self.model, [t.line for t in tracks]) as held:
            for line, _ in changed:
                detect.refine_held(
                    held, image, self.model, gain, line, self.options, self.workspace
                )
        known = {id(line): before for line, before in changed}
        pairs = [(t, known[id(t.line)]) for t in tracks if id(t.line) in known]
        if sum(t.line.n * t.line.quality - KEPT * k.n * k.quality for t, k in pairs) < 0:
            for track, line in pairs:  # less is found of them so: they had their own
                track.line = line
            return
        for track, _ in pairs:
            track.before = None  # the far part's motion is unknown
            self._give_up_if_poor(track)

    def _part_crowd(self, present: list[Track]) -> None:
        """Give up what is another whisker's blur; a line that has lasted is none."""
        params = self.options.params.detection
        tracks = [t for t in present if t.line is not None]
        near = polyline.near_pairs([t.line for t in tracks], detect.ghost_reach(params))
        for track, beside in zip(tracks, near, strict=True):
            if track.age < self.established:
                others = [tracks[k].line for k in np.flatnonzero(beside) if tracks[k].line]
                if detect.is_ghost(track.line, others, params):
                    track.lose()

    def _follow(self, track: Track, image, gain, line: Line) -> None:
        """Find the track's whisker where it is foretold, else in a strip about it, or a wider.

        `line` is the one foretold, which is used up.
        """
        present = track.line
        best = None
        tries = (0, True), (self.narrow, True), (self.narrow, False), (self.wide, False)
        for half, with_velocity in tries:
            if half and with_velocity and track.before is None:
                continue  # the next one is the same
            if half:
                line = predicted(track, with_velocity)
            self._carry_on(line, track)
            if half:
                self._capture(line, image, gain, half)
            farthest = np.inf if half else FORETOLD_PX
            detect.refine(
                image, self.model, gain, line, self.options, self.workspace, farthest,
                widths=self.crowded,
            )  # fmt: skip
            if self.crowded and line.n >= line_fit.SHORTEST:
                settling.fit_width(line, self.workspace)
            if best is None or self._worth(line, track) > self._worth(best, track):
                best = line
            if best.quality > self.params.good_quality and best.n > 0.8 * present.n:
                break
        track.before, track.line, track.lost_for = present, best, 0
        self._give_up_if_poor(track)

    def _worth(self, line: Line, track: Track) -> float:
        """How much a line that was found shows of the track's whisker."""
        return line.n * line.quality

    def _carry_on(self, line: Line, track: Track) -> None:
        """Lengthen a track's predicted line by what something hides of it, if anything does.

        Before a real rig, without it, 23 of 26 whiskers of a mouse are found, for 25.
        """
        n, whole = line.n, track.whole
        if whole is not None and whole.n > n:
            line.n = line_fit.carry_on(
                line.x, line.y, line.amplitude, n, whole.x, whole.y, whole.amplitude, whole.n,
                self.model.weight, self.options.bridge_px,
            )  # fmt: skip
        if line.n == n:
            track.whole = track.line

    def _give_up_if_poor(self, track: Track) -> None:
        """Call a whisker lost where hardly any of it was found, or it is none any more."""
        line, before, options = track.line, track.before, self.options
        if before is None or before.n == 0:
            before = line
        if (
            line.n < 0.4 * options.shortest_px
            or line.quality < self.params.lost_quality
            or not _is_like_a_whisker(
                line.x, line.y, line.n, before.x, before.y, before.n, self.model.clear,
                0.5 * options.base_gap_px, self.bends,
            )
        ):  # fmt: skip
            track.lose()

    def _capture(self, line: Line, image, gain, half) -> None:
        """Move a line onto the best path of a strip of `half` px to both sides."""
        scratch = self.workspace.scratch
        search.capture(self.model.picture(image, gain), line.nodes, line.n, half, scratch)
        line.n = polyline.resample(line.x, line.y, line.n, scratch.room)

    def _search(self, missing: list[Track], image, gain) -> None:
        """Look at the whole frame for the missing whiskers."""
        for track in missing:
            track.lost_for += 1
        present = [t for t in self.tracks if t.line is not None]
        lines = [t.line for t in present]
        found = self._unknown(lines, image, gain)
        if 0 < len(found) < len(missing):
            found += self._unknown([*lines, *found], image, gain)
        if not found:
            return
        got = matching.match(
            self.ruler.signatures(found),
            np.array([t.template.signature for t in missing]),
            self.ruler.sd,
            *self._expected_shift(present),
        )
        for line, whisker in got.pairs:
            track = missing[whisker]
            track.take(found[line])
        if len(self.tracks) > 1 and got.pairs:
            self._uncross(self.tracks, image, gain)

    def _unknown(self, known: list[Line], image, gain) -> list[Line]:
        """Lines in the whole frame beside known ones, which would cut off those they cross."""
        self.model.held.hold([])
        with image_model.lines_in_background(self.model, known):
            found = detect.detect(image, self.model, gain, self.options, self.workspace)
        found = [c for c in found if all(detect.shared_fraction(c, p) < 0.4 for p in known)]
        found = [c for c in found if not detect.is_ghost(c, known, self.options.params.detection)]
        return [c for c in found if turning_range(c.x, c.y, c.n) < self.bends.largest]

    def _expected_shift(self, present):
        """Shifts of all angles to try, and the one to try them around [rad]."""
        if not present:
            return matching.SHIFTS, 0.0
        return NEAR_SHIFTS, self._shift(present)

    def _shift(self, tracks) -> float:
        """By how much the angles of some present whiskers are off those of the templates [rad]."""
        seen = self.ruler.signatures([t.line for t in tracks])
        known = np.array([t.template.signature for t in tracks])
        return matching.common_turn(seen, known)


def _near(a: Line, b: Line, near_px: float) -> float:
    """Fraction of line `a` within `near_px` of line `b`."""
    return polyline.share_near(a.x, a.y, a.n, b.x, b.y, b.n, near_px, (4, 4))


@njit(cache=True)
def _is_like_a_whisker(x, y, n, before_x, before_y, m, clear, farthest, bends):
    """Whether a line leaves the face, is bent as whiskers are, and begins where it was before.

    farthest : that its base may have moved from the line `before`, of m nodes [px]: not along it,
        where the fur's edge decides; bends : `Bends`
    """
    return (
        min(
            _distance(x[0], y[0], before_x, before_y, m),
            _distance(before_x[0], before_y[0], x, y, n),
        )
        <= farthest
        and turning_range(x, y, n) <= bends.largest
        and not hooked(x, y, n, bends)
        and line_fit.is_clear(x, y, n, clear)
    )


@njit(cache=True)
def _distance(x, y, line_x, line_y, n):
    """Distance of a point from the nodes of a line's nearer half [px]."""
    least = np.inf
    for i in range(n // 2 + 1):
        least = min(least, np.hypot(x - line_x[i], y - line_y[i]))
    return least


@njit(cache=True)
def hooked(x, y, n, bends):
    """Whether a line turns sharply near its base: there it follows fur, not a whisker.

    Without it, twice as many lines in a mouse's face are no whiskers (0.67 a frame for 0.33).
    """
    return turning_range(x, y, min(n, bends.hook)) > bends.at_hook


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
        along, across = ax * bx + ay * by, ax * by - ay * bx
        if abs(across) < 0.2 * along:  # by the arctangent's series, to a millionth
            t = across / along
            total += t * (1 - t * t * (1 / 3 - t * t * (1 / 5 - t * t * (1 / 7))))
        else:
            total += np.arctan2(across, along)
        low = min(low, total)
        high = max(high, total)
    return high - low


def _beside(tracks: list[Track], lines: list[Line], near_px) -> dict[int, list[Track]]:
    """By a track's id, the tracks whose lines come near to its own."""
    near = polyline.near_pairs(lines, near_px)
    return {
        id(track): [tracks[k] for k in np.flatnonzero(row)]
        for track, row in zip(tracks, near, strict=True)
    }


def predicted(track: Track, with_velocity: bool) -> Line:
    """Return the line where it should be now: a copy, moved on by the last frame's motion."""
    line = foretold(track.line, track.before if with_velocity else None)
    if track.turn[0]:
        row_rotation.turn_line(line, *track.turn)
    return line


def foretold(line: Line, before: Line | None) -> Line:
    """Return a line moved on as it has moved since `before`; what was measured is left out."""
    arrays = np.empty((7, len(line.x)))
    moving = before is not None and before.n > 20
    known = before if moving else line
    _foretell(
        line.x, line.y, line.amplitude, line.sigma, line.n, known.x, known.y,
        known.n if moving else 0, arrays,
    )  # fmt: skip
    return Line(*arrays, line.n, line.quality, line.longest)


@njit(cache=True)
def _foretell(x, y, amplitude, sigma, n, before_x, before_y, m, arrays):
    """Fill `arrays` (at least 4, limit) with places, absorbance and half-width of a moved line.

    It goes on as it has moved since it had the `m` nodes `before`; not at all where `m` is 0.
    """
    new_x, new_y, new_amplitude, new_sigma = arrays[0], arrays[1], arrays[2], arrays[3]
    for i in range(n):  # loops: copying slices takes three times as long
        new_x[i], new_y[i] = x[i], y[i]
    for i in range(len(amplitude)):
        new_amplitude[i], new_sigma[i] = amplitude[i], sigma[i]
    if m > 0:
        advance(new_x, new_y, n, before_x, before_y, m)


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
