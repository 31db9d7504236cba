"""The elastic rod, integrated from one place both ways: where it lies, and its derivatives.

From the contact towards the follicle, every place depends only on those before it, so the rod and
its derivatives by (offset and direction at the contact, rest shape, force, origin of the arc
length) come in one pass. Angles by Simpson's rule, places and derivatives to fourth and
second order.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from pipeline.forces.rod_types import COMPILED

N_REST = 4  # Legendre polynomials of the rest curvature
FREE, LOADED = N_REST + 2, N_REST + 3  # numbers of parameters
ORIGIN = LOADED  # whose derivatives come behind those by the parameters
SMALL_TURN = 0.2  # rad: up to here a series of eight terms gives sine and cosine to 1e-11


class Rod(NamedTuple):
    """A rod and its derivatives by its parameters: what `integrate` fills.

    x, y, angle, cos, sin : (stations,) places [m] and directions
    shift : (parameters and origin, stations) how far a station moves along its normal per unit
    base : (3, parameters and origin) how the follicle moves (x, y) and turns per unit
    follicle : (4,) its place and angle, and the curvature there
    d, middle, high : scratch
    """

    x: np.ndarray
    y: np.ndarray
    angle: np.ndarray
    cos: np.ndarray
    sin: np.ndarray
    shift: np.ndarray
    base: np.ndarray
    follicle: np.ndarray
    d: np.ndarray
    middle: np.ndarray
    high: np.ndarray


class Place(NamedTuple):
    """Where the integration begins: grid place `c`, and what offset and direction count from."""

    c: float
    x: float
    y: float


@njit(**COMPILED)
def empty_rod(m):
    """A Rod of `m` stations, to be filled."""
    return Rod(
        np.zeros(m), np.zeros(m), np.zeros(m), np.zeros(m), np.zeros(m),
        np.zeros((ORIGIN + 1, m)), np.zeros((3, ORIGIN + 1)), np.zeros(4),
        np.zeros((4, N_REST + 2)), np.zeros(N_REST), np.zeros(N_REST),
    )  # fmt: skip


@njit(**COMPILED)
def start_of(p, place):
    """Where the integration begins: for a loaded rod, the contact point."""
    return place.x - p[0] * np.sin(p[1]), place.y + p[0] * np.cos(p[1])


@njit(**COMPILED)
def integrate(p, beam, load, arc, place, rod):
    """Integrate a rod from its place both ways, with its derivatives by parameters and origin.

    The rest shape moves along with the origin: the stiffness changes, and the follicle's place.

    p : offset [m] and direction [rad] at the place, rest coefficients [1/m], force [N] if loaded
    beam, load, arc, place : `Beam`, `Load`, `Arc`, `Place`
    """
    m, loaded = len(rod.x), load.side != 0
    sin, cos = np.sin(p[1]), np.cos(p[1])
    x, y = start_of(p, place)
    fx, fy = unit_force(p[1], load.side, load.friction) if loaded else (0.0, 0.0)
    pull = p[2 + N_REST] if loaded else 0.0, fx, fy
    begin = place.c, x, y, cos, sin
    before = min(int(np.ceil(place.c / arc.spacing)) - 1, m - 1)
    for direction in (-1, 1):  # as a variable: one version is compiled, not two
        k, bends = (before, loaded) if direction < 0 else (before + 1, False)
        end = _integrate_one_way(direction, k, p, beam, bends, pull, arc, begin, rod)
        if direction < 0:
            at_x, at_y, angle, bend, heading = end
            follicle, base = rod.follicle, rod.base
            follicle[0], follicle[1], follicle[2], follicle[3] = at_x, at_y, angle, bend
            base[0, 0], base[1, 0], base[2, 0] = -sin, cos, 0.0
            base[0, 1], base[1, 1], base[2, 1] = -(at_y - y), at_x - x, 1.0
            base[:, 2:] = rod.d[:3]
            base[0, ORIGIN] -= heading[0]
            base[1, ORIGIN] -= heading[1]
            base[2, ORIGIN] -= bend


@njit(**COMPILED)
def move(rod, step):
    """Move a rod by a small `step` of its parameters, to first order."""
    shift, base, follicle = rod.shift, rod.base, rod.follicle
    for a in range(len(step)):
        for k in range(len(rod.x)):
            rod.x[k] -= step[a] * shift[a, k] * rod.sin[k]
            rod.y[k] += step[a] * shift[a, k] * rod.cos[k]
        for j in range(3):
            follicle[j] += step[a] * base[j, a]


@njit(**COMPILED)
def _integrate_one_way(direction, k, p, beam, bends, pull, arc, begin, rod):
    """Integrate to stations k, k + direction, …, and before station 0 to the follicle.

    Returns the end's place, angle, curvature, and heading.

    `bends`: the load bends the rod on this side of its place; `pull`: force [N] and its
    direction; `begin`: grid place, x, y, cosine and sine where it starts. `rod.d` is left with
    the derivatives of x, y, angle and curvature by rest terms, force and origin at the end.
    """
    (force, fx, fy), (origin, moved, h), (s, start_x, start_y, cos, sin) = pull, arc, begin
    d, middle, high, m, per_half = rod.d, rod.middle, rod.high, len(rod.x), 2 / beam.length
    at_x, at_y, theta, heading = start_x, start_y, p[1], (cos, sin)
    rest = _rest_curvature((s + origin - moved) * per_half - 1, p, high)
    d[:, :] = 0.0
    d[3, :N_REST] = high
    soft = softness(s + origin, beam) if bends else 0.0
    bend, slope = rest, -soft * force * (cos * fy - sin * fx)
    while -1 <= k < m:
        # past station 0 comes the follicle itself
        step = (k * h if k >= 0 else -origin) - s
        end = s + step + origin
        middle_rest = _rest_curvature((end - moved - step / 2) * per_half - 1, p, middle)
        next_rest = _rest_curvature((end - moved) * per_half - 1, p, high)
        middle_soft = softness(end - step / 2, beam) if bends else 0.0
        next_soft = softness(end, beam) if bends else 0.0
        turn, new_x, new_y, new_heading, bent, bend = _stretch(
            step,
            (rest, middle_rest, next_rest),
            (soft * force, middle_soft * force, next_soft * force),
            (fx, fy),
            (start_x - at_x, start_y - at_y),
            heading,
            bend,
            slope,
        )
        slope = (bend - bent) / step if step != 0 else slope  # a station may lie at the place
        arm = start_x - at_x - new_x, start_y - at_y - new_y
        softer = 4 * next_soft / (beam.cone_length - end)
        _advance(step, (heading, new_heading), (next_soft, softer, force), (fx, fy), arm, high, d)
        theta, at_x, at_y, heading = theta + turn, at_x + new_x, at_y + new_y, new_heading
        s, soft, rest = s + step, next_soft, next_rest
        if k < 0:
            break
        rod.x[k], rod.y[k], rod.angle[k] = at_x, at_y, theta
        rod.cos[k], rod.sin[k] = heading
        _fill_shift(rod.shift, k, heading, cos, sin, at_x - start_x, at_y - start_y, d)
        k += direction
    return at_x, at_y, theta, bend, heading


@njit(**COMPILED, inline="always")
def _fill_shift(shift, k, heading, cos, sin, dx, dy, d):
    """Fill how far station k, (dx, dy) from the place, moves along its normal per parameter."""
    nx, ny = -heading[1], heading[0]
    shift[0, k] = -sin * nx + cos * ny
    shift[1, k] = -dy * nx + dx * ny
    for q in range(N_REST + 2):
        shift[2 + q, k] = d[0, q] * nx + d[1, q] * ny


@njit(**COMPILED, inline="always")
def _rest_curvature(u, p, values):
    """Rest curvature where the Legendre polynomials, put into `values`, have the argument `u`."""
    polynomials(u, values)
    total = 0.0
    for j in range(N_REST):
        total += p[2 + j] * values[j]
    return total


@njit(**COMPILED)
def unit_force(c_angle, side, friction):
    """Force on the whisker per unit of its normal component, in the lab."""
    cos, sin = np.cos(c_angle), np.sin(c_angle)
    return side * sin + friction * cos, -side * cos + friction * sin


@njit(**COMPILED, inline="always")
def polynomials(u, values):
    """Legendre polynomials at `u`, into `values` (N_REST,)."""
    before, now = 1.0, u
    for j in range(N_REST):
        values[j] = before
        before, now = now, ((2 * j + 3) * u * now - (j + 1) * before) * (1 / (j + 2))


@njit(**COMPILED, inline="always")
def softness(s, beam):
    """1/(E I(s)) [1/(N m²)]; the very tip of a full cone, which has none, is stiffened."""
    square = (1 - s * (1 / beam.cone_length)) ** 2
    return 1 / (beam.rigidity * max(square * square, 1e-7))


@njit(**COMPILED, inline="always")
def _turned(heading, turn):
    """Cosine and sine of a direction that turns by `turn`; a series where that is little."""
    cos, sin = heading
    if abs(turn) > SMALL_TURN:
        c, s = np.cos(turn), np.sin(turn)
    else:
        t = turn * turn
        c = 1 - t * (1 / 2 - t * (1 / 24 - t * (1 / 720)))
        s = turn * (1 - t * (1 / 6 - t * (1 / 120 - t * (1 / 5040))))
    return cos * c - sin * s, sin * c + cos * s


@njit(**COMPILED, inline="always")
def _stretch(step, rest, soft, push, arm, heading, bend, slope):
    """Fourth-order step of angle and place, by Simpson's rule.

    rest: curvature at start, middle, end; soft: force over rigidity there; push: the force's
    direction; arm: from the place to the contact; heading: cosine and sine; `bend` and `slope`:
    curvature at the start and its change per length, as known so far, by which the way to middle
    and end is bent where the lever is wanted. Returns the turn, the way made in x and y, the
    new heading, and the curvature at start and end.
    """
    (k0, k1, k2), (f0, f1, f2), (fx, fy), (arm_x, arm_y) = rest, soft, push, arm
    half, sixth = step / 2, step * (1 / 6)
    c1, s1 = heading
    lever, along, across = arm_x * fy - arm_y * fx, c1 * fy - s1 * fx, -s1 * fy - c1 * fx
    short = bend * bend * (1 / 6)
    ahead, aside = half * (1 - half * half * short), half * half * (bend / 2 + slope * sixth / 2)
    r1 = k0 + f0 * lever
    r2 = k1 + f1 * (lever - ahead * along - aside * across)
    ahead, aside = step * (1 - step * step * short), step * step * (bend / 2 + slope * sixth)
    r3 = k2 + f2 * (lever - ahead * along - aside * across)
    c2, s2 = _turned(heading, sixth / 4 * (5 * r1 + 8 * r2 - r3))
    turn = sixth * (r1 + 4 * r2 + r3)
    c3, s3 = _turned(heading, turn)
    way_x, way_y = sixth * (c1 + 4 * c2 + c3), sixth * (s1 + 4 * s2 + s3)
    return turn, way_x, way_y, (c3, s3), r1, r3


@njit(**COMPILED)
def _advance(step, headings, bends, push, arm, basis, d):
    """Second-order step of the derivatives `d` of x, y, angle and curvature."""
    (cos, sin), (new_cos, new_sin) = headings
    (soft, softer, force), (fx, fy), (arm_x, arm_y) = bends, push, arm
    lever = arm_x * fy - arm_y * fx
    more = lever * soft, lever * softer * force  # of the curvature, by force and origin
    for q in range(N_REST + 2):
        turned = d[2, q] + 0.5 * step * d[3, q]
        dx, dy = d[0, q] - step * sin * turned, d[1, q] + step * cos * turned
        rate = force * soft * (dy * fx - dx * fy)
        rate += basis[q] if q < N_REST else more[q - N_REST]
        new_turn = d[2, q] + 0.5 * step * (d[3, q] + rate)
        d[0, q] -= 0.5 * step * (sin * d[2, q] + new_sin * new_turn)
        d[1, q] += 0.5 * step * (cos * d[2, q] + new_cos * new_turn)
        d[2, q], d[3, q] = new_turn, rate


@njit(**COMPILED)
def nearest_to(x, y, cos, sin, h, c, px, py):
    """Arc length where the pole lies square to the model, near `c`."""
    m = len(x)
    middle = min(max(int(c / h), 0), m - 2)
    for away in range(m):
        for k in (middle - away, middle + away):
            if not 0 <= k <= m - 2:
                continue
            ahead = (px - x[k]) * cos[k] + (py - y[k]) * sin[k]
            behind = (px - x[k + 1]) * cos[k + 1] + (py - y[k + 1]) * sin[k + 1]
            if ahead >= 0 > behind:
                return (k + ahead / (ahead - behind)) * h
    return c


@njit(**COMPILED)
def point_at(x, y, angle, h, s):
    """Place and direction between stations: the arc through both."""
    k = min(int(s / h), len(x) - 2)
    t = s / h - k
    chord_x, chord_y = x[k] + t * (x[k + 1] - x[k]), y[k] + t * (y[k + 1] - y[k])
    turned = angle[k + 1] - angle[k]
    direction = angle[k] + t * turned
    sagitta = -0.5 * turned * h * t * (1 - t)  # κ/2 · t(1 − t) h² off the chord
    return chord_x - sagitta * np.sin(direction), chord_y + sagitta * np.cos(direction), direction
