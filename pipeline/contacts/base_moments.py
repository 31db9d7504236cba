"""Dynamic base moment of every contact: steady and vibrational, from the whisker's model.

The model (whiskermodel.response: fixed end, chord frame, ten modes of the complete basis) is
driven with the fitted half-Gaussian where the contact is one, with the measured force where it
is not. Moments are signed as in the tables: positive where the load bends counter-clockwise.
"""

from functools import partial

import numpy as np
import pandas as pd

from pipeline.contacts.probability import by_whisker
from pipeline.contacts.summary import without_gaps
from pipeline.session.recording import Recording
from pipeline.tables.columns import split_flags
from whiskermodel.force_profiles import half_gaussian
from whiskermodel.response import Response

STEPS = 800  # of the force in a period of the slowest mode: 20 in one of the tenth
LARGEST_PART = 0.995  # of the length: the model needs a contact nearer to the base
_OF_CONTACTS = (
    "onset_frame", "offset_frame", "peak_force_uN", "pulse_peak_uN", "pulse_duration_ms", "flags",
)  # fmt: skip


def add_base_moments(
    contacts: pd.DataFrame, frames: pd.DataFrame, whiskers: dict, recording: Recording
) -> pd.DataFrame:
    """Fill `steady_peak_nN_m`, `vibration_…` of the table of contacts.

    Contacts of whiskers without dimensions, without forces or beyond the tip have missing values.

    Parameters
    ----------
    contacts : CONTACT_COLUMNS with pulses
    frames : FRAME_COLUMNS with forces
    whiskers : name → Whisker or None
    """
    moments = np.full((3, len(contacts)), np.nan)
    rows = contacts[[*_OF_CONTACTS]].to_dict("records")
    courses = by_whisker(frames, ["frame", "contact_force_uN"])
    names = contacts["whisker"].to_numpy(object)
    place = 1e-3 * contacts["contact_arc_length_mm"].to_numpy()
    for name in np.unique(names):
        whisker = whiskers.get(name)
        longest = 0.0 if whisker is None else LARGEST_PART * whisker.length
        own = np.flatnonzero((names == name) & (place > 0) & (place < longest))
        if not len(own):
            continue
        response = Response(whisker)
        for i, weights in zip(own, response.base_moment_weights(place[own]).T, strict=True):
            load = _load(rows[i], courses[name], recording.frames_per_second)
            if load is not None:
                moments[:, i] = _extremes(response, place[i], weights, *load)
    bends_up = contacts["peak_base_moment_nN_m"].to_numpy() > 0  # the model's moment is −c F
    steady, high, low = 1e9 * np.where(bends_up, -moments[[0, 2, 1]], moments)
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio = np.maximum(high, -low) / np.abs(steady)
    return contacts.assign(
        steady_peak_nN_m=steady, vibration_max_nN_m=high, vibration_min_nN_m=low,
        vibration_ratio=ratio,
    )  # fmt: skip


def _load(contact, course, frames_per_second):
    """Force [N] as a function of time [s], how long it lasts and its peak; None: not known."""
    odd = "not_half_gaussian" in split_flags(contact["flags"])
    if np.isfinite(contact["pulse_peak_uN"]) and not odd:
        peak, duration = 1e-6 * contact["pulse_peak_uN"], 1e-3 * contact["pulse_duration_ms"]
        return partial(half_gaussian, duration=duration, peak_force=peak), duration, peak
    if not np.isfinite(contact["peak_force_uN"]):
        return None
    edges = contact["onset_frame"], contact["offset_frame"]
    inside = slice(*np.searchsorted(course["frame"], edges))
    force = 1e-6 * without_gaps(course["contact_force_uN"][inside])
    nodes = np.cumsum([0.0, _lead(force), *np.ones(len(force) - 1), _lead(force[::-1])])
    nodes /= frames_per_second
    return partial(np.interp, xp=nodes, fp=np.pad(force, 1)), nodes[-1], force.max()


def _lead(force):
    """How many frames before the first one the force began: it is extended back to zero."""
    rise = force[1] - force[0] if len(force) > 1 else force[0]
    return float(np.clip(force[0] / rise, 0.05, 1.0)) if rise > 0 else 1.0


def _extremes(response, place, weights, force, duration, peak):
    """Steady peak, largest and least vibrational moment [N m] of a contact at `place` [m].

    Of free ringing after the contact, no later swing is as large as that of the first period.
    """
    dt = response.longest_period / STEPS
    course = force(np.arange(0, duration + response.longest_period, dt))
    vibrational = -weights @ response.integrals(course, dt)
    return -place * peak, vibrational.max(), vibrational.min()
