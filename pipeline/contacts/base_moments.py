"""Dynamic base moment of every contact: steady and vibrational, from the whisker's model.

The model (whiskermodel.response: fixed end, chord frame, ten modes of the complete basis) is
driven with the fitted half-Gaussian where the contact is one, with the measured force where it
is not. Moments are signed as in the tables: positive where the load bends counter-clockwise.
"""

import numpy as np
import pandas as pd

from pipeline.contacts.probability import of_whisker
from pipeline.session.recording import Recording
from whiskermodel.pulse_response import half_gaussian_extremes
from whiskermodel.response import Response

FINE_STEPS = 20  # per frame, in which a measured force drives the model
SUBSTEPS = 2  # results per fine step: the modes ring at up to some kHz
LARGEST_PART = 0.995  # of the length: the model needs a contact nearer to the base
NOT_A_PULSE = "not_half_gaussian"
_COURSE = ["frame", "whisker", "contact_force_uN"]  # of the frames
_COLUMNS = ("steady_peak_nN_m", "vibration_max_nN_m", "vibration_min_nN_m")


def add_base_moments(
    contacts: pd.DataFrame, frames: pd.DataFrame, whiskers: dict, recording: Recording
) -> pd.DataFrame:
    """Fill `steady_peak_nN_m`, `vibration_…` of the table of contacts.

    Contacts of whiskers without dimensions, without forces or beyond the tip keep missing values.

    Parameters
    ----------
    contacts : CONTACT_COLUMNS with pulses
    frames : FRAME_COLUMNS with forces
    whiskers : name → Whisker or None
    """
    extremes = np.full((3, len(contacts)), np.nan)
    for name, part in contacts.reset_index(drop=True).groupby("whisker"):
        whisker = whiskers.get(name)
        if whisker is None:
            continue
        response = Response(whisker)
        place = 1e-3 * part["contact_arc_length_mm"]
        usable = (place > 0) & (place < LARGEST_PART * whisker.length)
        odd = part["flags"].str.split(";").apply(lambda flags: NOT_A_PULSE in flags)
        pulse = usable & ~odd & part["pulse_peak_uN"].notna()
        extremes[:, part.index[pulse]] = _of_pulses(response, part[pulse])
        measured = usable & ~pulse & part["peak_force_uN"].notna()
        own = of_whisker(frames[_COURSE], name)
        for i, row in part[measured].iterrows():
            force = _measured_force(own, row)
            at = 1e-3 * row["contact_arc_length_mm"]
            extremes[:, [i]] = _of_force(response, at, force, recording, row)
    return _written(contacts, extremes)


def _of_pulses(response, part):
    """Steady peak, largest and least vibrational moment [N m], (3, contacts)."""
    if len(part) == 0:
        return np.empty((3, 0))
    extremes = half_gaussian_extremes(
        response,
        1e-3 * part["contact_arc_length_mm"].to_numpy(float),
        1e-6 * part["pulse_peak_uN"].to_numpy(float),
        1e-3 * part["pulse_duration_ms"].to_numpy(float),
        ringing=response.longest_period,
        dt=response.longest_period / 400,  # a tenth of the tenth mode's period
    )
    return _signed(extremes, part["peak_base_moment_nN_m"].to_numpy(float))


def _of_force(response, place, force, recording, row):
    """The same for one contact, driven with its measured force [N], a value per frame."""
    quiet = int(np.ceil(response.longest_period * recording.frames_per_second))
    nodes = np.arange(len(force), dtype=float)
    time = np.arange(-1, len(force) + quiet, 1 / FINE_STEPS)
    nodes = np.concatenate([[-_lead(force)], nodes, [nodes[-1] + _lead(force[::-1])]])
    fine = np.interp(time, nodes, np.concatenate([[0.0], force, [0.0]]), left=0.0, right=0.0)
    dt = 1 / recording.frames_per_second / FINE_STEPS
    loads = response.base_loads(place, fine, dt, substeps=SUBSTEPS)
    steady = loads.steady_moment[np.argmax(np.abs(loads.steady_moment))]
    extremes = np.array(
        [[steady], [loads.vibrational_moment.max()], [loads.vibrational_moment.min()]]
    )
    return _signed(extremes, np.array([row["peak_base_moment_nN_m"]], float))


def _lead(force):
    """How many frames before the first one the force began: it is extended back to zero."""
    rise = force[1] - force[0] if len(force) > 1 else force[0]
    return float(np.clip(force[0] / rise, 0.05, 1.0)) if rise > 0 else 1.0


def _signed(extremes, measured):
    """The extremes with the sign of the measured moment; the model's moment is −c F."""
    steady, high, low = extremes
    return np.where(measured > 0, [-steady, -low, -high], extremes)


def _measured_force(own: pd.DataFrame, row) -> np.ndarray:
    """Force in the frames of one contact [N], interpolated where a frame has none."""
    frame = own["frame"].to_numpy()
    first, last = np.searchsorted(frame, [row["onset_frame"], row["offset_frame"]])
    force = 1e-6 * own["contact_force_uN"].to_numpy(float)[first:last]
    known = np.isfinite(force)
    wanted = np.arange(row["onset_frame"], row["offset_frame"])
    return np.interp(wanted, frame[first:last][known], force[known])


def _written(contacts, extremes):
    """The contacts with the extremes (3, contacts) [N m] that are known, and their ratio."""
    found = np.isfinite(extremes[0])
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio = np.abs(extremes[1:]).max(axis=0) / np.abs(extremes[0])
    columns = dict(zip((*_COLUMNS, "vibration_ratio"), (*(1e9 * extremes), ratio), strict=True))
    known = {name: contacts[name].to_numpy(float) for name in columns}
    return contacts.assign(
        **{name: np.where(found, new, known[name]) for name, new in columns.items()}
    )
