"""Beyond the paper: a contact in which the pole really holds the whisker where it touches.

In the paper the free whisker's modes ring throughout, so that during the contact the whisker moves
at c as if the pole were not there ("for our model to be self-consistent, a vibrational node must
be imposed at the point of force application"). Here the modes of the contact are those of the
whisker supported at c, φ(c) = 0; when the force ends, the pole lets go, and displacement and
velocity are carried over into the free modes. The steady part, the force F(t) that the follicle's
turning would cause quasi-statically, and the signs are those of `response`.
"""

from dataclasses import dataclass

import numpy as np

from whiskermodel.checks import finite_array, on_whisker, positive
from whiskermodel.modal_filter import free_motion
from whiskermodel.modes import supported_modes
from whiskermodel.response import Displacement, Response, quadrature_about

SIDES = ("left", "right")


@dataclass(frozen=True)
class SupportedContact:
    """Loads of one contact, each (time,).

    Attributes
    ----------
    time : [s]
    force : the quasi-static contact force F(t) [N]
    pole_force : the force the pole really exerts, vibration included [N]; 0 after the release.
        Where it is negative the pole would have to pull: the whisker would lift off earlier.
    steady_moment, vibrational_moment : at the base [N m]
    release : index of the first sample after the contact; len(time) if it does not end
    """

    time: np.ndarray
    force: np.ndarray
    pole_force: np.ndarray
    steady_moment: np.ndarray
    vibrational_moment: np.ndarray
    release: int

    @property
    def moment(self):
        """Whole base moment [N m]."""
        return self.steady_moment + self.vibrational_moment


class SupportedResponse:
    """A whisker against a pole at c: held there while the force lasts, free afterwards.

    Parameters are those of `Response`; c is fixed here because the modes depend on it.

    Raises
    ------
    ValueError
        Names the argument, its value and what is allowed.
    """

    def __init__(self, whisker, contact_arc_length, boundary="fixed", frame="chord", n_modes=10):
        self.contact_arc_length = float(on_whisker(whisker, contact_arc_length))
        self.free = Response(whisker, boundary, frame, n_modes)
        self.held = Response(whisker, boundary, frame, n_modes)
        self.held.modes = supported_modes(
            whisker.taper,
            self.contact_arc_length / whisker.length,
            self.free.modes.follicle_stiffness,
            n_modes,
        )
        self.held.angular_frequency = self.held.modes.angular_frequency(whisker)

    def loads(self, force, dt):
        """Base moment and pole force of one contact, as SupportedContact.

        Parameters
        ----------
        force : (time,) array
            F(t) [N], linear between samples, zero before the first; one contact: once the force
            is back to zero it must stay there.
        dt : float
            Sampling step [s].
        """
        force, dt, release = self._checked(force, dt)
        held, free = self._amplitudes(force, dt, release)
        c, whisker = self.contact_arc_length, self.free.whisker
        rigidity = whisker.base_flexural_rigidity
        moment = np.concatenate(
            [self.held.modes.at_base(2) @ held, self.free.modes.at_base(2) @ free]
        )
        if self.free.modes.follicle_stiffness == 0:
            moment = np.zeros_like(moment)
        pole = np.zeros_like(force)
        # the pole's force is the step of the shear (E I y'')' across c
        before, after = (self.held.modes.third_beside(c / whisker.length, s) for s in SIDES)
        stiffness = whisker.flexural_rigidity(c) / whisker.length**3
        pole[: held.shape[1]] = force[: held.shape[1]] - stiffness * (after - before) @ held
        pole[release:] = 0.0
        return SupportedContact(
            np.arange(len(force)) * dt,
            force,
            pole,
            -c * force,
            rigidity / whisker.length**2 * moment,
            release,
        )

    def displacement(self, force, dt, arc_length):
        """y(x, t) at `arc_length` (points,) [m], as Displacement; other arguments as `loads`."""
        force, dt, release = self._checked(force, dt)
        held, free = self._amplitudes(force, dt, release)
        x = finite_array("arc_length", arc_length)
        static = self.free.steady_shape(self.contact_arc_length, x)
        share = x / self.free.whisker.length
        vibrational = [
            self.held.modes.shape(share).T @ held,
            self.free.modes.shape(share).T @ free,
        ]
        time = np.arange(len(force)) * dt
        return Displacement(time, np.outer(static, force), np.concatenate(vibrational, axis=1))

    def _checked(self, force, dt):
        force, dt = finite_array("force", force), float(positive("dt", dt))
        if force.ndim != 1 or len(force) < 2:
            raise ValueError(f"force must be one row of two samples or more, got {force.shape}")
        touching = np.flatnonzero(force)
        if len(touching) == 0:
            raise ValueError("force must hold a contact, got zeros only")
        if (np.diff(touching) > 1).any():
            gap = touching[np.argmax(np.diff(touching) > 1)] + 1
            raise ValueError(
                f"force must be one contact, got another one after it is zero at sample {gap}"
            )
        return force, dt, int(touching[-1]) + 1

    def _amplitudes(self, force, dt, release):
        """η of the supported modes up to the release, of the free modes after it."""
        c, n = self.contact_arc_length, len(force)
        end = min(release + 1, n)
        participation = self.held.participation_by_quadrature(np.asarray(c))
        integrals = self.held.integrals(force[:end], dt)
        held = -participation[:, None] * integrals
        if release >= n:
            return held, np.zeros((len(held), 0))
        slope = (force[release] - force[release - 1]) / dt  # before the kink
        rates = slope - self.held.followed_rates(force[:end], dt)[:, -1]
        # y = η·ψ, and ẏ = Ḟ ỹ_s + η̇·ψ, in the free modes
        overlap = self._overlap()
        start = overlap @ held[:, -1]
        speed = overlap @ (-participation * rates) + slope * self.free.participation(c)
        time = np.arange(1, n - release) * dt
        g, h = free_motion(self.free.angular_frequency, self.free.whisker.damping_rate, time)
        return held, start[:, None] * g + speed[:, None] * h

    def _overlap(self):
        """∫ φ_k ψ_l (1 − λx)² dx of free modes φ and supported modes ψ."""
        x, w = quadrature_about(self.contact_arc_length / self.free.whisker.length, 120)
        cross = w * (1 - self.free.modes.taper * x) ** 2
        return (self.free.modes.shape(x) * cross) @ self.held.modes.shape(x).T
