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

import numpy as np

from whiskermodel.rod_equilibrium import solve_batch
from whiskermodel.rod_shapes import contact_frame, force_per_push, interpolate, stress_free, to_u
from whiskermodel.whisker import Whisker

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

    def take(self, frames) -> "RodContact":
        """The same of some `frames`: a slice, or their numbers."""
        return RodContact(*(getattr(self, field.name)[frames] for field in fields(self)))

    @staticmethod
    def joined(parts) -> "RodContact":
        """Several, one behind the other."""
        names = [field.name for field in fields(RodContact)]
        return RodContact(*(np.concatenate([getattr(p, name) for p in parts]) for name in names))


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
    shape = stress_free(whisker, start, base_x, base_y, base_angle, curvature, s)
    return tuple(part[0] for part in shape) if scalar and len(s) == 1 else shape


def solve_contact(
    whisker: Whisker, base, pole, side, intrinsic_curvature=(0.0,), friction=0.0, guess=None
) -> RodContact:
    """Equilibrium of the clamped whisker against a round pole, for many frames at once.

    Parameters
    ----------
    whisker : Whisker
    base : (x, y, angle), each a float or (frames,)
        Clamped base pose [m, m, rad].
    pole : (x, y, radius), each a float or (frames,)
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
    base_x, base_y, base_angle = base
    pole_x, pole_y, pole_radius = pole
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
        solved = solve_batch(whisker, batch, curvature[rows], *(g[rows] for g in start))
        parts.append(_assemble(whisker, batch, curvature[rows], *solved))
    return RodContact.joined(parts)


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
    shape = stress_free(whisker, c, *start, contact.intrinsic_curvature, np.maximum(s, c[:, None]))
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


# Results ---------------------------------------------------------------------------------


def _assemble(whisker, inputs, curvature, c, force, state):
    """Forces, moment and place of the contact in the lab, as a RodContact."""
    base_x, base_y, base_angle, _, _, _, side, friction = inputs
    n = len(state)
    rows = np.flatnonzero(state == "contact")
    axial, lateral, moment = np.zeros((3, n))
    place = np.full((3, n), np.nan)
    if len(rows):
        u, push = to_u(whisker, c[rows]), force[rows] / force_per_push(whisker, c[rows])
        _, x, y, angle, (fx, fy) = contact_frame(
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
    u_c = to_u(whisker, c)
    push = contact.contact_force[rows] / force_per_push(whisker, c)
    _, x, y, angle, _ = contact_frame(
        whisker,
        u_c,
        push,
        contact.side[rows],
        contact.friction[rows],
        contact.intrinsic_curvature[rows],
    )
    z = np.clip(to_u(whisker, s) / u_c[:, None], 0.0, 1.0)
    x, y, angle = (interpolate(values, z) for values in (x, y, angle))
    turn = contact.contact_angle[rows][:, None]
    cos, sin = np.cos(turn), np.sin(turn)
    x, y = (
        contact.contact_x[rows][:, None] + cos * x - sin * y,
        contact.contact_y[rows][:, None] + sin * x + cos * y,
    )
    return x, y, angle + turn
