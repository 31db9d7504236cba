"""A half-Gaussian for every contact: the top half of a Gaussian, zero outside.

    F(t) = 2 F_max {exp[−ln 2 ((t − t_c)/t_d)²] − ½} for |t − t_c| ≤ t_d, T = 2 t_d

so that F_max is the peak, at t_c, and T the duration (Hires et al. 2013, methods; the formula
printed there peaks at half of it and at another time).
"""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from numba import njit
from scipy.optimize import leastsq

from pipeline.contacts.probability import by_whisker
from pipeline.session.recording import Recording
from pipeline.tables.columns import split_flags
from whiskermodel.force_profiles import half_gaussian_pulse

FEWEST_FRAMES = 3
STARTS = (0.85, 1.1, 1.5)  # of the contact's duration
_COURSE = ("frame", "contact_force_uN", "contact_force_uN_se")  # of the frames
POOR_R2 = 0.95
POOR_MISFIT = 3.0  # in standard errors of the force: below, a poor r² is noise


@dataclass(frozen=True)
class Pulse:
    """A fitted half-Gaussian: peak [N], duration and centre [s], r², RMS misfit [N]."""

    peak: float
    duration: float
    centre: float
    r2: float
    misfit: float


def fit_pulse(time, force) -> Pulse | None:
    """Least-squares half-Gaussian of one contact.

    Parameters
    ----------
    time, force : (frames,) of the contact, evenly spaced [s], [N]; NaN forces are left out

    Returns
    -------
    The `Pulse`; None where fewer than FEWEST_FRAMES forces are known, or none is positive.
    """
    time, force = np.asarray(time, float), np.asarray(force, float)
    if time.shape != force.shape:
        raise ValueError(f"time and force must match, got shapes {time.shape}, {force.shape}")
    known = np.isfinite(force)
    if known.sum() < FEWEST_FRAMES or not np.nanmax(force) > 0:
        return None
    step = (time[-1] - time[0]) / (len(time) - 1)
    place, scale = np.flatnonzero(known), float(np.nanmax(force))
    t = np.concatenate([[place[0] - 1], place, [place[-1] + 1]])  # free frames at either end
    f = np.pad(force[known] / scale, 1)
    middle, count = (t * f).sum() / f.sum(), place[-1] - place[0] + 1
    starts = [np.array([1.0, share * count, middle]) for share in STARTS]
    fits = [leastsq(_misfit, start, (t, f), full_output=True)[0] for start in starts]
    best = min(fits, key=lambda found: np.sum(_misfit(found, t, f) ** 2))
    own, left = force[known], scale * _misfit(best, t, f)[1:-1]
    spread = np.sum((own - own.mean()) ** 2)
    return Pulse(
        peak=scale * best[0],
        duration=step * abs(best[1]),
        centre=time[0] + step * best[2],
        r2=1 - np.sum(left**2) / spread if spread > 0 else np.nan,
        misfit=float(np.sqrt(np.mean(left**2))),
    )


@njit(cache=True, error_model="numpy")
def _misfit(pulse, t, force):
    """The half-Gaussian (peak, duration, centre) minus the force, (frames,)."""
    return pulse[0] * half_gaussian_pulse(2 * (t - pulse[2]) / pulse[1]) - force


def add_pulses(contacts: pd.DataFrame, frames: pd.DataFrame, recording: Recording):
    """Fill the pulse columns of the table of contacts; flag those that are no half-Gaussian.

    Parameters
    ----------
    contacts : table with CONTACT_COLUMNS, of which the intervals are filled
    frames : table with FRAME_COLUMNS and the forces

    Returns
    -------
    The table with `pulse_…` filled and `not_half_gaussian` among the flags where r² is poor and
    the misfit is more than the force's noise.
    """
    fits, flags = np.full((4, len(contacts)), np.nan), contacts["flags"].tolist()
    courses = by_whisker(frames, _COURSE)
    edges = contacts[["onset_frame", "offset_frame"]].to_numpy()
    for i, name in enumerate(contacts["whisker"]):
        inside = slice(*np.searchsorted(courses[name]["frame"], edges[i]))
        frame, force, error = (courses[name][column][inside] for column in _COURSE)
        pulse = fit_pulse(frame / recording.frames_per_second, 1e-6 * force)
        if pulse is None:
            continue
        fits[:, i] = 1e6 * pulse.peak, 1e3 * pulse.duration, pulse.centre, pulse.r2
        if pulse.r2 < POOR_R2 and not 1e6 * pulse.misfit < POOR_MISFIT * np.nanmedian(error):
            flags[i] = ";".join([*split_flags(flags[i]), "not_half_gaussian"])
    peak, duration, centre, r2 = fits
    return contacts.assign(
        pulse_peak_uN=peak, pulse_duration_ms=duration, pulse_centre_s=centre, pulse_r2=r2,
        flags=pd.array(flags, dtype=contacts["flags"].dtype),
    )  # fmt: skip
