"""What there is to look at in one video: contacts, and stretches that might be contacts."""

import itertools
from dataclasses import dataclass, field

import numpy as np
import pandas as pd

from pipeline.contacts.corrections import CONFIRMED
from pipeline.curate.review import Review, Span, spans_of
from pipeline.numerics.runs import runs_of_true
from pipeline.tables.columns import split_flags

SHORT_MS = 5.0
WEAK_UN = 1.0
CLOSE_MS = 5.0  # two contacts so close together might be one
UNSURE = 0.05, 0.95  # probabilities between which a frame is neither free nor in contact
EDGE_FRAMES = 3
POSSIBLE = 0.2  # probability that a stretch must reach to be shown

# What a flag of contacts.csv means to a person who decides, and how doubtful it makes a contact.
FLAGS = {
    "doubtful": (0.9, "evidence is thin"),
    "faint_force": (0.6, "force is within its error: found by the distance"),
    "gaps_in_trace": (0.6, "trace has gaps"),
    "bends_unlike_rod": (0.5, "bends as its rod does not: the right whisker?"),
    "no_rest_curvature": (0.5, "rest shape unknown"),
    "slip": (0.4, "slips off: is the end right?"),
    "starts_before": (0.2, "cut off by the video's start"),
    "ends_after": (0.2, "cut off by the video's end"),
}
OTHER_FLAG = 0.1  # says something of the force, not of the contact
DOUBTFUL = 0.3


@dataclass(frozen=True)
class Item:
    """A contact, or a stretch that might be one.

    Attributes
    ----------
    span : whisker and frames
    state : "detected", "confirmed" or "curated" contact; "possible" or "dismissed" stretch
    doubt : 0–1; 0 once a person has looked at it
    reasons : why it is doubtful
    values : its row of contacts.csv, {} where it is not made yet
    """

    span: Span
    state: str
    doubt: float = 0.0
    reasons: tuple[str, ...] = ()
    values: dict = field(default_factory=dict)

    @property
    def is_contact(self) -> bool:
        """It counts as a contact."""
        return self.state in ("detected", "confirmed", "curated")

    @property
    def is_doubtful(self) -> bool:
        """It should be looked at before others."""
        return self.doubt >= DOUBTFUL

    @property
    def is_open(self) -> bool:
        """No person has said anything of it yet."""
        return self.state in ("detected", "possible")


def items_of(review: Review, contacts: pd.DataFrame, probability: dict) -> list[Item]:
    """All contacts and possible contacts of a video, by onset.

    Parameters
    ----------
    review : contacts with a person's verdicts
    contacts : table of CONTACT_COLUMNS; its rows are matched by their frames
    probability : of contact, by whisker and frame, see `probabilities`
    """
    rows = dict(zip(spans_of(contacts), contacts.to_dict("records"), strict=True))
    detected = set(spans_of(review.detected))
    items = []
    for name, values in probability.items():
        spans = review.of_whisker(name)
        for span, gap in zip(spans, _gaps(spans), strict=True):
            items.append(_contact_item(span, review, detected, rows.get(span, {}), values, gap))
        for span in _possible(spans, [s for s in detected if s.whisker == name], name, values):
            items.append(_possible_item(span, review, values))
    return sorted(items, key=lambda item: (item.span.onset, item.span.whisker))


def probabilities(evidence: pd.DataFrame) -> dict[str, np.ndarray]:
    """Probability of contact: whisker → (frames,), 0 where it is not known."""
    whisker = evidence["whisker"].to_numpy()
    frame, values = (evidence[name].to_numpy() for name in ("frame", "probability"))
    n = int(frame.max()) + 1 if len(frame) else 0
    out = {}
    for name in dict.fromkeys(whisker):
        rows = whisker == name
        out[str(name)] = np.zeros(n)
        out[str(name)][frame[rows]] = np.nan_to_num(values[rows].astype(float))
    return out


def _gaps(spans):
    """Frames from every contact of a whisker to the nearest other one."""
    between = [b.onset - a.offset for a, b in itertools.pairwise(spans)]
    return [min(pair) for pair in zip([np.inf, *between], [*between, np.inf], strict=True)][
        : len(spans)
    ]


def _contact_item(span, review, detected, row, probability, gap):
    verdict = review.verdict_on(span)
    if verdict is not None:
        as_found = verdict.verdict == CONFIRMED and span in detected
        return Item(span, "confirmed" if as_found else "curated", values=row)
    doubts = sorted(_doubts(span, row, probability, gap), reverse=True)
    reasons = tuple(text for _, text in doubts)
    return Item(span, "detected", doubts[0][0] if doubts else 0.0, reasons, row)


def _doubts(span, row, probability, gap):
    """Yield (how doubtful, why)."""
    inside = probability[span.onset : span.offset]
    if inside.size and inside.max() < UNSURE[1]:
        yield 1 - 0.5 * inside.max(), f"probability {inside.max():.2f}"
    for edge, name in ((span.onset, "onset"), (span.offset, "offset")):
        near = probability[max(edge - EDGE_FRAMES, 0) : edge + EDGE_FRAMES]
        if ((near > UNSURE[0]) & (near < UNSURE[1])).any():
            yield 0.45, f"{name} not sharp"
    duration, force = row.get("duration_ms", np.inf), row.get("peak_force_uN", np.inf)
    if duration < SHORT_MS:
        yield 0.5, f"short, {duration:.3g} ms"
    if force < WEAK_UN:
        yield 0.6, f"weak, {force:.2g} µN"
    if duration > 0 and np.isfinite(duration):
        gap_ms = gap * duration / (span.offset - span.onset)
        if gap_ms < CLOSE_MS:
            yield 0.4, f"{gap_ms:.3g} ms from the next"
    for flag in split_flags(row.get("flags", "")):
        yield FLAGS.get(flag, (OTHER_FLAG, flag.replace("_", " ")))


def _possible(contacts, detected, whisker, probability):
    """Stretches without contact that were detected (and deleted), or nearly so."""
    found = [
        Span(whisker, start, stop)
        for start, stop in runs_of_true(probability > UNSURE[0])
        if probability[start:stop].max() > POSSIBLE
    ]
    taken = np.zeros(len(probability) + 1, dtype=bool)
    for span in contacts:
        taken[span.onset : span.offset] = True
    kept = []
    for span in [*sorted(detected), *found]:
        if not taken[max(span.onset - 1, 0) : span.offset + 1].any():
            kept.append(span)
            taken[span.onset : span.offset] = True
    return kept


def _possible_item(span, review, probability):
    if review.dismissed(span):
        return Item(span, "dismissed")
    largest = float(probability[span.onset : span.offset].max())
    reason = f"no contact, though probability reaches {largest:.2f}"
    return Item(span, "possible", max(DOUBTFUL, 0.7 * largest), (reason,))
