"""What there is to look at in one video: contacts, and stretches that might be contacts."""

from dataclasses import dataclass, field

import numpy as np
import pandas as pd

from pipeline.curate.review import Review, Span, spans_of
from pipeline.curation import overlap

SHORT_MS = 5.0
WEAK_UN = 1.0
CLOSE_MS = 5.0  # two contacts so close together might be one
UNSURE = 0.05, 0.95  # probabilities between which a frame is neither free nor in contact
EDGE_FRAMES = 3
POSSIBLE = 0.2  # probability that a stretch must reach to be shown

# What a flag of contacts.csv means to someone who has to decide, and how doubtful it makes it.
FLAGS = {
    "doubtful": (0.9, "evidence is thin"),
    "gaps_in_trace": (0.6, "trace has gaps"),
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


def items_of(review: Review, contacts: pd.DataFrame, evidence: pd.DataFrame) -> list[Item]:
    """All contacts and possible contacts of a video, by onset.

    Parameters
    ----------
    review : contacts with a person's verdicts
    contacts : table of CONTACT_COLUMNS; its rows are matched by their frames
    evidence : table with `whisker`, `frame`, `probability`
    """
    rows = dict(zip(spans_of(contacts), contacts.to_dict("records"), strict=True))
    probability = {name: _by_frame(part) for name, part in evidence.groupby("whisker", sort=False)}
    items = [
        _contact_item(span, review, rows.get(span, {}), probability[span.whisker])
        for span in review.spans
    ]
    for name, values in probability.items():
        items += [_possible_item(span, review, values) for span in _possible(review, name, values)]
    return sorted(items, key=lambda item: (item.span.onset, item.span.whisker))


def _by_frame(part):
    """Probability of every frame, 0 where there is none."""
    values = np.zeros(int(part["frame"].max()) + 1)
    values[part["frame"].to_numpy()] = np.nan_to_num(part["probability"].to_numpy(float))
    return values


def _contact_item(span, review, row, probability):
    verdict = review.verdict_on(span)
    if verdict is not None:
        detected = span in spans_of(review.detected)
        state = "confirmed" if verdict.verdict == "confirmed" and detected else "curated"
        return Item(span, state, values=row)
    doubts = sorted(_doubts(span, review, row, probability), reverse=True)
    reasons = tuple(text for _, text in doubts)
    return Item(span, "detected", doubts[0][0] if doubts else 0.0, reasons, row)


def _doubts(span, review, row, probability):
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
        gap = _gap(span, review) * duration / (span.offset - span.onset)
        if gap < CLOSE_MS:
            yield 0.4, f"{gap:.3g} ms from the next"
    for flag in filter(None, str(row.get("flags", "")).split(";")):
        yield FLAGS.get(flag, (OTHER_FLAG, flag.replace("_", " ")))


def _gap(span, review):
    """Frames to the nearest other contact of the whisker."""
    gaps = [
        max(other.onset - span.offset, span.onset - other.offset)
        for other in review.of_whisker(span.whisker)
        if other != span
    ]
    return min(gaps, default=np.inf)


def _possible(review, whisker, probability):
    """Stretches without contact that were detected (and deleted), or nearly so."""
    contacts = review.of_whisker(whisker)
    found = [s for s in spans_of(review.detected) if s.whisker == whisker]
    found += [
        Span(whisker, int(start), int(stop))
        for start, stop in _runs(probability > UNSURE[0])
        if probability[start:stop].max() > POSSIBLE
    ]
    kept = []
    for span in found:
        taken = contacts + kept
        if not any(overlap((s.onset - 1, s.offset + 1), span[1:]) for s in taken):
            kept.append(span)
    return kept


def _runs(mask):
    change = np.diff(np.concatenate([[0], mask.astype(np.int8), [0]]))
    return zip(np.flatnonzero(change == 1), np.flatnonzero(change == -1), strict=True)


def _possible_item(span, review, probability):
    if review.dismissed(span):
        return Item(span, "dismissed")
    largest = float(probability[span.onset : span.offset].max())
    reason = f"no contact, though probability reaches {largest:.2f}"
    return Item(span, "possible", max(DOUBTFUL, 0.7 * largest), (reason,))
