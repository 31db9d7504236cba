"""Forces and contacts of whiskers whose kinematics are known."""

from pipeline.contacts.analysis import ContactOptions, ContactTables, find_contacts
from pipeline.forces import estimate_forces

OPTIONS = ContactOptions()


def analyse_contacts(frames, places, recording, whiskers, options=OPTIONS) -> ContactTables:
    """Rest shape, contacts, forces, pulses and base loads, without friction.

    Parameters are as for `estimate_forces` and `find_contacts`.
    """
    frames, evidence = estimate_forces(
        frames, places, whiskers, options.curvature_at,
        pixels_per_m=recording.pixels_per_m, params=options.params.forces,
    )  # fmt: skip
    return find_contacts(frames, evidence, recording, whiskers, options)
