"""Large-angle rod: a whisker clamped at its base, bent by a round pole that touches its surface.

A planar, inextensible, unshearable rod with flexural rigidity B(s) = E I(s) and intrinsic
curvature κ0(s) obeys

    B(s) (θ' − κ0(s)) = M(s) = (r_c − r(s)) × F   for s ≤ c,      θ' = κ0(s) beyond,

with F the pole's force on the whisker at the contact c. Seen from the contact, where M = 0, the
loaded shapes are a family of two parameters (c, F). The base pose and the pole's centre, which
lies R + r(c) away along the whisker's normal, are two equations for them: Newton's method, with
continuation from the grazing touch. The shape is found by Picard's iteration on Chebyshev nodes,
spectrally accurate, for many frames at once.

Frame and signs are those of docs/conventions.md: metres, y up, counter-clockwise positive;
`side` = +1 where the pole lies on the side of the whisker's normal n̂ (to the left when looking
from follicle to tip), −1 on the other.
"""

from dataclasses import dataclass, fields
from functools import lru_cache

import numpy as np
from numpy.polynomial import chebyshev

from whiskermodel.whisker import Whisker

_NODES = 33  # Chebyshev nodes on the loaded part
_PICARD_ITERATIONS = 40
_NEWTON_ITERATIONS = 8
_LARGEST_STEP = 0.3  # rad of push angle in one continuation step
_SMALLEST_STEP = 0.002  # rad; a continuation that needs less has met the end of equilibria
_BATCH = 4096  # frames solved at once, to bound memory


@dataclass(frozen=True)
class RodContact:
    """Equilibria of one whisker against a round pole, one element per frame.

    All arrays are (frames,), SI units, signs as in docs/conventions.md.

    Attributes
    ----------
    state : str array
        "contact"; "free", where the whisker is clear of the pole on that side; "slipped", where
        the equilibrium would lie beyond the tip or does not exist any more; "unreachable", where
        the pole is too near to the base to be touched by the whisker's surface.
    contact_arc_length : [m], NaN without contact
    contact_force : magnitude of the force's component normal to the whisker [N], 0 without
    axial_force, lateral_force : force on the whisker along t̂0 and along t̂0 turned by +90° [N]
    base_moment : bending moment at the follicle [N m], positive bends counter-clockwise
    contact_x, contact_y, contact_angle : the centreline at the contact [m, m, rad], or NaN
    base_x, base_y, base_angle, pole_x, pole_y, pole_radius, side, friction : the problem
    intrinsic_curvature : (frames, terms), ascending polynomial coefficients [1/m, 1/m², …]
    """

    state: np.ndarray
    contact_arc_length: np.ndarray
    contact_force: np.ndarray
    axial_force: np.ndarray
    lateral_force: np.ndarray
    base_moment: np.ndarray
    contact_x: np.ndarray
    contact_y: np.ndarray
    contact_angle: np.ndarray
    base_x: np.ndarray
    base_y: np.ndarray
    base_angle: np.ndarray
    pole_x: np.ndarray
    pole_y: np.ndarray
    pole_radius: np.ndarray
    side: np.ndarray
    friction: np.ndarray
    intrinsic_curvature: np.ndarray

    @property
    def touching(self) -> np.ndarray:
        """Bool (frames,): the frames with a contact."""
        return self.state == "contact"

    def __len__(self):
        return len(self.state)


def free_shape(whisker, base_x, base_y, base_angle, arc_length, intrinsic_curvature=(0.0,)):
    """Shape of the untouched whisker.

    Parameters
    ----------
    whisker : Whisker
    base_x, base_y, base_angle : float or (frames,)
        Clamped base pose [m, m, rad].
    arc_length : (points,) or (frames, points)
        Where, from the follicle [m], 0 to the whisker's length.
    intrinsic_curvature : (terms,) or (frames, terms)
        κ0(s) = k0 + k1 s + …, coefficients [1/m, 1/m², …].

    Returns
    -------
    x, y, angle : (frames, points); (points,) where all base arguments are scalars
    """
    scalar = np.ndim(base_x) == np.ndim(base_y) == np.ndim(base_angle) == 0
    base_x, base_y, base_angle = _one_length(base_x=base_x, base_y=base_y, base_angle=base_angle)
    curvature = _curvature_rows(intrinsic_curvature, len(base_x))
    s = _arc_length_rows(whisker, arc_length, len(base_x))
    start = np.zeros(len(base_x))
    shape = _stress_free(whisker, start, base_x, base_y, base_angle, curvature, s)
    return tuple(part[0] for part in shape) if scalar and len(s) == 1 else shape


def solve_contact(
    whisker: Whisker,
    base_x,
    base_y,
    base_angle,
    pole_x,
    pole_y,
    pole_radius,
    side,
    intrinsic_curvature=(0.0,),
    friction=0.0,
    guess=None,
) -> RodContact:
    """Equilibrium of the clamped whisker against a round pole, for many frames at once.

    Parameters
    ----------
    whisker : Whisker
    base_x, base_y, base_angle : float or (frames,)
        Clamped base pose [m, m, rad].
    pole_x, pole_y, pole_radius : float or (frames,)
        The pole's centre and radius [m].
    side : +1, −1 or (frames,) of them
        +1: the pole lies to the left of the whisker, seen from follicle to tip.
    intrinsic_curvature : (terms,) or (frames, terms)
        κ0(s) = k0 + k1 s + …, coefficients [1/m, 1/m², …].
    friction : float or (frames,)
        Tangential over normal force at the contact, signed: µ where the friction pulls the
        whisker towards its tip (it slides back over the pole), −µ where towards its base.
    guess : RodContact or (contact_arc_length, contact_force), optional
        Start values, e.g. of the frames before; NaN where there is none. They save time only.

    Returns
    -------
    RodContact

    Raises
    ------
    ValueError
        Where an argument is not possible; it names the argument, its value and the rule.
    """
    inputs = _one_length(
        base_x=base_x,
        base_y=base_y,
        base_angle=base_angle,
        pole_x=pole_x,
        pole_y=pole_y,
        pole_radius=pole_radius,
        side=side,
        friction=friction,
    )
    _check_contact_arguments(pole_radius=inputs[5], side=inputs[6])
    n = len(inputs[0])
    curvature = _curvature_rows(intrinsic_curvature, n)
    start = _guess_rows(guess, n)
    if n == 0:
        return _assemble(whisker, inputs, curvature, *np.empty((2, 0)), np.empty(0, "U11"))
    parts = []
    for first in range(0, n, _BATCH):
        rows = slice(first, first + _BATCH)
        batch = tuple(a[rows] for a in inputs)
        solved = _solve_batch(whisker, batch, curvature[rows], *(g[rows] for g in start))
        parts.append(_assemble(whisker, batch, curvature[rows], *solved))
    names = [f.name for f in fields(RodContact)]
    return RodContact(*(np.concatenate([getattr(p, name) for p in parts]) for name in names))


def contact_shape(whisker: Whisker, contact: RodContact, arc_length):
    """Shape of the whisker in every frame of `contact`; of the free whisker where none touches.

    `arc_length` is (points,) or (frames, points) from the follicle [m], 0 to the whisker's
    length. Returns x, y [m] and angle [rad], each (frames, points).
    """
    n = len(contact)
    s = _arc_length_rows(whisker, arc_length, n)
    touching = contact.touching
    c = np.where(touching, contact.contact_arc_length, 0.0)
    start = (
        np.where(touching, contact.contact_x, contact.base_x),
        np.where(touching, contact.contact_y, contact.base_y),
        np.where(touching, contact.contact_angle, contact.base_angle),
    )
    shape = _stress_free(
        whisker, c, *start, contact.intrinsic_curvature, np.maximum(s, c[:, None])
    )
    rows = np.flatnonzero(touching)
    if len(rows):
        loaded = _loaded_shape(whisker, contact, rows, s[rows])
        before = s[rows] <= c[rows, None]
        for whole, part in zip(shape, loaded, strict=True):
            whole[rows] = np.where(before, part, whole[rows])
    return shape


# Arguments ---------------------------------------------------------------------------------


def _one_length(**arguments):
    """Broadcast the named arguments to float arrays of one length; refuse what is not finite."""
    arrays = {name: np.asarray(value, dtype=float) for name, value in arguments.items()}
    for name, array in arrays.items():
        if array.ndim > 1:
            raise ValueError(f"{name} must be a number or (frames,), got shape {array.shape}")
        if not np.all(np.isfinite(array)):
            raise ValueError(f"{name} must be finite, got {array[~np.isfinite(array)].flat[0]}")
    try:
        shape = np.broadcast_shapes((1,), *(a.shape for a in arrays.values()))
    except ValueError:
        shapes = ", ".join(f"{name} {a.shape}" for name, a in arrays.items())
        raise ValueError(f"arguments must be numbers or of one length, got {shapes}") from None
    return tuple(np.broadcast_to(a, shape).copy() for a in arrays.values())


def _check_contact_arguments(pole_radius, side):
    if np.any(pole_radius < 0):
        raise ValueError(f"pole_radius must be >= 0 m, got {pole_radius[pole_radius < 0][0]}")
    if not np.all(np.abs(side) == 1):
        raise ValueError(f"side must be +1 or -1, got {side[np.abs(side) != 1][0]}")


def _curvature_rows(intrinsic_curvature, n):
    """Coefficients (frames, terms) from (terms,) or (frames, terms)."""
    rows = np.atleast_2d(np.asarray(intrinsic_curvature, dtype=float))
    if rows.ndim != 2 or rows.shape[0] not in (1, n) or not np.all(np.isfinite(rows)):
        raise ValueError(
            f"intrinsic_curvature must be finite and (terms,) or (frames, terms) with {n} frames, "
            f"got shape {np.shape(intrinsic_curvature)}"
        )
    return np.broadcast_to(rows, (n, rows.shape[1]))


def _arc_length_rows(whisker, arc_length, n):
    """Arc lengths (frames, points) from (points,) or (frames, points)."""
    s = np.atleast_2d(np.asarray(arc_length, dtype=float))
    if s.ndim != 2 or (s.shape[0] not in (1, n) and n != 1):
        raise ValueError(
            f"arc_length must be (points,) or (frames, points) with {n} frames, "
            f"got shape {np.shape(arc_length)}"
        )
    slack = 1e-12 * whisker.length
    bad = ~((s >= -slack) & (s <= whisker.length + slack))
    if np.any(bad):
        raise ValueError(
            f"arc_length must be within 0 and the whisker's length {whisker.length} m, "
            f"got {s[bad].flat[0]}"
        )
    return np.broadcast_to(np.clip(s, 0.0, whisker.length), (max(n, s.shape[0]), s.shape[1]))


def _guess_rows(guess, n):
    """Start values (contact_arc_length, contact_force), each (frames,), NaN for none."""
    if guess is None:
        return np.full(n, np.nan), np.full(n, np.nan)
    if isinstance(guess, RodContact):
        guess = guess.contact_arc_length, guess.contact_force
    try:
        return tuple(np.broadcast_to(np.asarray(g, dtype=float), (n,)) for g in guess)
    except ValueError:
        raise ValueError(f"guess must be a RodContact or two arrays of {n} frames") from None


# The two-parameter family of loaded shapes, seen from the contact ----------------------------


@lru_cache
def _panel(nodes):
    """Chebyshev nodes on [0, 1], their ∫₀ᶻ matrix, and the matrix to Chebyshev coefficients."""
    z = (1 - np.cos(np.pi * np.arange(nodes) / (nodes - 1))) / 2
    z = (z + 1 - z[::-1]) / 2  # symmetric to the last bit
    to_coefficients = np.linalg.inv(chebyshev.chebvander(2 * z - 1, nodes - 1))
    integrals = chebyshev.chebint(to_coefficients, lbnd=-1, scl=0.5, axis=0)
    return z, chebyshev.chebvander(2 * z - 1, nodes) @ integrals, to_coefficients


def _stretch(whisker):
    """Length [m] of the map s = a (1 − e⁻ᵘ), which grades the nodes towards a cone's apex.

    With a = cone_length every u is a place on the cone, however long Newton's steps.
    """
    return min(whisker.cone_length, 10 * whisker.length)


def _to_u(whisker, s):
    return -np.log1p(-s / _stretch(whisker))


def _to_s(whisker, u):
    return -_stretch(whisker) * np.expm1(-u)


def _polynomial(coefficients, s):
    """Value of the ascending polynomials (frames, terms) at `s` (frames, points)."""
    value = np.zeros_like(s)
    for k in coefficients.T[::-1]:
        value = value * s + k[:, None]
    return value


def _force_per_push(whisker, c):
    """Force [N] that turns a straight whisker by 1 rad at small angles: F/θ of Eq. 17's slope."""
    return 3 * whisker.base_flexural_rigidity * (1 - c / whisker.cone_length) / c**2


def _contact_frame(whisker, u_c, push, side, friction, curvature):
    """Loaded shape in the frame of the contact: origin r_c, x along the tangent there.

    `u_c` and `push` (frames,) stand for contact arc length and force.
    Returns s, x, y, angle, each (frames, nodes) from base to contact, and the force (fx, fy).
    """
    z, integral, _ = _panel(_NODES)
    back = (integral - integral[-1]).T  # ∫ from the contact (z = 1) back to z, as f @ back
    s = _to_s(whisker, u_c[:, None] * z)
    jacobian = u_c[:, None] * (_stretch(whisker) - s)  # ds/dz
    rest = _polynomial(curvature, s)
    stiffness = whisker.base_flexural_rigidity * (1 - s / whisker.cone_length) ** 4
    normal_force = push * _force_per_push(whisker, s[:, -1])
    fx, fy = friction * normal_force, -side * normal_force
    angle = (jacobian * rest) @ back
    for _ in range(_PICARD_ITERATIONS):
        x, y = (jacobian * np.cos(angle)) @ back, (jacobian * np.sin(angle)) @ back
        moment = y * fx[:, None] - x * fy[:, None]  # (r_c − r) × F with r_c = 0
        new = (jacobian * (rest + moment / stiffness)) @ back
        change = np.abs(new - angle).max(initial=0.0)
        angle = new
        if not change > 1e-14:
            break
    return s, x, y, angle, (fx, fy)


def _pole_from_base(whisker, u_c, push, problem):
    """Pole's centre in the frame of the base, (2, frames), for contact u_c and force `push`."""
    _, _, pole_radius, side, friction, curvature = problem
    s, x, y, angle, _ = _contact_frame(whisker, u_c, push, side, friction, curvature)
    surface = whisker.base_radius * (1 - s[:, -1] / whisker.cone_length)
    dx, dy = -x[:, 0], side * (pole_radius + surface) - y[:, 0]
    cos, sin = np.cos(angle[:, 0]), np.sin(angle[:, 0])
    return np.stack([cos * dx + sin * dy, cos * dy - sin * dx])


# Newton and continuation -----------------------------------------------------------------


def _newton(whisker, problem, u, push):
    """Solve for (u, push) from a start; returns them and whether each frame converged.

    `problem` is (target_x, target_y, pole_radius, side, friction, curvature): the pole's centre
    in the base's frame and what the family of shapes depends on. A root is taken only on the
    stable side of the fold where the whisker snaps past the pole (there the determinant is 0).
    """
    u, push = u.copy(), push.copy()
    done = np.zeros(len(u), dtype=bool)
    rows, last = np.arange(len(u)), np.full(len(u), np.inf)
    for _ in range(_NEWTON_ITERATIONS):
        part = tuple(p[rows] for p in problem)
        (ex, ey), (a, c), (b, d) = _residual_and_slopes(whisker, u[rows], push[rows], part)
        with np.errstate(all="ignore"):
            det = a * d - b * c
            du, dpush = (b * ey - d * ex) / det, (c * ex - a * ey) / det
            size = np.hypot(ex, ey) / np.hypot(part[0], part[1])
        finite = np.isfinite(du) & np.isfinite(dpush)
        u[rows] = np.maximum(u[rows] + np.clip(np.where(finite, du, 0.0), -0.3, 0.3), 1e-3)
        push[rows] += np.clip(np.where(finite, dpush, 0.0), -0.5, 0.5)
        # the step just made leaves less than 1e-6 of an error that is already below 1e-7
        end = finite & (size < 1e-7) & (np.abs(dpush) < 1e-6)
        done[rows[end & (part[3] * det < 0)]] = True
        # what does not come nearer is past the fold, where there is nothing to find
        going = finite & ~end & (size < 0.7 * last)
        rows, last = rows[going], size[going]
        if len(rows) == 0:
            break
    return u, push, done


def _residual_and_slopes(whisker, u, push, problem):
    """Misfit of the pole's centre and its derivatives by u and push, each (2, frames)."""
    h, n = 1e-6, len(u)
    thrice = tuple(np.concatenate([p, p, p]) for p in problem)
    us, pushes = np.concatenate([u, u + h, u]), np.concatenate([push, push, push + h])
    pole = _pole_from_base(whisker, us, pushes, thrice)
    here, by_u, by_push = pole[:, :n], pole[:, n : 2 * n], pole[:, 2 * n :]
    return here - np.stack(problem[:2]), (by_u - here) / h, (by_push - here) / h


def _grazing(whisker, pole_distance, pole_radius, side, curvature):
    """Where the free whisker would touch a pole at this distance from the base.

    Returns the contact's arc length [m] (extrapolated beyond the tip along the cone, NaN where
    the pole is too near) and the direction of the pole from the base, against the base tangent.
    """
    n = len(pole_distance)
    end = min(whisker.cone_length * (1 - 1e-6), 1.3 * whisker.length)
    s = np.broadcast_to(np.linspace(0.0, end, 241), (n, 241))
    zero = np.zeros(n)
    x, y, angle = _stress_free(whisker, zero, zero, zero, zero, curvature, s, end)
    reach = (side * (pole_radius + 0 * zero))[:, None] + side[:, None] * whisker.radius(s)
    px, py = x - reach * np.sin(angle), y + reach * np.cos(angle)
    distance = np.hypot(px, py)
    beyond = distance >= pole_distance[:, None]
    first = np.argmax(beyond, axis=1)
    first = np.where(beyond.any(axis=1), first, 240)
    i, j = np.arange(n), np.maximum(first - 1, 0)
    with np.errstate(all="ignore"):
        f = (pole_distance - distance[i, j]) / (distance[i, first] - distance[i, j])
    f = np.where(beyond.any(axis=1), np.clip(f, 0, 1), 1.0)
    mix = lambda a: a[i, j] + f * (a[i, first] - a[i, j])  # noqa: E731
    return np.where(first == 0, np.nan, mix(s)), np.arctan2(mix(py), mix(px))


def _solve_batch(whisker, inputs, curvature, guess_c, guess_force):
    """Contact arc length, force and state, each (frames,)."""
    base_x, base_y, base_angle, pole_x, pole_y, pole_radius, side, friction = inputs
    dx, dy = pole_x - base_x, pole_y - base_y
    distance = np.hypot(dx, dy)
    c, grazing_angle = _grazing(whisker, distance, pole_radius, side, curvature)
    direction = np.arctan2(dy, dx) - base_angle
    # push angle: how far the base has turned into the pole since it grazed it
    turn = np.mod(side * (grazing_angle - direction) + np.pi, 2 * np.pi) - np.pi
    state = np.where(np.isnan(c), "unreachable", np.where(turn > 0, "slipped", "free"))
    state = state.astype("U11")
    u, push = _to_u(whisker, np.where(np.isnan(c), 0.5 * whisker.length, c)), np.zeros(len(c))
    near = (state != "unreachable") & (np.abs(turn) < _LARGEST_STEP)
    rows = np.flatnonzero((state == "slipped") | near)
    problem = tuple(
        p[rows] for p in (distance, grazing_angle, turn, pole_radius, side, friction, curvature)
    )
    guess_u, guess_push = _guess_in_family(whisker, guess_c[rows], guess_force[rows])
    u[rows], push[rows], ok = _follow(whisker, problem, u[rows], guess_u, guess_push)
    c = _to_s(whisker, u)
    solved = np.zeros(len(c), dtype=bool)
    solved[rows] = ok
    contact = solved & (push > 0) & (c <= whisker.length)
    state[solved & (push <= 0)] = "free"
    state[solved & (push > 0) & (c > whisker.length)] = "slipped"
    state[contact] = "contact"
    force = np.where(contact, push * _force_per_push(whisker, c), 0.0)
    return np.where(contact, c, np.nan), force, state


def _guess_in_family(whisker, guess_c, guess_force):
    """Start values as (u, push), NaN where there is none or it is not on the whisker."""
    usable = np.isfinite(guess_c) & np.isfinite(guess_force)
    usable &= (guess_c > 0) & (guess_c <= whisker.length) & (guess_c < whisker.cone_length)
    c = np.where(usable, guess_c, 0.5 * whisker.length)
    u, push = _to_u(whisker, c), guess_force / _force_per_push(whisker, c)
    return np.where(usable, u, np.nan), np.where(usable, push, np.nan)


def _target(problem, fraction):
    """Newton's problem with the base turned by `fraction` of the way from graze to pose."""
    distance, grazing_angle, turn, pole_radius, side, friction, curvature = problem
    direction = grazing_angle - side * fraction * turn
    place = distance * np.cos(direction), distance * np.sin(direction)
    return (*place, pole_radius, side, friction, curvature)


def _follow(whisker, problem, u, guess_u, guess_push):
    """Turn the base from the grazing touch to its pose, equilibrium by equilibrium.

    Returns u, push and whether the whole way was gone, each (frames,).
    """
    turn, n = problem[2], len(u)
    push, fraction, ok = np.zeros(n), np.zeros(n), np.zeros(n, dtype=bool)
    rows = np.flatnonzero(np.isfinite(guess_u))
    if len(rows):
        end = _target(tuple(p[rows] for p in problem), 1.0)
        gu, gpush, ok[rows] = _newton(whisker, end, guess_u[rows], guess_push[rows])
        ok[rows] &= np.sign(gpush) == np.sign(turn[rows])
        u[rows], push[rows] = np.where(ok[rows], [gu, gpush], [u[rows], push[rows]])
    step = np.minimum(1.0, _LARGEST_STEP / np.maximum(np.abs(turn), 1e-12))
    rate = np.stack([np.zeros(n), turn])  # d(u, push)/d(fraction)
    while True:
        rows = np.flatnonzero(~ok & (step * np.abs(turn) > _SMALLEST_STEP * (step < 1)))
        if len(rows) == 0:
            return u, push, ok
        reach = np.minimum(fraction[rows] + step[rows], 1.0)
        ahead = reach - fraction[rows]
        part = _target(tuple(p[rows] for p in problem), reach)
        start = np.stack([u[rows], push[rows]]) + ahead * rate[:, rows]
        new_u, new_push, good = _newton(whisker, part, np.maximum(start[0], 1e-3), start[1])
        moved = np.stack([new_u - u[rows], new_push - push[rows]])
        # a jump to another branch is no continuation
        good &= np.abs(moved[1]) < 3 * np.abs(ahead * turn[rows]) + 0.2
        took = rows[good]
        rate[:, took] = moved[:, good] / ahead[good]
        u[took], push[took], fraction[took] = new_u[good], new_push[good], reach[good]
        ok[took] = reach[good] >= 1
        step[rows] = np.where(good, step[rows] * 1.5, step[rows] * 0.4)
        step = np.where(step * np.abs(turn) > _LARGEST_STEP, _LARGEST_STEP / np.abs(turn), step)


# Results ---------------------------------------------------------------------------------


def _assemble(whisker, inputs, curvature, c, force, state):
    """Forces, moment and place of the contact in the lab, as a RodContact."""
    base_x, base_y, base_angle, _, _, _, side, friction = inputs
    n = len(state)
    rows = np.flatnonzero(state == "contact")
    axial, lateral, moment = np.zeros((3, n))
    place = np.full((3, n), np.nan)
    if len(rows):
        u, push = _to_u(whisker, c[rows]), force[rows] / _force_per_push(whisker, c[rows])
        _, x, y, angle, (fx, fy) = _contact_frame(
            whisker, u, push, side[rows], friction[rows], curvature[rows]
        )
        x0, y0, angle0 = x[:, 0], y[:, 0], angle[:, 0]
        axial[rows] = fx * np.cos(angle0) + fy * np.sin(angle0)
        lateral[rows] = fy * np.cos(angle0) - fx * np.sin(angle0)
        moment[rows] = y0 * fx - x0 * fy
        turn = base_angle[rows] - angle0
        cos, sin = np.cos(turn), np.sin(turn)
        place[0, rows] = base_x[rows] - (cos * x0 - sin * y0)
        place[1, rows] = base_y[rows] - (sin * x0 + cos * y0)
        place[2, rows] = turn
    return RodContact(state, c, force, axial, lateral, moment, *place, *inputs, curvature)


def _loaded_shape(whisker, contact, rows, s):
    """x, y, angle in the lab at `s` (rows, points), meant for s ≤ c, of frames that touch."""
    c = contact.contact_arc_length[rows]
    u_c = _to_u(whisker, c)
    push = contact.contact_force[rows] / _force_per_push(whisker, c)
    _, x, y, angle, _ = _contact_frame(
        whisker,
        u_c,
        push,
        contact.side[rows],
        contact.friction[rows],
        contact.intrinsic_curvature[rows],
    )
    z = np.clip(_to_u(whisker, s) / u_c[:, None], 0.0, 1.0)
    x, y, angle = (_interpolate(values, z) for values in (x, y, angle))
    turn = contact.contact_angle[rows][:, None]
    cos, sin = np.cos(turn), np.sin(turn)
    x, y = (
        contact.contact_x[rows][:, None] + cos * x - sin * y,
        contact.contact_y[rows][:, None] + sin * x + cos * y,
    )
    return x, y, angle + turn


def _interpolate(values, z):
    """Value at `z` (rows, points) of the functions known at the panel's nodes (rows, nodes)."""
    _, _, to_coefficients = _panel(values.shape[1])
    coefficients = (values @ to_coefficients.T).T[:, :, None]
    return chebyshev.chebval(2 * z - 1, coefficients, tensor=False)


def _stress_free(whisker, start, x, y, angle, curvature, s, end=None):
    """Shape beyond arc length `start` (frames,), where x, y, angle are known, at s ≥ start."""
    end = whisker.length if end is None else end
    z, integral, _ = _panel(_NODES)
    span = np.maximum(end - start, 1e-9 * end)[:, None]
    nodes = start[:, None] + span * z
    antiderivative = curvature / np.arange(1, curvature.shape[1] + 1)

    def angle_at(s):
        turned = _polynomial(antiderivative, s) * s
        return (
            angle[:, None]
            + turned
            - (_polynomial(antiderivative, start[:, None]) * start[:, None])
        )

    along = angle_at(nodes)
    px, py = span * np.cos(along) @ integral.T, span * np.sin(along) @ integral.T
    at = np.clip((s - start[:, None]) / span, 0.0, 1.0)
    return x[:, None] + _interpolate(px, at), y[:, None] + _interpolate(py, at), angle_at(s)
