"""Named time courses of contact force: active touch, stick-slip, ramp-and-hold.

Each takes times [s] and gives forces [N]; all are zero before their onset.
"""

import numpy as np
from numba.extending import register_jitable

from whiskermodel.checks import finite_array, positive, whole_number


def half_gaussian(time, duration, peak_force, onset=0.0):
    """Active touch: the top half of a Gaussian, of `duration` T = 2 t_d and given peak [N].

    F(t) = 2 F_max {exp[−(t − t_d)²/(1.2011 t_d)²] − ½} within 0 ≤ t ≤ 2 t_d, else 0. (As printed
    in the paper it would peak at F_max/2, at 2 t_d; the text has the peak F_max at mid-contact.)

    Parameters
    ----------
    time : (n,) array [s]
    duration, peak_force, onset : float or array of one shape S [s, N, s]

    Returns
    -------
    (*S, n) array [N]
    """
    t = finite_array("time", time)
    duration = positive("duration", duration)[..., None]
    peak = finite_array("peak_force", peak_force)[..., None]
    u = 2 * (t - finite_array("onset", onset)[..., None]) / duration - 1
    return peak * half_gaussian_pulse(u)


@register_jitable  # compiled code may call it, too
def half_gaussian_pulse(u):
    """The pulse of unit peak over −1 ≤ u ≤ 1, 0 elsewhere."""
    return np.fmax(half_gaussian_shape(u), 0.0)


@register_jitable
def half_gaussian_shape(u):
    """2 exp(−ln 2 u²) − 1: the pulse of unit peak over −1 ≤ u ≤ 1, continued smoothly beyond.

    The paper's width of 1.2011 t_d is t_d/√(ln 2), so that u = ±1 at the ends of the pulse.
    """
    return 2 * np.exp(-np.log(2) * u**2) - 1


def stick_slip(time, slip_duration, stick_duration=8e-3, peak_force=5e-6, events=2):
    """Quarter-sine rise to the peak over the stick, quarter-sine fall over the slip, repeated.

    Parameters
    ----------
    time : (n,) array [s]
    slip_duration, stick_duration : float [s]
    peak_force : float [N]
    events : int
        Sticks, each followed at once by its slip.
    """
    t = finite_array("time", time)
    slip = float(positive("slip_duration", slip_duration))
    stick = float(positive("stick_duration", stick_duration))
    events = whole_number("events", events, 1)
    period = stick + slip
    phase = np.mod(t, period)
    rise = np.sin(np.pi / 2 * phase / stick)
    fall = np.cos(np.pi / 2 * (phase - stick) / slip)
    within = (t >= 0) & (t < events * period)
    return float(peak_force) * np.where(within, np.where(phase < stick, rise, fall), 0.0)


def ramp_and_hold(time, ramp_duration, hold_force, hold_duration=np.inf):
    """Raised-cosine ramp to `hold_force` [N], hold, and the same ramp back (never, by default)."""
    t = finite_array("time", time)
    ramp = float(positive("ramp_duration", ramp_duration))
    if not hold_duration >= 0:
        raise ValueError(f"hold_duration must be >= 0 s, got {hold_duration!r} s")
    up = np.clip(t / ramp, 0.0, 1.0)
    down = np.clip((t - ramp - hold_duration) / ramp, 0.0, 1.0)
    return float(hold_force) * 0.5 * (np.cos(np.pi * down) - np.cos(np.pi * up))
