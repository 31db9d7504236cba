"""A video's contacts, from places and forces, with a person's corrections on top."""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from pipeline.contacts.intervals import INTERVAL_COLUMNS, find_intervals, in_contact
from pipeline.contacts.probability import add_probability
from pipeline.contacts.summary import contact_table, peak_errors
from pipeline.forces import forces
from pipeline.session.parameters import DEFAULTS, Parameters
from pipeline.session.recording import Recording
from pipeline.tables.columns import (
    CONTACT_COLUMNS,
    EVIDENCE_COLUMNS,
    FRAME_COLUMNS,
    as_table,
    empty_table,
)


@dataclass(frozen=True)
class ContactTables:
    """All about the contacts in one video.

    Attributes
    ----------
    frames, contacts : tables with FRAME_COLUMNS and CONTACT_COLUMNS
    intervals : a row per contact, with INTERVAL_COLUMNS and `curated`
    evidence : the measurements that both rest on, row by row as `frames`, in SI units
    """

    frames: pd.DataFrame
    contacts: pd.DataFrame
    intervals: pd.DataFrame
    evidence: pd.DataFrame


@dataclass(frozen=True)
class ContactOptions:
    """Options of `find_contacts`.

    Attributes
    ----------
    curvature_at : arc length at which the table of frames has the curvature [m]
    method : how the force is estimated, "shape" or "point" (`pipeline.forces`)
    video : name for the contacts' column `video`
    params : parameters of all rooms
    """

    curvature_at: float = 5.5e-3
    method: str = "shape"
    video: str = ""
    params: Parameters = DEFAULTS


def no_contacts(frames) -> ContactTables:
    """The contacts of a video in which no whisker was ever seen: none."""
    return ContactTables(
        frames=frames,
        contacts=empty_table(CONTACT_COLUMNS),
        intervals=pd.DataFrame(columns=[*INTERVAL_COLUMNS, "curated"]),
        evidence=as_table(frames[["frame", "whisker"]], EVIDENCE_COLUMNS),
    )


def find_contacts(
    frames: pd.DataFrame,
    evidence: pd.DataFrame,
    recording: Recording,
    whiskers: dict,
    options: ContactOptions = ContactOptions(),
    corrections=None,
) -> ContactTables:
    """Contacts, a person's corrections, forces, pulses and base loads, from the evidence.

    Parameters
    ----------
    frames, evidence : as `pipeline.forces.estimate_forces` returns them
    whiskers : name → Whisker; None where its dimensions are not known: then contacts are found,
        but no forces
    corrections : table of a person's corrections (pipeline.contacts.corrections), or None
    """
    from pipeline.contacts import base_moments, pulses

    params, method = options.params.contacts, options.method
    evidence = add_probability(evidence, recording, params)
    rate = recording.frames_per_second
    intervals = find_intervals(evidence, options.curvature_at, rate, params=params)
    intervals["curated"] = False
    if corrections is not None:
        intervals = _correct(intervals, corrections, evidence)
    frames = frames.assign(
        in_contact=in_contact(frames, intervals),
        contact_probability=evidence["probability"].to_numpy(),
    )
    frames = forces.add_forces(frames, evidence, whiskers, method)
    contacts = contact_table(frames, evidence, intervals, recording, options.video, method)
    contacts = pulses.add_pulses(contacts, frames, recording)
    contacts = base_moments.add_base_moments(contacts, frames, whiskers, recording)
    contacts = contacts.assign(**peak_errors(contacts, evidence, whiskers))
    return ContactTables(as_table(frames, FRAME_COLUMNS), contacts, intervals, evidence)


def _correct(intervals, corrections, evidence):
    """Apply a person's corrections; give added contacts a side and a probability."""
    from pipeline.contacts.corrections import applicable, apply

    n_frames = int(evidence["frame"].max()) + 1 if len(evidence) else 0
    corrections = applicable(corrections, set(evidence["whisker"]), n_frames)
    intervals = apply(intervals, corrections).reset_index(drop=True)
    for i in intervals.index[intervals["curated"]]:
        row = intervals.loc[i]
        part = evidence[evidence["whisker"] == row["whisker"]].sort_values("frame")
        inside = part["frame"].between(row["onset_frame"], row["offset_frame"] - 1)
        sides = part.loc[inside, "side"].sum()
        intervals.loc[i, "side"] = int(np.sign(sides)) or 1
        intervals.loc[i, "probability"] = 1.0
    return intervals
