"""How whiskers, follicles and pole move: whisking, touches made to measure, slips; solved quasi-
statically through the large-angle rod, frame by frame.

A touch is asked for by its force in every frame; what is returned is the follicle's motion that,
through the mechanics, gives this force. Nothing else is laid on the whisker.
"""

from dataclasses import dataclass, fields

import numpy as np
from scipy.interpolate import CubicHermiteSpline
from scipy.ndimage import gaussian_filter1d

from synthetic.scene import Hair, Scene
from whiskermodel.rod import RodContact, contact_shape, free_shape, solve_contact

_NODE_STEP_PX = 1.4
_BLOCK = 128  # frames whose shapes are computed at once
_SMEAR_NODES = 25
_FAR = 1.0  # m: where the pole stands while it is out of view
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


def _half_gaussian(t):
    """Top half of a Gaussian over t in 0–1, peak 1; written here, as truth leans on no fit."""
    return 2 * (np.exp(-((t - 0.5) ** 2) * 4 * np.log(2)) - 0.5)


_PROFILES = {
    "half_gaussian": _half_gaussian,
    "plateau": lambda t: 1 - np.abs(2 * t - 1) ** 3,
    "skewed": lambda t: _half_gaussian(t + 0.5 * t * (1 - t)),
}


class UnreachableForceError(ValueError):
    """The whisker slips off the pole before the wanted force is reached."""


# Follicle ------------------------------------------------------------------------------------


def whisking(n, rate, rng, set_point=0.0, amplitude=0.25, frequency=14.0):
    """Base angle of free whisking [rad], (n,): a wandering set-point, modulated oscillation.

    `amplitude` [rad] is the half-range of a full whisk, `frequency` [Hz] its mean rate.
    """
    t = np.arange(n) / rate
    pace = frequency * (1 + 0.15 * smooth_noise(n, rate, 0.15, rng))
    phase = 2 * np.pi * np.cumsum(pace) / rate + rng.uniform(0, 2 * np.pi)
    strength = np.clip(0.75 + 0.35 * smooth_noise(n, rate, 0.12, rng), 0.1, 1.1)
    drift = 0.35 * amplitude * smooth_noise(n, rate, 0.25, rng)
    whisk = np.cos(phase) + 0.12 * np.cos(2 * phase + 0.8)
    return set_point + drift + amplitude * strength * whisk + 0 * t


def smooth_noise(n, rate, time_constant, rng):
    """Gaussian noise (n,) of about unit SD that changes over `time_constant` [s]."""
    width = time_constant * rate
    pad = int(4 * width) + 1
    noise = gaussian_filter1d(rng.normal(size=n + 2 * pad), width)[pad : pad + n]
    return noise * np.sqrt(2 * np.sqrt(np.pi) * width)


def follicle_drift(n, rate, rng, extent=0.12e-3):
    """Slow wander of the follicle about its mean place [m], two arrays (n,)."""
    return tuple(extent * np.tanh(smooth_noise(n, rate, 0.2, rng)) for _ in range(2))


# Force → base angle --------------------------------------------------------------------------


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
            hair.whisker, base_x, base_y, graze + side * part, pole_x, pole_y, pole_radius, side,
            hair.intrinsic_curvature,
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
            hair.whisker, base_x[rows], base_y[rows], graze[rows] + side * turn[rows], *pole,
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


def drive_touches(hair, base_x, base_y, pole, side, touches, rng, rest=0.18, table=None):
    """Base angle over a whole trial that makes the wanted touches and none besides.

    Parameters
    ----------
    base_x, base_y : (frames,) follicle [m]
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


# Base motion → whisker -----------------------------------------------------------------------


@dataclass(frozen=True)
class HairMotion:
    """One whisker's equilibria in every frame, and the frames before which it slipped off."""

    contact: RodContact
    slips: tuple[int, ...] = ()


def solve_motion(
    hair: Hair, base_x, base_y, base_angle, pole_x, pole_y, pole_radius, side, guess=None
):
    """Quasi-static equilibria of a driven whisker; it changes the pole's side where it slips.

    Parameters
    ----------
    base_x, base_y, base_angle, pole_x, pole_y : (frames,); a NaN pole is out of view
    side : +1, −1: on which side of the whisker the pole is at first
    guess : (contact arc length [m], force [N]), each (frames,), NaN for none: saves time

    Returns
    -------
    HairMotion
    """
    n, first, slips, parts = len(base_x), 0, [], []
    seen = np.isfinite(pole_x)
    while first < n:
        rest = slice(first, n)
        # a pole out of view: far off on its side, where it is surely free
        aside = base_angle[rest] + side * np.pi / 2
        x = np.where(seen[rest], pole_x[rest], base_x[rest] + _FAR * np.cos(aside))
        y = np.where(seen[rest], pole_y[rest], base_y[rest] + _FAR * np.sin(aside))
        solved = solve_contact(
            hair.whisker, base_x[rest], base_y[rest], base_angle[rest], x, y, pole_radius, side,
            hair.intrinsic_curvature, guess=guess and tuple(part[rest] for part in guess),
        )  # fmt: skip
        lost = np.flatnonzero(solved.state == "slipped")
        end = n if len(lost) == 0 else first + int(lost[0])
        if end == first and slips and slips[-1] == first:
            raise ValueError(f"frame {first}: the whisker has no place on either side of the pole")
        parts.append(take_frames(solved, slice(0, end - first)))
        if end < n:
            slips.append(end)
            side = -side
        first = end
    return HairMotion(_join(parts), tuple(slips))


def take_frames(contact: RodContact, rows) -> RodContact:
    """Frames `rows` (slice or indices) of a RodContact."""
    return RodContact(*(getattr(contact, f.name)[rows] for f in fields(RodContact)))


def _join(parts):
    names = [f.name for f in fields(RodContact)]
    return RodContact(*(np.concatenate([getattr(p, name) for p in parts]) for name in names))


class Motion:
    """All motion of one video: `hairs` (HairMotion each), the pole's place, the fur's phase.

    `pole_x`, `pole_y` are (frames,) [m], NaN while the pole is out of view.
    """

    def __init__(self, scene: Scene, hairs, pole_x, pole_y):
        self.scene, self.hairs = scene, tuple(hairs)
        self.pole_x, self.pole_y = np.asarray(pole_x, float), np.asarray(pole_y, float)
        for hair in self.hairs:
            if len(hair.contact) != len(self.pole_x):
                raise ValueError(
                    f"hairs must have {len(self.pole_x)} frames like the pole, got "
                    f"{len(hair.contact)}"
                )
        angle = self.hairs[0].contact.base_angle if self.hairs else np.zeros(len(self.pole_x))
        self.fur_phase = np.tanh(2.5 * (angle - angle.mean()))
        self._nodes = [_nodes(scene, hair) for hair in scene.hairs]
        self._blocks, self._lines = {}, {}

    def __len__(self):
        return len(self.pole_x)

    @property
    def pole_is_still(self) -> bool:
        """Whether the pole stands in one place, or is out of view, all the time."""
        return all(
            np.array_equal(p, np.full_like(p, p[0]), equal_nan=True)
            for p in (self.pole_x, self.pole_y)
        )

    def strip(self, hair: int, frame: int):
        """What `cover_strip` draws: x, y [px], angle, curvature [1/px], radius, smear [px]."""
        x, y, angle, curvature, smear = self._shape(hair, frame)
        camera, s = self.scene.camera, self._nodes[hair]
        radius = self.scene.hairs[hair].whisker.radius(s) * camera.pixels_per_m
        px, py = self.scene.to_pixels(x, y)
        return px, py, angle, curvature / camera.pixels_per_m, radius, smear

    def centrelines(self, hair: int, frames=None):
        """True centrelines [px], follicle → tip, 1 px apart: x, y (frames, points)."""
        if frames is not None:
            return self._centrelines(hair, take_frames(self.hairs[hair].contact, frames))
        if hair not in self._lines:
            self._lines[hair] = self._centrelines(hair, self.hairs[hair].contact)
        return self._lines[hair]

    def _centrelines(self, hair, contact):
        length = self.scene.hairs[hair].whisker.length
        points = max(round(length * self.scene.camera.pixels_per_m), 1) + 1
        s = np.linspace(0, length, points)
        parts = [
            contact_shape(self.scene.hairs[hair].whisker, take_frames(contact, rows), s)[:2]
            for rows in _blocks(len(contact))
        ]
        x, y = (np.concatenate(p) for p in zip(*parts, strict=True))
        return self.scene.to_pixels(x, y)

    def _shape(self, hair, frame):
        """x, y [m], angle, curvature [1/m], smear [px] of one frame at the nodes."""
        block = self._block(hair, frame // _BLOCK)
        return tuple(part[frame % _BLOCK] for part in block)

    def _block(self, hair, block):
        if self._blocks.get(hair, (None,))[0] != block:
            rows = slice(block * _BLOCK, min((block + 1) * _BLOCK, len(self)))
            part = take_frames(self.hairs[hair].contact, rows)
            whisker, s = self.scene.hairs[hair].whisker, self._nodes[hair]
            x, y, angle = contact_shape(whisker, part, s)
            curvature = curvature_at(whisker, part, s, (x, y))
            self._blocks[hair] = (block, (x, y, angle, curvature, self._smear(hair, rows)))
        return self._blocks[hair][1]

    def _smear(self, hair, rows):
        """Way across the tangent during the exposure [px], (frames, nodes).

        Of the ways to the frame before and after the lesser counts: no smear where it jumps.
        """
        camera, n = self.scene.camera, len(self)
        around = np.clip(np.arange(rows.start - 1, rows.stop + 1), 0, n - 1)
        nodes = self._nodes[hair]
        coarse = np.linspace(0, nodes[-1], _SMEAR_NODES)
        part = take_frames(self.hairs[hair].contact, around)
        x, y, angle = contact_shape(self.scene.hairs[hair].whisker, part, coarse)
        nx, ny = -np.sin(angle[1:-1]), np.cos(angle[1:-1])
        dx, dy = np.diff(x, axis=0), np.diff(y, axis=0)
        way = np.minimum(*(np.abs(dx[k] * nx + dy[k] * ny) for k in (slice(-1), slice(1, None))))
        way *= camera.exposure_s * camera.frames_per_second * camera.pixels_per_m
        return np.stack([np.interp(nodes, coarse, row) for row in way])


def _blocks(n):
    """Slices of at most _BLOCK frames that make up n."""
    return [slice(first, min(first + _BLOCK, n)) for first in range(0, n, _BLOCK)]


def _nodes(scene, hair):
    """Arc lengths [m] at which a whisker's shape is kept for drawing."""
    length_px = hair.whisker.length * scene.camera.pixels_per_m
    return np.linspace(0, hair.whisker.length, int(np.ceil(length_px / _NODE_STEP_PX)) + 1)


def curvature_at(whisker, contact: RodContact, s, place=None):
    """True curvature [1/m], (frames, points), at arc lengths `s` (points,) [m].

    κ = κ0 + (r_c − r) × F / E I(s), the load's part up to the contact only; `place` may hold
    x, y at `s` where they are known already.
    """
    x, y = contact_shape(whisker, contact, s)[:2] if place is None else place
    powers = s[:, None] ** np.arange(contact.intrinsic_curvature.shape[1])
    rest = contact.intrinsic_curvature @ powers.T
    touching = contact.touching
    force = (-contact.side * np.where(touching, contact.contact_force, 0.0))[:, None]
    angle = np.where(touching, contact.contact_angle, 0.0)[:, None]
    fx, fy = -force * np.sin(angle), force * np.cos(angle)
    rx = np.where(touching, contact.contact_x, 0.0)[:, None] - x
    ry = np.where(touching, contact.contact_y, 0.0)[:, None] - y
    loaded = s <= np.where(touching, contact.contact_arc_length, -1.0)[:, None]
    moment = np.where(loaded, rx * fy - ry * fx, 0.0)
    return rest + moment / whisker.flexural_rigidity(s)


def still_pole(scene: Scene, n: int):
    """Place of a pole that does not move, NaN without one: two arrays (n,) [m]."""
    if scene.pole is None:
        return np.full(n, np.nan), np.full(n, np.nan)
    return np.full(n, scene.pole.x), np.full(n, scene.pole.y)


def pole_visits(scene: Scene, n: int, visits, travel: int):
    """Place of a pole that comes in and is withdrawn; NaN while it is out of the picture.

    Parameters
    ----------
    visits : list of (first, end) frames between which it is on its way or in its place
    travel : frames that each way takes, from `away` to its place or back

    Returns
    -------
    pole_x, pole_y : (n,) [m]
    """
    pole, frame = scene.pole, np.arange(n)
    there = np.zeros(n)
    for first, end in visits:
        ramp = np.clip(np.minimum(frame - first, end - frame) / travel, 0, 1)
        there = np.maximum(there, ramp**2 * (3 - 2 * ramp))
    x, y = pole.x + (1 - there) * pole.away_x, pole.y + (1 - there) * pole.away_y
    px, py = scene.to_pixels(x, y)
    margin = 1.5 * pole.radius * scene.camera.pixels_per_m + 6
    out = (px < -margin) | (px > scene.camera.width + margin)
    out |= (py < -margin) | (py > scene.camera.height + margin)
    return np.where(out, np.nan, x), np.where(out, np.nan, y)


def side_of_pole(hair: Hair, base_x, base_y, base_angle, pole_x, pole_y) -> int:
    """+1 where the pole lies to the left of the free whisker, seen from follicle to tip, or −1."""
    s = np.linspace(0, hair.whisker.length, 200)
    x, y, angle = free_shape(hair.whisker, base_x, base_y, base_angle, s, hair.intrinsic_curvature)
    nearest = np.argmin(np.hypot(x - pole_x, y - pole_y))
    across = np.cos(angle[nearest]) * (pole_y - y[nearest])
    across -= np.sin(angle[nearest]) * (pole_x - x[nearest])
    return 1 if across >= 0 else -1
