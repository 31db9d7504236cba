"""Touches made to measure: the follicle's motion that makes wanted forces, and none besides.

A touch is given by its force in every frame; what is returned is the base angle that, through
the mechanics of the large-angle rod, gives this force.
"""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from synthetic.scene import Hair
from whiskermodel.rod import free_shape, solve_contact

_LARGEST_TURN = 2.2  # rad of push angle in a force table
_TABLE_STEP = 0.02  # rad
_TABLE_PART = 12  # steps solved at once
_TRIES = 12  # at the base angles that make the wanted forces
_MOST_OF_THE_FOLD = 0.93  # of the largest force before the whisker slips off
_FASTEST_TURN = 0.08  # rad per frame (of about 1 ms)
_STEEPEST = 2.8  # slope of a half-Gaussian's ends, of its peak over its duration
_ON_THE_WHISKER = 0.98  # of the length, how far out a wanted touch may lie


@dataclass(frozen=True)
class Touch:
    """A contact that is wanted: first frame, number of frames, peak force [N], time course.

    `shape`: "half_gaussian" (the paper's), "plateau" or "skewed"; the peak force is that of the
    frame with the largest.
    """

    onset: int
    duration: int
    peak_force: float
    shape: str = "half_gaussian"

    @property
    def offset(self) -> int:
        """First frame after the touch."""
        return self.onset + self.duration

    def forces(self) -> np.ndarray:
        """Force in each of its frames [N], (duration,); zero half a frame before."""
        profile = _PROFILES[self.shape]((np.arange(self.duration) + 0.5) / self.duration)
        return self.peak_force * profile / profile.max()


def unit_half_gaussian(z):
    """Top half of a Gaussian over z from −½ to ½, peak 1; negative beyond.

    Written here, and not taken from what fits pulses: truth leans on no fit.
    """
    return 2 * (np.exp(-4 * np.log(2) * z**2) - 0.5)


_PROFILES = {
    "half_gaussian": lambda t: unit_half_gaussian(t - 0.5),
    "plateau": lambda t: 1 - np.abs(2 * t - 1) ** 3,
    "skewed": lambda t: unit_half_gaussian(t + 0.5 * t * (1 - t) - 0.5),
}


class UnreachableForceError(ValueError):
    """The whisker slips off the pole before the wanted force is reached."""


def grazing_angle(hair: Hair, pole_dx, pole_dy, pole_radius, side):
    """Base angle [rad] at which the free whisker just touches the pole at (dx, dy) from it [m].

    NaN where the pole is out of the whisker's reach.
    """
    s = np.linspace(0, hair.whisker.length, 2001)
    x, y, angle = free_shape(hair.whisker, 0.0, 0.0, 0.0, s, hair.intrinsic_curvature)
    reach = side * (pole_radius + hair.whisker.radius(s))
    x, y = x - reach * np.sin(angle), y + reach * np.cos(angle)
    distance = np.hypot(x, y)
    first = np.argmin(distance)  # near the base the offset curve runs backwards
    direction = np.unwrap(np.arctan2(y, x))
    wanted = np.hypot(pole_dx, pole_dy)
    found = np.interp(wanted, distance[first:], direction[first:], left=np.nan, right=np.nan)
    return np.arctan2(pole_dy, pole_dx) - found


@dataclass(frozen=True)
class ForceTable:
    """Force against push angle for one follicle, pole and side, up to where the whisker slips.

    `turn` [rad] is counted from the grazing touch into the pole; `force` [N] rises with it;
    `contact` is the touch's arc length [m].
    """

    turn: np.ndarray
    force: np.ndarray
    contact: np.ndarray

    @property
    def largest_force(self) -> float:
        """Largest force that a touch may ask for [N]."""
        return _MOST_OF_THE_FOLD * self.force[-1]

    def bearable_force(self, frames):
        """Largest force [N] of half-Gaussians of so many frames that a follicle can make.

        Some room is left to the slip, and the base turns no faster than _FASTEST_TURN.
        """
        turn = _FASTEST_TURN * np.asarray(frames) / _STEEPEST
        return np.minimum(np.interp(turn, self.turn, self.force), 0.85 * self.largest_force)


def force_table(hair: Hair, base_x, base_y, pole_x, pole_y, pole_radius, side) -> ForceTable:
    """Force against push angle of a follicle at rest; raises ValueError out of reach."""
    graze = grazing_angle(hair, pole_x - base_x, pole_y - base_y, pole_radius, side)
    if not np.isfinite(graze):
        raise ValueError(
            f"the pole at {1e3 * np.hypot(pole_x - base_x, pole_y - base_y):.2f} mm from the "
            f"follicle is out of reach of a whisker of {1e3 * hair.whisker.length:.2f} mm"
        )
    turns = np.arange(1, int(_LARGEST_TURN / _TABLE_STEP)) * _TABLE_STEP
    force, contact = [0.0], []
    for first in range(0, len(turns), _TABLE_PART):  # beyond the fold each turn costs much
        part = turns[first : first + _TABLE_PART]
        solved = solve_contact(
            hair.whisker, (base_x, base_y, graze + side * part), (pole_x, pole_y, pole_radius),
            side, hair.intrinsic_curvature,
        )  # fmt: skip
        place = solved.contact_arc_length
        good = solved.touching & ~(place > _ON_THE_WHISKER * hair.whisker.length)
        good &= np.diff(solved.contact_force, prepend=force[-1]) > 0
        end = len(good) if good.all() else int(np.argmin(good))
        force.extend(solved.contact_force[:end])
        contact.extend(place[:end])
        if end < len(good):
            break
    turn = np.concatenate([[0.0], turns])[: len(force)]
    return ForceTable(turn, np.array(force), np.array([*contact[:1], *contact]))


def angles_for_forces(hair: Hair, base_x, base_y, pole, side, force, table=None):
    """Base angle in every frame that gives the wanted contact force, and where it touches.

    Parameters
    ----------
    base_x, base_y, force : (frames,), follicle [m] and wanted force [N], >= 0
    pole : (x, y, radius) [m], at rest
    side : +1, −1 as in whiskermodel.rod
    table : ForceTable of about the same follicle and pole; None: made here

    Returns
    -------
    base_angle : (frames,) [rad]; where the force is 0, the grazing touch
    contact : (frames,) arc length of the touch [m], NaN where the force is 0

    Raises
    ------
    UnreachableForceError
        Where the whisker slips off before.
    """
    middle = len(base_x) // 2
    if table is None:
        table = force_table(hair, base_x[middle], base_y[middle], *pole, side)
    if force.max() > table.largest_force:
        raise UnreachableForceError(
            f"a force of {1e6 * force.max():.1f} µN is out of reach: the whisker slips off "
            f"beyond {1e6 * table.largest_force:.1f} µN"
        )
    graze = grazing_angle(hair, pole[0] - base_x, pole[1] - base_y, pole[2], side)
    turn = np.interp(force, table.force, table.turn)
    slope = np.interp(turn, table.turn, np.gradient(table.force, table.turn))
    contact = np.where(force > 0, np.interp(turn, table.turn, table.contact), np.nan)
    made, rows = np.zeros_like(force), np.flatnonzero(force > 0)
    step = turn.copy()  # of the turn, since `made` was the force
    for _ in range(_TRIES):
        solved = solve_contact(
            hair.whisker, (base_x[rows], base_y[rows], graze[rows] + side * turn[rows]), pole,
            side, hair.intrinsic_curvature, guess=(contact[rows], force[rows]),
        )  # fmt: skip
        missing = force[rows] - solved.contact_force
        seen = (solved.contact_force - made[rows]) / step[rows]  # the secant's slope
        usual = slope[rows]
        slope[rows] = np.where((seen > 0.5 * usual) & (seen < 2 * usual), seen, usual)
        made[rows], contact[rows] = solved.contact_force, solved.contact_arc_length
        open_ = np.abs(missing) >= 1e-6 * force[rows] + 1e-13
        rows, missing = rows[open_], missing[open_]
        if len(rows) == 0:
            return graze + side * turn, contact
        new = np.maximum(turn[rows] + missing / slope[rows], 0.3 * turn[rows])
        step[rows] = new - turn[rows]
        turn[rows] = new
    raise UnreachableForceError(
        f"no base angle gives {1e6 * force.max():.1f} µN (missing {1e6 * missing.max():.2g} µN)"
    )


def drive_touches(hair, base, pole, side, touches, rng, rest=0.18, table=None):
    """Base angle over a whole trial that makes the wanted touches and none besides.

    Parameters
    ----------
    base : (x, y), each (frames,): follicle [m]
    pole : (x, y, radius) [m], at rest
    side : +1: protraction towards a pole on the whisker's left
    touches : list of Touch, apart from each other, in order
    rest : how far the whisker draws back between touches, at most [rad]
    table : ForceTable of about the same follicle and pole; None: made here

    Returns
    -------
    base_angle : (frames,) [rad]
    touch : (contact arc length [m], force [N]), each (frames,), NaN in the gaps: a start for
        `solve_motion`
    """
    base_x, base_y = base
    n = len(base_x)
    graze = grazing_angle(hair, pole[0] - base_x, pole[1] - base_y, pole[2], side)
    _check_order(touches, n)
    if table is None:
        table = force_table(hair, base_x.mean(), base_y.mean(), *pole, side)
    turn, force, contact = np.zeros(n), np.full(n, np.nan), np.full(n, np.nan)
    for touch in touches:
        force[touch.onset : touch.offset] = touch.forces()
    inside = np.flatnonzero(np.isfinite(force))
    if len(inside):
        angle, contact[inside] = angles_for_forces(
            hair, base_x[inside], base_y[inside], pole, side, force[inside], table
        )
        turn[inside] = side * (angle - graze[inside])  # into the pole
    edges = [  # per touch: time and speed of turning [frames, rad/frame] at both ends
        (t.onset - 0.5, t.offset - 0.5, 2 * turn[t.onset], 2 * turn[t.offset - 1]) for t in touches
    ]
    for start, end, leaving, arriving in _gaps(edges, n):
        frames = np.arange(int(np.ceil(start)), int(np.ceil(end)))
        turn[frames] = _between(frames, start, end, leaving, arriving, rest, rng)
    return graze + side * turn, (contact, force)


def _check_order(touches, n):
    ends = [0]
    for touch in touches:
        if touch.onset <= ends[-1] or touch.offset >= n or touch.duration < 1:
            raise ValueError(
                f"touches must be apart, in order and inside the {n} frames, got "
                f"[{touch.onset}, {touch.offset}) after {ends[-1]}"
            )
        ends.append(touch.offset)


def _gaps(edges, n):
    """Free stretches between touches: start, end [frames], speed leaving and arriving (>= 0)."""
    start, leaving = -1.0, None
    for onset, offset, rising, falling in edges:
        yield start, onset, leaving, rising
        start, leaving = offset, falling
    yield start, float(n), leaving, None


def _between(frames, start, end, leaving, arriving, rest, rng):
    """Turn [rad] (< 0: away from the pole) in the frames of a free stretch.

    The whisker leaves the pole at one speed, slows down within about `rest` [rad], whisks in the
    air while there is time, and speeds up to meet the pole again.
    """
    outward = _knots(start, leaving, 1, rest, rng) if leaving is not None else []
    inward = _knots(end, arriving, -1, rest, rng) if arriving is not None else []
    if outward and inward and inward[-1][0] - outward[-1][0] < 4:
        # no time to slow down: straight from one to the other
        outward, inward = outward[:1], inward[:1]
    first = outward[-1][0] if outward else start - 1.0
    last = inward[-1][0] if inward else end + 1.0
    air = _whisks(first, last, not outward, not inward, rest, rng) if last - first > 8 else []
    knots = np.array([*outward, *air, *inward[::-1]])
    spline = CubicHermiteSpline(*knots.T)
    # a stretch too short or slow for its own arc still leaves the pole
    return np.minimum(spline(frames), -2e-5)


def _knots(at, speed, way, rest, rng):
    """(time, turn, slope) where the touch ends or begins, and where the whisker is at rest."""
    depth = rest * rng.uniform(0.3, 0.9)
    pause = min(3 * depth / max(speed, 1e-9), 25.0)
    return [(at, 0.0, -way * speed), (at + way * pause, -speed * pause / 3 - 1e-3, 0.0)]


def _whisks(first, last, opened, closed, rest, rng):
    """(time, turn, slope) of the turning points of whisking in the air between two times.

    With `opened` and `closed` the first and the last time themselves are turning points.
    """
    count = int((last - first) / rng.uniform(30.0, 42.0))  # half whisks
    times = np.linspace(first, last, count + 2)
    times[1:-1] += rng.uniform(-4, 4, count)
    near = (np.arange(count + 2) + rng.integers(2)) % 2 == 1
    turn = -rest * np.where(
        near, rng.uniform(0.2, 0.5, count + 2), rng.uniform(0.7, 1.2, count + 2)
    )
    keep = slice(0 if opened else 1, None if closed else -1)
    return [(t, v, 0.0) for t, v in zip(times[keep], turn[keep], strict=True)]
