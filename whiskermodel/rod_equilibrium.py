"""Equilibria of a rod against a pole: Newton's method, continued from the grazing touch."""

import numpy as np

from whiskermodel.rod_shapes import force_per_push, pole_from_base, stress_free, to_s, to_u

_NEWTON_ITERATIONS = 8
_LARGEST_STEP = 0.3  # rad of push angle in one continuation step
_SMALLEST_STEP = 0.002  # rad; a continuation that needs less has met the end of equilibria


def solve_batch(whisker, inputs, curvature, guess_c, guess_force):
    """Contact arc length [m], force [N] and state, each (frames,).

    `inputs` are base_x, base_y, base_angle, pole_x, pole_y, pole_radius, side and friction,
    `guess_c` and `guess_force` start values, NaN for none, each (frames,); `curvature` is
    (frames, terms). All as in `rod.solve_contact`.
    """
    base_x, base_y, base_angle, pole_x, pole_y, pole_radius, side, friction = inputs
    dx, dy = pole_x - base_x, pole_y - base_y
    distance = np.hypot(dx, dy)
    c, grazing_angle = _grazing(whisker, distance, pole_radius, side, curvature)
    direction = np.arctan2(dy, dx) - base_angle
    # push angle: how far the base has turned into the pole since it grazed it
    turn = np.mod(side * (grazing_angle - direction) + np.pi, 2 * np.pi) - np.pi
    state = np.where(np.isnan(c), "unreachable", np.where(turn > 0, "slipped", "free"))
    state = state.astype("U11")
    u, push = to_u(whisker, np.where(np.isnan(c), 0.5 * whisker.length, c)), np.zeros(len(c))
    near = (state != "unreachable") & (np.abs(turn) < _LARGEST_STEP)
    rows = np.flatnonzero((state == "slipped") | near)
    problem = tuple(
        p[rows] for p in (distance, grazing_angle, turn, pole_radius, side, friction, curvature)
    )
    guess_u, guess_push = _guess_in_family(whisker, guess_c[rows], guess_force[rows])
    u[rows], push[rows], ok = _follow(whisker, problem, u[rows], guess_u, guess_push)
    c = to_s(whisker, u)
    solved = np.zeros(len(c), dtype=bool)
    solved[rows] = ok
    contact = solved & (push > 0) & (c <= whisker.length)
    state[solved & (push <= 0)] = "free"
    state[solved & (push > 0) & (c > whisker.length)] = "slipped"
    state[contact] = "contact"
    force = np.where(contact, push * force_per_push(whisker, c), 0.0)
    return np.where(contact, c, np.nan), force, state


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
    pole = pole_from_base(whisker, us, pushes, thrice)
    here, by_u, by_push = pole[:, :n], pole[:, n : 2 * n], pole[:, 2 * n :]
    return here - np.stack(problem[:2]), (by_u - here) / h, (by_push - here) / h


def _grazing(whisker, pole_distance, pole_radius, side, curvature):
    """Where the free whisker would touch a pole at this distance from the base.

    Returns the contact's arc length [m] (extrapolated beyond the tip along the cone, NaN where
    the pole is too near) and the direction of the pole from the base, against the base tangent;
    at one of 241 places, as equilibria are only followed from there.
    """
    n = len(pole_distance)
    end = min(whisker.cone_length * (1 - 1e-6), 1.3 * whisker.length)
    s = np.broadcast_to(np.linspace(0.0, end, 241), (n, 241))
    zero = np.zeros(n)
    x, y, angle = stress_free(whisker, zero, zero, zero, zero, curvature, s, end)
    reach = (side * (pole_radius + 0 * zero))[:, None] + side[:, None] * whisker.radius(s)
    px, py = x - reach * np.sin(angle), y + reach * np.cos(angle)
    distance = np.hypot(px, py)
    beyond = distance >= pole_distance[:, None]
    first = np.argmax(beyond, axis=1)
    first = np.where(beyond.any(axis=1), first, 240)
    here = np.arange(n), first
    return np.where(first == 0, np.nan, s[here]), np.arctan2(py[here], px[here])


def _guess_in_family(whisker, guess_c, guess_force):
    """Start values as (u, push), NaN where there is none or it is not on the whisker."""
    usable = np.isfinite(guess_c) & np.isfinite(guess_force)
    usable &= (guess_c > 0) & (guess_c <= whisker.length) & (guess_c < whisker.cone_length)
    c = np.where(usable, guess_c, 0.5 * whisker.length)
    u, push = to_u(whisker, c), guess_force / force_per_push(whisker, c)
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
