"""A half-Gaussian for every contact: the top half of a Gaussian, zero outside.

    F(t) = 2 F_max {exp[−ln 2 ((t − t_c)/t_d)²] − ½} for |t − t_c| ≤ t_d, T = 2 t_d

so that F_max is the peak, at t_c, and T the duration (Hires et al. 2013, methods; the formula
printed there peaks at half of it and at another time).
"""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from numba import njit

from pipeline.session.recording import Recording
from pipeline.tables.columns import split_flags

FEWEST_FRAMES = 3
PAD_FRAMES = 1  # free frames at either end, where the force is zero
STARTS = (0.85, 1.1, 1.5)  # of the contact's duration
_COURSES = ["frame", "contact_force_uN", "contact_force_uN_se"]  # of the frames
_COLUMNS = ("pulse_peak_uN", "pulse_duration_ms", "pulse_centre_s", "pulse_r2")
POOR_R2 = 0.95
POOR_MISFIT = 3.0  # misfit in standard errors of the force that makes a poor r² mean something


@dataclass(frozen=True)
class Pulse:
    """A fitted half-Gaussian: peak [N], duration and centre [s], standard errors, r², RMS [N]."""

    peak: float
    duration: float
    centre: float
    peak_se: float
    duration_se: float
    centre_se: float
    r2: float
    misfit: float


def fit_pulse(time, force) -> Pulse | None:
    """Least-squares half-Gaussian of one contact.

    Parameters
    ----------
    time, force : (frames,) of the contact, evenly spaced [s], [N]; NaN forces are left out

    Returns
    -------
    Pulse, or None where fewer than FEWEST_FRAMES forces are known or none is positive.
    """
    time, force = np.asarray(time, float), np.asarray(force, float)
    if time.shape != force.shape:
        raise ValueError(f"time and force must match, got shapes {time.shape}, {force.shape}")
    known = np.isfinite(force)
    if known.sum() < FEWEST_FRAMES or not np.nanmax(force) > 0:
        return None
    step = (time[-1] - time[0]) / (len(time) - 1)
    first, last = np.flatnonzero(known)[[0, -1]]
    before, after = np.arange(-PAD_FRAMES, 0), np.arange(1, PAD_FRAMES + 1)
    t = np.concatenate([first + before, np.flatnonzero(known), last + after]).astype(float)
    scale = float(np.nanmax(force))
    f = np.concatenate([np.zeros(PAD_FRAMES), force[known] / scale, np.zeros(PAD_FRAMES)])
    found, variance, missing, spread = _best_fit(t, f, first, last, STARTS)
    peak, duration, centre = found
    peak_se, duration_se, centre_se = np.sqrt(np.maximum(variance, 0.0))
    return Pulse(
        peak=scale * peak,
        duration=step * duration,
        centre=time[0] + step * centre,
        peak_se=scale * peak_se,
        duration_se=step * duration_se,
        centre_se=step * centre_se,
        r2=1 - missing / spread if spread > 0 else np.nan,
        misfit=scale * float(np.sqrt(missing / known.sum())),
    )


@njit(cache=True)
def _best_fit(t, f, first, last, starts):
    """Levenberg–Marquardt from several durations.

    Returns (peak, duration, centre), their variances, and over the contact's own frames the sums
    of squares of what is left, and about the mean.
    """
    best_total = np.inf
    best, variance = np.zeros(3), np.zeros(3)
    weight = f.sum()
    for start in starts:
        p = np.array([1.0, start * (last - first + 1.0), (t * f).sum() / weight])
        total, cov = _descend(t, f, p)
        if total < best_total:
            best_total = total
            best[:] = p
            variance[:] = np.diag(cov) * (total / max(len(t) - 3, 1))
    left, inner = np.zeros(len(t)), slice(PAD_FRAMES, len(t) - PAD_FRAMES)
    _residuals(t, f, best, left, np.zeros((len(t), 3)))
    own = f[inner]
    return best, variance, (left[inner] ** 2).sum(), ((own - own.mean()) ** 2).sum()


@njit(cache=True)
def _descend(t, f, p):
    """Levenberg–Marquardt on `p`, in place; returns the sum of squares and (JᵀJ)⁻¹."""
    jac = np.zeros((len(t), 3))
    residual = np.zeros(len(t))
    total = _residuals(t, f, p, residual, jac)
    damping = 1e-3
    trial_residual, trial_jac = np.zeros(len(t)), np.zeros((len(t), 3))
    for _ in range(100):
        normal = jac.T @ jac
        rhs = jac.T @ residual
        damped = normal.copy()
        for k in range(3):
            damped[k, k] += damping * normal[k, k] + 1e-12
        step = np.linalg.solve(damped, rhs)
        trial = p + step
        if trial[0] > 0 and trial[1] > 0.5:
            trial_total = _residuals(t, f, trial, trial_residual, trial_jac)
            if trial_total <= total:
                gained = total - trial_total
                p[:] = trial
                jac[:, :] = trial_jac
                residual[:] = trial_residual
                total = trial_total
                damping = max(damping / 5, 1e-9)
                if gained < 1e-14 + 1e-11 * total:
                    break
                continue
        damping *= 5
        if damping > 1e8:
            break
    normal = jac.T @ jac
    for k in range(3):
        normal[k, k] += 1e-12
    return total, np.linalg.inv(normal)


@njit(cache=True)
def _residuals(t, f, p, residual, jac):
    """Fill misfit and derivatives by (peak, duration, centre); returns the sum of squares."""
    total = 0.0
    for i in range(len(t)):
        z = 2 * (t[i] - p[2]) / p[1]
        value = np.exp(-np.log(2.0) * z * z)
        jac[i, :] = 0.0
        model = 0.0
        if value > 0.5:
            model = 2 * p[0] * (value - 0.5)
            slope = -4 * np.log(2.0) * p[0] * value * z
            jac[i, 0] = 2 * (value - 0.5)
            jac[i, 1] = -slope * z / p[1]
            jac[i, 2] = -slope * 2 / p[1]
        residual[i] = f[i] - model
        total += residual[i] ** 2
    return total


def add_pulses(contacts: pd.DataFrame, frames: pd.DataFrame, recording: Recording):
    """Fill the pulse columns of the table of contacts; flag those that are no half-Gaussian.

    Parameters
    ----------
    contacts : records.CONTACT_COLUMNS with intervals
    frames : records.FRAME_COLUMNS with forces

    Returns
    -------
    The table with `pulse_…` filled and `not_half_gaussian` among the flags where r² is poor and
    the misfit is more than the force's noise.
    """
    contacts, flags = contacts.copy(), contacts["flags"].tolist()
    fits = np.full((len(contacts), len(_COLUMNS)), np.nan)
    onsets, offsets = (contacts[c].to_numpy() for c in ("onset_frame", "offset_frame"))
    for name, places in contacts.reset_index(drop=True).groupby("whisker").indices.items():
        own = frames.loc[frames["whisker"] == name, _COURSES].sort_values("frame")
        frame = own["frame"].to_numpy()
        force = 1e-6 * own["contact_force_uN"].to_numpy(float)
        error = 1e-6 * own["contact_force_uN_se"].to_numpy(float)
        for i in places:
            inside = slice(*np.searchsorted(frame, [onsets[i], offsets[i]]))
            pulse = fit_pulse(frame[inside] / recording.frames_per_second, force[inside])
            if pulse is None:
                continue
            fits[i] = 1e6 * pulse.peak, 1e3 * pulse.duration, pulse.centre, pulse.r2
            if pulse.r2 < POOR_R2 and not pulse.misfit < POOR_MISFIT * np.nanmedian(error[inside]):
                flags[i] = ";".join([*split_flags(flags[i]), "not_half_gaussian"])
    contacts[list(_COLUMNS)] = fits
    contacts["flags"] = pd.array(flags, dtype=contacts["flags"].dtype)
    return contacts
