"""The error budget of a session: how much each source of error changes the peak forces."""

from typing import NamedTuple

import numpy as np
import pandas as pd

MIDDLE = 0.7  # of the way to the contact: the taper counts as it does there


class Assumed(NamedTuple):
    """A quantity whose error no table has: the standard error assumed for it, and why.

    `column` of the contacts is how much the peak force changes for 1 % of it; None: that follows
    from the taper.
    """

    source: str
    column: str | None
    size: float
    why: str


ASSUMED = (
    Assumed(
        "base radius",
        "radius_uN_per_percent",
        0.01,
        "a good micrograph; force scales with its fourth power",
    ),
    Assumed("cone length (taper)", None, 0.02, "a tip radius known to about 0.7 µm"),
    Assumed("Young's modulus", "modulus_uN_per_percent", 0.05, "a ring-down of the same whisker"),
    Assumed("scale of the image", "scale_uN_per_percent", 0.005, "a ruler in the whisker's plane"),
)
MEASURED = (  # source, column, note
    (
        "standard error in the tables",
        "peak_force_se_uN",
        "peak_force_se_uN: tracking noise, rest shape, hidden length",
    ),
    ("of it: tracking noise", "tracking_se_uN", "and how well the rest shape is known"),
    (
        "of it: hidden length",
        "hidden_length_se_uN",
        "where the trace begins: from the length given, tip and bending",
    ),
)


def taper_share(cone_length, contact):
    """Relative change of the force for one of the cone length.

    It goes with the bent part's stiffness, E I ~ (1 − s/L_in)⁴; `cone_length` L_in and `contact`
    (arc length), both [m].
    """
    middle = MIDDLE * contact
    return 4 * middle / (cone_length - middle)


def session_budget(contacts: pd.DataFrame, whiskers: dict) -> list[dict]:
    """Sources of error of a session's peak forces, with the sizes of their effects.

    Parameters
    ----------
    contacts : CONTACT_COLUMNS
    whiskers : (video, whisker) → Whisker, or None where its dimensions are not known

    Returns
    -------
    Rows with `source`, `known` ("measured", "assumed" or "sum"), `size` (text, one standard
    error), `low`, `middle`, `high` (5 %, median, 95 % over the contacts, relative to the peak
    force), `span` (text), `note`. Empty where no contact has a force.
    """
    keys = zip(contacts["video"], contacts["whisker"], strict=True)
    given = [whiskers.get(key) for key in keys]
    known = (contacts["peak_force_uN"] > 0) & np.array([each is not None for each in given], bool)
    contacts = contacts.assign(cone_length=[w and w.cone_length for w in given])[known]
    if contacts.empty:
        return []
    measured = [
        (source, "measured", "", _share(contacts, column), note)
        for source, column, note in MEASURED
    ]
    assumed = [
        (item.source, "assumed", f"{100 * item.size:g} %", item.size * _effect(contacts, item),
         item.why)
        for item in ASSUMED
    ]  # fmt: skip
    parts = [np.nan_to_num(measured[0][3]), *(row[3] for row in assumed)]
    total = np.sqrt(sum(part**2 for part in parts))
    whole = ("all together", "sum", "", total, "square root of the sum of squares")
    return [_row(*row) for row in (*measured, *assumed, whole)]


def _share(contacts, column):
    """A column over the peak force, (contacts,)."""
    return (contacts[column] / contacts["peak_force_uN"]).to_numpy(float)


def _effect(contacts, item):
    """Relative change of the peak force for one of an assumed quantity, (contacts,)."""
    if item.column is not None:
        return 100 * _share(contacts, item.column)
    place = 1e-3 * contacts["contact_arc_length_mm"]
    return taper_share(contacts["cone_length"].astype(float), place).to_numpy()


def _row(source, known, size, share, note):
    low, middle, high = pd.Series(share).quantile([0.05, 0.5, 0.95])
    spread = {"low": low, "middle": middle, "high": high}
    texts = [f"{100 * v:.1f}" for v in (low, high)]
    span = f"{'–'.join(texts)} %" if texts[0] != texts[1] else ""
    return {"source": source, "known": known, "size": size, **spread, "span": span, "note": note}
