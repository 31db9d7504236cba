"""Dynamic response of a whisker to a contact force (Hires et al. 2013, Eqs 5–9 and 45–59).

y(x, t) = F(t) ỹ_s(x; c) + Σ_k η_k(t) φ_k(x/L): a steady part that follows the force at once, and a
vibrational part, η_k = −P_k I_k, kept apart throughout. See `modal_filter` for I_k.

Signs are the paper's: F > 0 pushes towards −y, so that the steady base moment is −c F.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import roots_legendre

from whiskermodel.checks import finite_array, on_whisker, one_of, positive, whole_number
from whiskermodel.modal_filter import modal_filters
from whiskermodel.modes import follicle_stiffness, modes
from whiskermodel.statics import FRAMES, steady_base_angle, steady_shape

_CHUNK = 1 << 18  # samples filtered at once, to stay in the cache


@dataclass(frozen=True)
class BaseLoads:
    """What the follicle feels: steady and vibrational parts, each (*forces, time).

    Attributes
    ----------
    time : (time,) [s] from the force's first sample
    force : F(t) at those times [N]
    steady_moment, vibrational_moment : E I y''(0) [N m] (Eq. 55)
    steady_shear, vibrational_shear : the shear force (E I y'')' at the base [N]; steady part F
    steady_paper_shear, vibrational_paper_shear : the paper's E I0 y'''(0) [N] (Eq. 56), which in
        a tapering whisker is not the shear force; steady part (1 − 4c/L_in) F
    steady_angle, vibrational_angle : y'(0) [rad] (Eq. 58)
    """

    time: np.ndarray
    force: np.ndarray
    steady_moment: np.ndarray
    vibrational_moment: np.ndarray
    steady_shear: np.ndarray
    vibrational_shear: np.ndarray
    steady_paper_shear: np.ndarray
    vibrational_paper_shear: np.ndarray
    steady_angle: np.ndarray
    vibrational_angle: np.ndarray

    @property
    def moment(self):
        """Whole base moment [N m]."""
        return self.steady_moment + self.vibrational_moment

    @property
    def shear(self):
        """Whole base shear force [N]."""
        return self.steady_shear + self.vibrational_shear

    @property
    def angle(self):
        """Whole base angle [rad]."""
        return self.steady_angle + self.vibrational_angle

    def vibration_extremes(self):
        """Largest and smallest vibrational moment over the peak |steady| moment, (2, *forces)."""
        peak = np.abs(self.steady_moment).max(axis=-1)
        vibration = self.vibrational_moment
        return np.stack([vibration.max(axis=-1), vibration.min(axis=-1)]) / peak


@dataclass(frozen=True)
class Displacement:
    """y(x, t) [m]: steady and vibrational parts, each (*forces, points, time)."""

    time: np.ndarray
    steady: np.ndarray
    vibrational: np.ndarray

    @property
    def total(self):
        """Steady plus vibrational [m]."""
        return self.steady + self.vibrational


class Response:
    """A whisker held in its follicle, ready to respond to forces.

    Parameters
    ----------
    whisker : Whisker
    boundary : "fixed", "pinned" or float
        The follicle; a number is its torsional stiffness k_θ [N m/rad].
    frame : "chord" or "clamped"
        What the base does while the force acts. "chord", the paper's: the follicle turns with
        the steady shape, against a pole that stands still. "clamped": the follicle (the outer
        end of its spring, where it is compliant) stands still in the lab and the whisker is
        pushed. Their vibrations differ manifold where the force changes fast.
    n_modes : int
        Modes summed. The pinned end's rigid rotation counts as one.
    basis : "complete", "paper" or "exact"
        See `whiskermodel.modes`.

    Attributes
    ----------
    modes : Modes
    angular_frequency : (n_modes,) undamped p_k [rad/s]

    Raises
    ------
    ValueError
        Names the argument, its value and what is allowed.

    Examples
    --------
    >>> import numpy as np
    >>> from whiskermodel import Response, half_gaussian, mouse_c2
    >>> time = np.arange(0, 60e-3, 1e-5)
    >>> force = half_gaussian(time, duration=12e-3, peak_force=10e-6)
    >>> loads = Response(mouse_c2()).base_loads(9e-3, force, dt=1e-5)
    >>> loads.vibration_extremes().round(2)
    array([ 0.08, -0.08])
    """

    def __init__(
        self, whisker, boundary="fixed", frame="chord", n_modes=10, basis="complete", n_terms=None
    ):
        self.whisker = whisker
        self.frame = one_of("frame", frame, FRAMES)
        kappa = follicle_stiffness(boundary, whisker)
        if frame == "clamped" and kappa == 0:
            raise ValueError(
                "frame 'clamped' needs a follicle that holds the whisker: boundary 'fixed' or a "
                f"torsional stiffness > 0, got {boundary!r}"
            )
        self.modes = modes(whisker.taper, kappa, n_modes, basis, n_terms)
        self.angular_frequency = self.modes.angular_frequency(whisker)

    @property
    def longest_period(self) -> float:
        """Period of the slowest mode [s]: of free ringing, no later swing is as large."""
        return 2 * np.pi / float(self.angular_frequency[self.angular_frequency > 0].min())

    # Statics of the frame --------------------------------------------------------------------

    def steady_angle_per_newton(self, contact_arc_length):
        """ỹ_s'(0) in this frame [rad/N], of the shape of c [m]."""
        c = on_whisker(self.whisker, contact_arc_length)
        if self.frame == "chord":
            return steady_base_angle(self.whisker, c)
        rigidity = self.whisker.base_flexural_rigidity
        return -c * self.whisker.length / (self.modes.follicle_stiffness * rigidity)

    def steady_shape(self, contact_arc_length, arc_length):
        """ỹ_s(x; c) in this frame [m/N], c and x broadcast."""
        shape = steady_shape(self.whisker, contact_arc_length, arc_length, frame="clamped")
        return shape + self.steady_angle_per_newton(contact_arc_length) * np.asarray(arc_length)

    def participation(self, contact_arc_length):
        """P_k(c) [m/N], (n_modes, *c.shape) (Eq. 54).

        The integral needs no quadrature where the modes obey their equation: integrating
        ∫φ (1−λx)² ỹ_s dx by parts twice leaves values of φ at the base and at the contact.
        """
        c = on_whisker(self.whisker, contact_arc_length)
        if self.modes.basis == "paper":  # Ritz modes obey theirs only on average
            return self.participation_by_quadrature(c)
        whisker, p = self.whisker, self.modes.p_prime.reshape(-1, *[1] * c.ndim)
        x = c / whisker.length
        rigid = p == 0
        bent, turned = (self.modes.at_base(d).reshape(p.shape) for d in (2, 1))
        unit = whisker.length**3 / whisker.base_flexural_rigidity
        work = bent * self.steady_angle_per_newton(c) * whisker.length
        work = work - unit * (self.modes.shape(x) - x * turned)
        out = work / np.where(rigid, 1.0, p**2)
        if rigid.any():
            out[rigid.ravel()] = self.participation_by_quadrature(c)[rigid.ravel()]
        return out

    def participation_by_quadrature(self, c):
        """P_k(c) by Eq. 54 as it stands, whatever equation the modes obey; c [m] an array."""
        length, flat = self.whisker.length, c.ravel() / self.whisker.length
        out = np.empty((len(self.modes.p_prime), flat.size))
        for i, x_c in enumerate(flat):
            x, w = quadrature_about(x_c, 240)
            static = self.steady_shape(x_c * length, x * length)
            out[:, i] = self.modes.shape(x) @ (w * (1 - self.modes.taper * x) ** 2 * static)
        return out.reshape(-1, *c.shape)

    # Response to sampled forces --------------------------------------------------------------

    def amplitudes(self, contact_arc_length, force, dt):
        """η_k(t) [m], (n_modes, *forces, time); arguments as in `base_loads`."""
        c, force, dt = self._checked(contact_arc_length, force, dt)
        integrals = self.integrals(force, dt)
        return -self.participation(c).reshape(-1, *c.shape, 1) * integrals

    def amplitude_rates(self, contact_arc_length, force, dt):
        """dη_k/dt [m/s], shaped as `amplitudes`; at a kink of the force, that just after it."""
        c, force, dt = self._checked(contact_arc_length, force, dt)
        slope = np.diff(force, axis=-1, append=force[..., -1:]) / dt
        rates = slope - self.followed_rates(force, dt)
        return -self.participation(c).reshape(-1, *c.shape, 1) * rates

    def displacement(self, contact_arc_length, force, dt, arc_length):
        """y(x, t) at `arc_length` (points,) [m] (Eq. 9); other arguments as in `base_loads`.

        Returns
        -------
        Displacement
        """
        c, force, dt = self._checked(contact_arc_length, force, dt)
        x = finite_array("arc_length", arc_length)
        static = self.steady_shape(c[..., None], x)
        phi = self.modes.shape(x / self.whisker.length)
        eta = self.amplitudes(c, force, dt)
        vibrational = np.einsum("kx,k...t->...xt", phi, eta)
        time = np.arange(force.shape[-1]) * dt
        return Displacement(time, static[..., None] * force[..., None, :], vibrational)

    def base_loads(self, contact_arc_length, force, dt, substeps=1):
        """Moment, shear and angle at the base, for one force or many at once.

        Parameters
        ----------
        contact_arc_length : float or array
            c [m], one for all forces or one for each.
        force : (*forces, time) array
            F(t) [N], taken as linear between samples and zero before the first; a first sample
            that is not zero is a step there. Any sampling step: the result at the samples is
            exact for that force.
        dt : float
            Sampling step [s].
        substeps : int
            Results per sample. A force sampled at 1 kHz is slower than the vibration it sets
            off; ``substeps=20`` gives the loads every 50 µs.

        Returns
        -------
        BaseLoads

        Raises
        ------
        ValueError
            Where c is off the whisker, the force is not finite or dt is not positive.
        """
        c, force, dt = self._checked(contact_arc_length, force, dt)
        substeps = whole_number("substeps", substeps, 1)
        if substeps > 1:
            force, dt = _refined(force, substeps), dt / substeps
        vibrational = self._sum_modes(self._base_weights(c), force, dt)
        lever = c[..., None]
        paper = 1 - 4 * lever / self.whisker.cone_length
        angle = self.steady_angle_per_newton(c)[..., None]
        steady = (-lever * force, force.copy(), paper * force, angle * force)
        parts = [part for pair in zip(steady, vibrational, strict=True) for part in pair]
        return BaseLoads(np.arange(force.shape[-1]) * dt, force, *parts)

    def _checked(self, contact_arc_length, force, dt):
        """c and force broadcast to (*forces,) and (*forces, time), and dt."""
        c = on_whisker(self.whisker, contact_arc_length)
        force = finite_array("force", force)
        if force.ndim == 0 or force.shape[-1] < 1:
            raise ValueError(
                f"force must have at least one sample along its last axis, got {force.shape}"
            )
        try:
            shape = np.broadcast_shapes(c.shape, force.shape[:-1])
        except ValueError:
            raise ValueError(
                f"contact_arc_length must be one number or one per force, got shape {c.shape} "
                f"with force of shape {force.shape}"
            ) from None
        dt = float(positive("dt", dt))
        return np.broadcast_to(c, shape), np.broadcast_to(force, (*shape, force.shape[-1])), dt

    def integrals(self, force, dt):
        """I_k(t) [N], (n_modes, *forces, time); `force` (*forces, time) [N], `dt` [s]."""
        filters = modal_filters(self.angular_frequency, self.whisker.damping_rate, dt)
        # a rigid rotation has no stiffness and follows: I = F
        return np.stack([force if f is None else force - f(force) for f in filters])

    def followed_rates(self, force, dt):
        """dq_k/dt [N/s], the rate of what I_k lacks of the force; shapes as in `integrals`."""
        filters = modal_filters(self.angular_frequency, self.whisker.damping_rate, dt)
        return np.stack(
            [
                np.zeros_like(force) if f is None else p * f(force, state=1)
                for f, p in zip(filters, self.angular_frequency, strict=True)
            ]
        )

    def _base_weights(self, c):
        """What −I_k adds to moment, shear, paper's shear and angle, (4, n_modes, *c.shape)."""
        whisker, participation = self.whisker, self.participation(c)
        turned, bent, third = (self.modes.at_base(d).reshape(-1, *[1] * c.ndim) for d in (1, 2, 3))
        if self.modes.follicle_stiffness == 0:
            bent = np.zeros_like(bent)  # free of the moment by definition, not to rounding
        if np.isinf(self.modes.follicle_stiffness):
            turned = np.zeros_like(turned)
        rigidity, length = whisker.base_flexural_rigidity, whisker.length
        moment = rigidity / length**2 * bent
        paper_shear = rigidity / length**3 * third
        shear = paper_shear - 4 / whisker.cone_length * moment
        return np.stack([moment, shear, paper_shear, turned / length]) * participation

    def base_moment_weights(self, contact_arc_length):
        """What −I_k adds to the base moment, (n_modes, *c.shape) [N m/N] (Eq. 55)."""
        return self._base_weights(on_whisker(self.whisker, contact_arc_length))[0]

    def _sum_modes(self, weights, force, dt):
        """−Σ_k weights_k I_k, (4, *forces, time), a cache-sized batch of forces at a time."""
        filters = modal_filters(self.angular_frequency, self.whisker.damping_rate, dt)
        n = force.shape[-1]
        flat = force.reshape(-1, n)
        weights = weights.reshape(4, len(filters), -1)
        out = np.empty((4, *flat.shape))
        for start in range(0, len(flat), max(1, _CHUNK // n)):
            rows = slice(start, start + max(1, _CHUNK // n))
            batch, w = np.ascontiguousarray(flat[rows]), weights[..., rows]
            out[:, rows] = -w.sum(axis=1)[..., None] * batch
            for k, f in enumerate(filters):
                if f is not None:
                    _add_mode(out[:, rows], w[:, k], f(batch))
        return out.reshape(4, *force.shape)


def base_loads(whisker, contact_arc_length, force, dt, substeps=1, **options):
    """`Response(whisker, **options).base_loads(contact_arc_length, force, dt, substeps)`."""
    return Response(whisker, **options).base_loads(contact_arc_length, force, dt, substeps)


def quadrature_about(share, points):
    """Nodes and weights of ∫₀¹ dx by Gauss on either side of x = `share`, each (2 points,)."""
    nodes, weights = roots_legendre(points)
    x = np.concatenate([share * (nodes + 1) / 2, share + (1 - share) * (nodes + 1) / 2])
    return np.minimum(x, 1.0), np.concatenate([share * weights / 2, (1 - share) * weights / 2])


def _add_mode(sums, weights, integral):
    """Add I_k of a mode (forces, time), times its weights (4, forces), to (4, forces, time)."""
    for target, weight in zip(sums, weights, strict=True):
        if weight.any():
            target += weight[:, None] * integral


def _refined(force, substeps):
    """The same force, linear between samples, at `substeps` times as many points."""
    n = force.shape[-1]
    share = np.arange(substeps) / substeps
    between = force[..., :-1, None] + np.diff(force, axis=-1)[..., None] * share
    between = between.reshape(*force.shape[:-1], (n - 1) * substeps)
    return np.concatenate([between, force[..., -1:]], axis=-1)
