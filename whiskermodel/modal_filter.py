"""One mode's response to a force that is linear between samples: exact at the samples.

The paper's I_k (Eqs 48–51) holds F'' and F', which have impulses where the force has a kink or a
step. Two integrations by parts remove them, for all three damping cases:

    I_k(t) = ∫₀ᵗ h(t−τ)[F''(τ) + 2d F'(τ)] dτ = F(t) − q(t),      q = p_k² (h ∗ F)

q obeys q'' + 2d q' + p² q = p² F from rest, and has an exact two-term recursion. Its coefficients
come from one matrix exponential, which knows no under-, over- or critically damped case.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numba import njit
from scipy.linalg import expm


@dataclass(frozen=True)
class ModalFilter:
    """q_j and q'_j/p of one mode from F_j, both exact for a force linear between samples.

    `numerators` (2, 3) of the state (q, q'/p), `denominator` (3,), `step` (2,): the state's
    value one sample after a unit force has sprung up, apart from that next sample's own share.
    """

    numerators: np.ndarray
    denominator: np.ndarray
    step: np.ndarray

    def __call__(self, force, state=0):
        """q (state 0) or q'/p (state 1) along the last axis; zero before the first sample."""
        rows = np.ascontiguousarray(force, float).reshape(-1, force.shape[-1])
        out = np.empty_like(rows)
        _recur(self.numerators[state], self.denominator, self.step[state], rows, out)
        return out.reshape(force.shape)


@njit(cache=True)
def _recur(b, a, step, force, out):
    """The recursion along each row; a force that is not zero at first is a step there."""
    for row in range(len(force)):
        f, y = force[row], out[row]
        y[0] = 0.0
        if len(f) > 1:
            y[1] = b[0] * f[1] + step * f[0]
        for j in range(2, len(f)):
            late = b[0] * f[j] + b[1] * f[j - 1] + b[2] * f[j - 2]
            y[j] = late - a[1] * y[j - 1] - a[2] * y[j - 2]


def modal_filters(angular_frequency, damping_rate, dt):
    """A ModalFilter for each p_k > 0 [rad/s] of `angular_frequency` (n_modes,), else None."""
    return [_filter(p, damping_rate, dt) if p > 0 else None for p in angular_frequency]


@lru_cache(maxsize=256)  # contacts of a video have their modes and steps in common
def _filter(p, d, dt):
    # one step of the state is M, and the force adds early·F_j + late·F_(j+1); eliminating q'/p (or
    # q) leaves a recursion of q (or q'/p) alone
    system = np.zeros((4, 4))  # state (q, q'/p), force, force's change over the step
    system[:2, :2] = np.array([[0.0, p], [-p, -2 * d]]) * dt
    system[1, 2] = p * dt
    system[2, 3] = 1.0
    exponential = expm(system)
    m, late = exponential[:2, :2], exponential[:2, 3]
    early = exponential[:2, 2] - late
    numerators = np.stack([late, early, np.zeros(2)], axis=1)
    numerators[0, 1] += m[0, 1] * late[1] - m[1, 1] * late[0]
    numerators[1, 1] += m[1, 0] * late[0] - m[0, 0] * late[1]
    numerators[0, 2] = m[0, 1] * early[1] - m[1, 1] * early[0]
    numerators[1, 2] = m[1, 0] * early[0] - m[0, 0] * early[1]
    # det M = e^(−2 d dt) exactly
    denominator = np.array([1.0, -np.trace(m), np.exp(-2 * d * dt)])
    return ModalFilter(numerators, denominator, early)


def free_motion(angular_frequency, damping_rate, t):
    """g(t) and h(t) [s] of q'' + 2d q' + p² q = 0: q = q(0) g + q'(0) h; each (modes, *t.shape).

    Any damping; h is the impulse response of Eqs 49–51.
    """
    t, d = np.asarray(t, dtype=float), damping_rate
    p = np.asarray(angular_frequency).reshape(-1, *[1] * t.ndim)
    rate = np.sqrt(np.abs(p**2 - d**2))
    over, critical = p < d, rate == 0
    safe = np.where(critical, 1.0, rate)
    quick, slow = np.exp(-(d + rate * over) * t), np.exp(-(d - rate * over) * t)
    h = np.where(over, (slow - quick) / (2 * safe), quick * np.sin(rate * t) / safe)
    h = np.where(critical, t * quick, h)
    even = np.where(over, (slow + quick) / 2, quick * np.cos(rate * t))
    return even + d * h, h
