"""Base moments of many half-Gaussian contacts in closed form.

While a smooth force F acts, a mode's q = p² (h ∗ F) (see `modal_filter`) is a polynomial as smooth
as F itself plus, where the mode is fast, free ringing set off by the force's onset; afterwards it
is free ringing alone. So a contact is a few dozen numbers, and its time course at any number of
points is one product of matrices. Contacts of similar duration share the polynomials' span and
everything that depends on it. Nothing is stepped through time, nothing is differentiated, and the
result is that of Eq. 49 to about ten digits. (Modes that do not swing, p_k ≤ d, which no whisker
has, send the whole call to the recursion for sampled forces.)
"""

from functools import lru_cache

import numpy as np
from numpy.polynomial import legendre
from scipy.special import roots_legendre

from whiskermodel.checks import finite_array, on_whisker, positive
from whiskermodel.force_profiles import half_gaussian, half_gaussian_shape
from whiskermodel.modal_filter import free_motion

_FORCE_TERMS = 28  # Legendre terms of a pulse over its span, to rounding
_TERMS = 56  # and of a mode's response
_SLOW = 24.0  # rad of a mode in half a span, up to which a polynomial follows it throughout
_SPREAD = 2.0  # from one span to the next
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
    return HalfGaussianMoments(response, time)(contact_arc_length, peak_force, duration)


class HalfGaussianMoments:
    """`half_gaussian_moments` for one whisker and row of times, prepared to be called repeatedly.

    Parameters
    ----------
    response : Response
    time : (n,) array [s], ascending, ≥ 0
    """

    def __init__(self, response, time):
        time = finite_array("time", time)
        if time.ndim != 1 or len(time) == 0 or time[0] < 0 or (np.diff(time) <= 0).any():
            raise ValueError(f"time must be one ascending row from >= 0 s, got shape {time.shape}")
        self.response, self.time = response, time
        self._spans = {}
        self._scratch = np.empty((3, _BATCH * len(time)))

    def __call__(self, contact_arc_length, peak_force, duration, out=None):
        """Steady and vibrational moments, (contacts, n) each, into `out` where it is given."""
        c, peak, duration = _contacts(self.response, contact_arc_length, peak_force, duration)
        shape = (len(c), len(self.time))
        out = np.empty((2, *shape)) if out is None else out
        if np.shape(out) != (2, *shape):
            raise ValueError(f"out must be of shape {(2, *shape)}, got {np.shape(out)}")
        if not _all_swing(self.response):
            out[...] = _stepped_moments(self.response, c, peak, duration, self.time)
            return out[0], out[1]
        weights = self.response.base_moment_weights(c).T
        which = _span_of(duration)
        for number in np.unique(which):
            rows = np.flatnonzero(which == number)
            if number not in self._spans:
                self._spans[number] = _Span(self.response, _SPREAD**number, self.time)
            span = self._spans[number]
            for start in range(0, len(rows), _BATCH):
                some = rows[start : start + _BATCH]
                contacts = (c[some], peak[some], duration[some], weights[some])
                span.write(some, contacts, out, self._scratch)
        return out[0], out[1]


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
    dt, ringing = float(positive("dt", dt)), float(positive("ringing", ringing))
    out = np.stack([-c * peak, np.zeros(len(c)), np.zeros(len(c))])
    which = _span_of(duration)
    for number in np.unique(which):
        rows = np.flatnonzero(which == number)
        moments = HalfGaussianMoments(response, np.arange(0, duration[rows].max() + ringing, dt))
        for start in range(0, len(rows), _BATCH):
            some = rows[start : start + _BATCH]
            _, vibrational = moments(c[some], peak[some], duration[some])
            out[1:, some] = vibrational.max(axis=1), vibrational.min(axis=1)
    return out


def _contacts(response, contact_arc_length, peak_force, duration):
    c = on_whisker(response.whisker, contact_arc_length)
    peak = finite_array("peak_force", peak_force)
    duration = positive("duration", duration)
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


def _span_of(duration):
    """The number of the shortest span that holds each contact, a power of _SPREAD [s]."""
    return np.ceil(np.log(duration) / np.log(_SPREAD) - 1e-9).astype(int)


def _carried(response, state, t):
    """State (2, contacts, modes) of q and q' after a further free time `t` (contacts,)."""
    p, d = response.angular_frequency, response.whisker.damping_rate
    g, h = (values.T[:, p > 0] for values in free_motion(p, d, t))
    p = p[p > 0]
    late = state[0] * g + state[1] * h
    return np.stack([late, -(p**2) * h * state[0] + (g - 2 * d * h) * state[1]])


class _Span:
    """All that contacts of similar duration share; polynomials are Legendre series over the span.

    The modes' ringing from the onset is counted from time 0, that from the release from the
    earliest release.
    """

    def __init__(self, response, span, time):
        self.response, self.span, self.earliest = response, span, span / _SPREAD
        self.time = time
        self.moving = response.angular_frequency > 0  # a rigid rotation bears no moment
        p, d = response.angular_frequency[self.moving], response.whisker.damping_rate
        self.maps, self.fast = _response_maps(p, d, span / 2)
        self.at_onset = self._tables(np.zeros(1))
        end, self.start = np.searchsorted(time, [span * (1 + 1e-9), self.earliest])
        during, after = time[:end], time[self.start :] - self.earliest
        self.series = legendre.legvander(2 * during / span - 1, _TERMS - 1).T.copy()
        self.in_contact = np.concatenate([self.series, *free_motion(p, d, during)])
        self.released = np.concatenate(free_motion(p, d, after))

    def write(self, rows, contacts, out, scratch):
        """Moments of these contacts into `out[:, rows]`; `scratch` (3, big enough)."""
        c, peak, duration, weights = contacts
        force = _pulse_series(peak, duration, self.span)
        during, released = self._coefficients(weights[:, self.moving], force, duration)
        steady = _product(-c[:, None] * force, self.series[:_FORCE_TERMS], scratch[0])
        contact = _product(during, self.in_contact, scratch[1])
        after = _product(released, self.released, scratch[2])
        ends = np.searchsorted(self.time, duration)
        for i, (row, end) in enumerate(zip(rows, ends, strict=True)):
            out[0, row, :end], out[0, row, end:] = steady[i, :end], 0.0
            out[1, row, :end], out[1, row, end:] = contact[i, :end], after[i, end - self.start :]

    def _coefficients(self, weights, force, duration):
        """Amplitudes of series and ringing during the contact, and of ringing after it."""
        # (contacts, modes, terms): the smooth part of q
        smooth = np.tensordot(force, self.maps, axes=(1, 2))
        onset = np.where(self.fast, -_states(smooth, self.at_onset), 0.0)
        release = _states(smooth, self._tables(duration))
        release = release + _carried(self.response, onset, duration)
        release = _carried(self.response, release, self.earliest - duration)
        polynomial = np.einsum("ck,ckn->cn", weights, smooth)
        polynomial[:, :_FORCE_TERMS] -= weights.sum(axis=1)[:, None] * force
        from_onset, from_release = (
            (weights * state).transpose(1, 0, 2).reshape(len(weights), -1)
            for state in (onset, release)
        )
        return np.concatenate([polynomial, from_onset], axis=1), from_release

    def _tables(self, t):
        """What takes series to q and to q' at times `t` (contacts,), (2, contacts, terms)."""
        values = legendre.legvander(2 * t / self.span - 1, _TERMS - 1)
        return np.stack([values, values @ _differentiation() * (2 / self.span)])


def _states(smooth, tables):
    """q and q' of the series (contacts, modes, terms), (2, contacts, modes)."""
    return np.matmul(smooth, tables[..., None])[..., 0]


def _product(left, right, scratch):
    """left @ right into the beginning of `scratch`."""
    shape = (len(left), right.shape[1])
    return np.matmul(left, right, out=scratch[: shape[0] * shape[1]].reshape(shape))


def _pulse_series(peak, duration, span):
    """Legendre series of the pulses, continued smoothly to the span, (contacts, terms)."""
    nodes, projection = _projection()
    return peak[:, None] * (
        half_gaussian_shape((nodes + 1) * span / duration[:, None] - 1) @ projection
    )


@lru_cache(maxsize=1)
def _projection():
    """Gauss's nodes, and the matrix from values there to Legendre coefficients."""
    nodes, weights = roots_legendre(_FORCE_TERMS + 8)
    table = legendre.legvander(nodes, _FORCE_TERMS - 1) * (np.arange(_FORCE_TERMS) + 0.5)
    return nodes, weights[:, None] * table


def _response_maps(angular_frequency, d, half):
    """Maps from the force's series to q's, (modes, terms, force terms), and the fast modes.

    Over u = t/half − 1, (ph)² F = (ph)² q + 2dh q_u + q_uu. A slow mode's q is polynomial enough
    as a whole: solved for q_uu, starting from rest. A fast mode's polynomial is the one that
    follows the force without ringing.
    """
    unit, integral, differential = np.eye(_TERMS), _integration(), _differentiation()
    turn = angular_frequency * half
    fast, square = turn > _SLOW, turn[:, None, None] ** 2
    twice = integral @ integral
    system = unit + 2 * d * half * integral + square * twice
    change = 2 * d * half * differential + differential @ differential
    system[fast] = unit + change / square[fast]
    right = np.where(fast[:, None, None], unit, square * twice)[:, :, :_FORCE_TERMS]
    return np.linalg.solve(system, right), fast


def _integration():
    """Legendre coefficients of a series → of its integral from u = −1."""
    out, k = np.zeros((_TERMS, _TERMS)), np.arange(1, _TERMS)
    out[k, k - 1] = 1 / (2 * k - 1)
    out[k - 1, k] = -1 / (2 * k + 1)
    out[0, 0] = 1.0
    return out


@lru_cache(maxsize=1)
def _differentiation():
    """Legendre coefficients of a series → of its derivative."""
    out = np.zeros((_TERMS, _TERMS))
    for column in range(1, _TERMS):
        out[column - 1 :: -2, column] = 2 * np.arange(column - 1, -1, -2) + 1
    return out
