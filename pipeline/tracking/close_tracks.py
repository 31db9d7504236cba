"""Tracks whose lines come close: doubles, blurs, crossings, and two on one whisker."""

import numpy as np
from scipy.optimize import linear_sum_assignment

from pipeline.detection import detect, line_choice, one_or_two
from pipeline.detection.frame import Frame
from pipeline.detection.line import Line
from pipeline.detection.refinement import refine_held
from pipeline.numerics import polyline
from pipeline.tracking.following import Follower
from pipeline.tracking.track_state import Track

DOUBLE_SHARE = 0.6  # part of two lines that may coincide before one of them is given up
KEPT = 0.95  # part of two lines that must still be found when they have exchanged far parts


def drop_doubles(tracks: list[Track], near, near_px: float, follower: Follower) -> None:
    """Of two tracks on one whisker, give up the one that fits worse.

    near : (tracks, tracks) bool, symmetric: which may be on one
    """
    for a, b in _pairs(tracks, near):
        if a.line is None or b.line is None:
            continue
        if _coincide(a.line, b.line, near_px):
            min((a, b), key=follower.claim).lose()


def on_line(given_up: list[Track], line: Line, near_px: float) -> Track | None:
    """The track that was given up on a line that is found anew; it is taken from the list."""
    for k, track in enumerate(given_up):
        if _coincide(line, track.given_up, near_px):
            return given_up.pop(k)
    return None


def drop_ghosts(tracks: list[Track], established: int, params) -> None:
    """Give up what is another whisker's blur; a line of `established` frames is none."""
    tracks = seen(tracks)
    if all(track.age >= established for track in tracks):
        return
    near = polyline.near_pairs([t.line for t in tracks], line_choice.ghost_reach(params))
    for track, beside in zip(tracks, near, strict=True):
        if track.age < established:
            others = [tracks[k].line for k in np.flatnonzero(beside) if tracks[k].line]
            if line_choice.is_ghost(track.line, others, params):
                track.lose()


def uncross(tracks: list[Track], frame: Frame, follower: Follower) -> None:
    """Let lines that have turned off onto each other go on with their own far parts.

    Rows of real whiskers need it: without it, fewer of the whiskers that a person has
    followed are found (24 in place of 25 of a mouse's 26, 8 in place of 10 of a rat's 12
    faint ones).
    """
    tracks = seen(tracks)
    changed = detect.uncrossed([t.line for t in tracks], frame.options)
    if not changed:
        return
    known = {id(line): before for line, before in changed}
    held = frame.model.held
    held.hold([t.line for t in tracks if id(t.line) not in known])
    held.hold([t.line for t in tracks])
    for line, _ in changed:
        refine_held(frame, line)
    pairs = [(t, known[id(t.line)]) for t in tracks if id(t.line) in known]
    if sum(t.line.n * t.line.quality - KEPT * k.n * k.quality for t, k in pairs) < 0:
        for track, line in pairs:  # less is found of them so: they had their own
            track.line = line
        return
    reassign_lines([track for track, _ in pairs])
    for track, _ in pairs:
        track.before = None  # the far part's motion is unknown
        follower.give_up_if_poor(track, frame)


def reassign_lines(tracks: list[Track]) -> None:
    """Give the lines of some tracks to those whose lines before they are most like.

    Two lines that have exchanged far parts close to their bases have practically exchanged tracks.
    """
    lines = [t.line for t in tracks]
    turned = np.nan_to_num([[t.turned_to(line) for t in tracks] for line in lines])
    for line, track in zip(*linear_sum_assignment(np.square(turned)), strict=True):
        tracks[track].take(lines[line], tracks[track].before)


def merge(tracks: list[Track], near_px: float, frame: Frame, follower: Follower) -> None:
    """Let one line stand for two that run together, where it explains as much."""
    near = _pairs(tracks, polyline.near_pairs([t.line for t in tracks], near_px, polyline.FINE))
    if near:
        frame.model.held.hold([t.line for t in tracks])
    for a, b in near:
        if _run_together(a, b) or _run_together(b, a):
            _merge_two(*sorted((a, b), key=follower.claim), frame)


def _merge_two(faint, other, frame) -> None:
    """`merge` of two tracks, of which `faint` is the less sure one."""
    if not _run_together(faint, other):
        return
    lines, held = (faint.line, other.line), frame.model.held
    for line in lines:
        held.take_out(line)
    one = one_or_two.one_for_two(frame, *lines)
    if one is not None:
        other.take(one, other.before)
        faint.lose()
    for track in (faint, other):
        if track.line is not None:
            held.put_in(track.line)


def seen(tracks: list[Track]) -> list[Track]:
    """Those of some tracks that have a line."""
    return [track for track in tracks if track.line is not None]


def _pairs(tracks, near) -> list[tuple[Track, Track]]:
    """Pairs of tracks, of a symmetric (tracks, tracks) bool."""
    return [(tracks[i], tracks[j]) for i, j in zip(*np.nonzero(near), strict=True) if i < j]


def _run_together(faint, other) -> bool:
    """Whether most of a track's line lies on that of another track; not where one is lost."""
    if faint.line is None or other.line is None:
        return False
    reach = line_choice.reach(other.line)
    return line_choice.shared_fraction(faint.line, other.line, reach) >= DOUBLE_SHARE


def _coincide(a: Line, b: Line, near_px: float) -> bool:
    """Whether most of each of two lines is within `near_px` of the other."""
    return all(_near(one, other, near_px) > DOUBLE_SHARE for one, other in ((a, b), (b, a)))


def _near(a: Line, b: Line, near_px: float) -> float:
    """Fraction of line `a` within `near_px` of line `b`."""
    return polyline.share_near(a.x, a.y, a.n, b.x, b.y, b.n, near_px, (4, 4))
