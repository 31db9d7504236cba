"""Base moments of many half-Gaussian contacts in closed form.

While a smooth force F acts, a mode's q = p² (h ∗ F) (see `modal_filter`) is a polynomial as smooth
as F itself plus, where the mode is fast, free ringing set off by the force's onset; afterwards it
is free ringing alone. So a contact is a few dozen numbers, and its time course at any number of
points is one product of matrices. Contacts of similar duration share the polynomials' span and
everything that depends on it. Nothing is stepped through time, nothing is differentiated, and the
result is that of Eq. 49 to about ten digits. (Modes that do not swing, p_k ≤ d, which no whisker
has, send the whole call to the recursion for sampled forces.)
"""

import numpy as np
from numpy.polynomial import legendre
from scipy.special import roots_legendre

from whiskermodel.checks import finite_array, on_whisker, positive
from whiskermodel.force_profiles import half_gaussian, half_gaussian_shape
from whiskermodel.modal_filter import free_motion

_TERMS = 56  # Legendre terms over a group's span
_SLOW = 24.0  # rad of a mode in half a span, up to which a polynomial follows it throughout
_SPREAD = 1.25  # longest over shortest duration in a group
_BATCH = 64  # contacts per matrix product, to stay in the cache


def half_gaussian_moments(response, contact_arc_length, peak_force, duration, time):
    """Steady and vibrational base moment of half-Gaussian contacts that begin at time 0.

    Parameters
    ----------
    response : Response
    contact_arc_length, peak_force, duration : float or (contacts,) array
        c [m], F_max [N], T [s].
    time : (n,) array [s], ascending, ≥ 0

    Returns
    -------
    steady, vibrational : (contacts, n) arrays [N m]

    Raises
    ------
    ValueError
        Names the argument, its value and what is allowed.
    """
    c, peak, duration = _contacts(response, contact_arc_length, peak_force, duration)
    time = finite_array("time", time)
    if time.ndim != 1 or len(time) == 0 or time[0] < 0 or (np.diff(time) <= 0).any():
        raise ValueError(f"time must be one ascending row from >= 0 s, got shape {time.shape}")
    if not _all_swing(response):
        return _stepped_moments(response, c, peak, duration, time)
    steady, vibrational = np.empty((2, len(c), len(time)))
    for rows in _groups(duration):
        group = _Group(response, c[rows], peak[rows], duration[rows])
        on_grid = _Grid(group, time)
        for start in range(0, len(rows), _BATCH):
            some = slice(start, start + _BATCH)
            steady[rows[some]], vibrational[rows[some]] = on_grid.moments(some)
    return steady, vibrational


def half_gaussian_extremes(
    response, contact_arc_length, peak_force, duration, ringing=25e-3, dt=1e-5
):
    """Peak steady moment, and largest and smallest vibrational moment, of each contact.

    Parameters
    ----------
    response, contact_arc_length, peak_force, duration : as in `half_gaussian_moments`
    ringing : float
        How long after the contact to look [s].
    dt : float
        Time step [s] of the search; the tenth mode of a mouse whisker swings in 200 µs.

    Returns
    -------
    (3, contacts) array [N m]
    """
    c, peak, duration = _contacts(response, contact_arc_length, peak_force, duration)
    dt, ringing = float(positive("dt", dt, "s")), float(positive("ringing", ringing, "s"))
    out = np.stack([-c * peak, np.zeros(len(c)), np.zeros(len(c))])
    for rows in _groups(duration):
        time = np.arange(0, duration[rows].max() + ringing, dt)
        for start in range(0, len(rows), 1024):
            some = rows[start : start + 1024]
            _, vibrational = half_gaussian_moments(
                response, c[some], peak[some], duration[some], time
            )
            out[1:, some] = vibrational.max(axis=1), vibrational.min(axis=1)
    return out


def _contacts(response, contact_arc_length, peak_force, duration):
    c = on_whisker(response.whisker, contact_arc_length)
    peak = finite_array("peak_force", peak_force)
    duration = positive("duration", duration, "s")
    try:
        return tuple(np.atleast_1d(*np.broadcast_arrays(c, peak, duration)))
    except ValueError:
        raise ValueError(
            f"contact_arc_length, peak_force and duration must be numbers or of one length, "
            f"got shapes {c.shape}, {peak.shape}, {duration.shape}"
        ) from None


def _all_swing(response):
    p = response.angular_frequency
    return bool((p[p > 0] > response.whisker.damping_rate).all())


def _stepped_moments(response, c, peak, duration, time):
    """The same by the recursion, each contact in steps that meet its end."""
    fine = 0.05 / response.angular_frequency.max()
    steady = -c[:, None] * half_gaussian(time, duration, peak)
    vibrational = np.empty_like(steady)
    for i, (where, force, length) in enumerate(zip(c, peak, duration, strict=True)):
        dt = length / np.ceil(length / min(fine, length / 1000))
        steps = np.arange(0, time[-1] + dt, dt)
        loads = response.base_loads(where, half_gaussian(steps, length, force), dt)
        vibrational[i] = np.interp(time, steps, loads.vibrational_moment)
    return steady, vibrational


def _groups(duration):
    """Indices of contacts of similar duration, group by group."""
    order = np.argsort(duration, kind="stable")
    while len(order):
        n = np.searchsorted(duration[order], _SPREAD * duration[order[0]], side="right")
        yield order[:n]
        order = order[n:]


def _carried(response, state, t):
    """State (2, contacts, modes) of q and q' after a further free time `t` (contacts,)."""
    p, d = response.angular_frequency, response.whisker.damping_rate
    g, h = (values.T[:, p > 0] for values in free_motion(p, d, t))
    p = p[p > 0]
    late = state[0] * g + state[1] * h
    return np.stack([late, -(p**2) * h * state[0] + (g - 2 * d * h) * state[1]])


class _Group:
    """Contacts of similar duration: weights, polynomials, ringing from onset and from release.

    Polynomials are Legendre series over 0 ≤ t ≤ span, the longest duration.
    """

    def __init__(self, response, c, peak, duration):
        moving = response.angular_frequency > 0  # a rigid rotation bears no moment
        self.angular_frequency = response.angular_frequency[moving]
        self.response = response
        weights = response.base_moment_weights(c)[moving].T
        self.c, self.duration = c, duration
        self.span, self.earliest = duration.max(), duration.min()
        self.force = _pulse_series(peak, duration, self.span)
        maps, fast = _response_maps(
            self.angular_frequency, response.whisker.damping_rate, self.span / 2
        )
        # (contacts, modes, terms): the smooth part of q
        smooth = np.tensordot(self.force, maps, axes=(1, 2))
        onset = np.where(fast, -self._state(smooth, np.zeros(1)), 0.0)
        release = self._state(smooth, duration) + _carried(response, onset, duration)
        release = _carried(response, release, self.earliest - duration)
        self.polynomial = np.einsum("ck,ckn->cn", weights, smooth)
        self.polynomial -= weights.sum(axis=1)[:, None] * self.force
        self.from_onset = (weights * onset).transpose(1, 0, 2).reshape(len(c), -1)
        self.from_release = (weights * release).transpose(1, 0, 2).reshape(len(c), -1)

    def ringing(self, t):
        """g and h of the moving modes at times `t` (n,), each (modes, n)."""
        return free_motion(self.angular_frequency, self.response.whisker.damping_rate, t)

    def _state(self, smooth, t):
        """q and q' of the smooth part at time `t` (contacts or 1,), (2, contacts, modes)."""
        u = 2 * t / self.span - 1
        values = legendre.legvander(u, smooth.shape[2] - 1)
        slopes = values @ _differentiation(smooth.shape[2])
        rows = [np.einsum("ckn,cn->ck", smooth, np.broadcast_to(v, smooth[:, 0].shape))
                for v in (values, slopes * 2 / self.span)]  # fmt: skip
        return np.stack(rows)


class _Grid:
    """A group's series and ringing at given times, ready for the contacts' coefficients."""

    def __init__(self, group, time):
        self.group, self.time = group, time
        self.end = np.searchsorted(time, group.span)  # of the longest contact
        self.start = np.searchsorted(time, group.earliest)  # of the earliest release
        during, after = time[: self.end], time[self.start :]
        n_terms = group.force.shape[1]
        self.series = legendre.legvander(2 * during / group.span - 1, n_terms - 1).T.copy()
        self.in_contact = np.concatenate([self.series, *group.ringing(during)])
        self.released = np.concatenate(group.ringing(after - group.earliest))

    def moments(self, some):
        """Steady and vibrational moment of the contacts in the slice `some`."""
        g, time, start, end = self.group, self.time, self.start, self.end
        amplitudes = np.concatenate([g.polynomial[some], g.from_onset[some]], axis=1)
        steady, vibrational = np.zeros((2, len(amplitudes), len(time)))
        vibrational[:, :end] = amplitudes @ self.in_contact
        steady[:, :end] = (-g.c[some, None] * g.force[some]) @ self.series
        after = g.from_release[some] @ self.released
        vibrational[:, end:] = after[:, end - start :]
        over = time[None, start:end] >= g.duration[some, None]
        np.copyto(vibrational[:, start:end], after[:, : end - start], where=over)
        np.copyto(steady[:, start:end], 0.0, where=over)
        return steady, vibrational


def _pulse_series(peak, duration, span):
    """Legendre series of the pulses, continued smoothly to the span, (contacts, terms)."""
    nodes, weights = roots_legendre(_TERMS)
    values = half_gaussian_shape((nodes + 1) * span / duration[:, None] - 1)
    table = legendre.legvander(nodes, _TERMS - 1) * (np.arange(_TERMS) + 0.5)
    return peak[:, None] * ((values * weights) @ table)


def _response_maps(angular_frequency, d, half):
    """Maps from the force's series to q's, (modes, terms, terms), and which modes are fast.

    Over u = t/half − 1, (ph)² F = (ph)² q + 2dh q_u + q_uu. A slow mode's q is polynomial enough
    as a whole: solved for q_uu, starting from rest. A fast mode's polynomial is the one that
    follows the force without ringing.
    """
    unit, integral = np.eye(_TERMS), _integration(_TERMS)
    differential = _differentiation(_TERMS)
    turn = angular_frequency * half
    maps = np.empty((len(turn), _TERMS, _TERMS))
    for k, ph in enumerate(turn):
        if ph <= _SLOW:
            twice = integral @ integral
            system = unit + 2 * d * half * integral + ph**2 * twice
            maps[k] = ph**2 * twice @ np.linalg.inv(system)
        else:
            change = 2 * d * half * differential + differential @ differential
            maps[k] = np.linalg.inv(unit + change / ph**2)
    return maps, turn > _SLOW


def _integration(n):
    """Legendre coefficients of a series → of its integral from u = −1."""
    out = np.zeros((n, n))
    k = np.arange(1, n)
    out[k, k - 1] = 1 / (2 * k - 1)
    out[k - 1, k] = -1 / (2 * k + 1)
    out[0, 0] = 1.0
    return out


def _differentiation(n):
    """Legendre coefficients of a series → of its derivative."""
    out = np.zeros((n, n))
    for column in range(1, n):
        out[column - 1 :: -2, column] = 2 * np.arange(column - 1, -1, -2) + 1
    return out
