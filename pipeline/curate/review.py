"""One video's contacts under review: every edit is a verdict, saved at once, can be undone."""

from datetime import UTC, datetime
from typing import NamedTuple

import pandas as pd

from pipeline.contacts.corrections import (
    CONFIRMED,
    CONTACT,
    FREE,
    Verdict,
    applicable,
    apply,
    overlap,
    table_of,
    verdicts,
)
from pipeline.errors import why


class EditError(ValueError):
    """An edit that makes no sense, or cannot be saved; the message says why, for the person."""


class Span(NamedTuple):
    """A stretch of one whisker's frames, [onset, offset)."""

    whisker: str
    onset: int
    offset: int

    def __contains__(self, frame):
        return self.onset <= frame < self.offset

    def __str__(self):
        return f"{self.onset}–{self.offset}"


class Review:
    """Contacts as detected, a person's verdicts on them, and what follows from both.

    Parameters
    ----------
    detected : table of contact intervals as the program found them (see `corrections.apply`)
    corrections : table of the verdicts so far
    n_frames : of the video
    save : called with the table of corrections after every change, to store it
    whiskers : names; verdicts on others are kept, but not shown. None: all there are

    Attributes
    ----------
    person : name of who makes the edits, kept with each
    """

    def __init__(
        self, detected: pd.DataFrame, corrections: pd.DataFrame, n_frames: int, save, whiskers=None
    ):
        self.detected = detected
        self.n_frames = n_frames
        self._whiskers = whiskers
        self._save = save
        self.person = ""
        self._past, self._future = [], []
        self._set(verdicts(corrections))

    def _set(self, rows):
        self.verdicts = tuple(rows)
        self.intervals = self._applied(self.verdicts)
        self.spans = spans_of(self.intervals)

    def _applied(self, rows):
        corrections = table_of(rows)
        if self._whiskers is not None:
            corrections = applicable(corrections, self._whiskers, self.n_frames)
        return apply(self.detected, corrections)

    @property
    def corrections(self) -> pd.DataFrame:
        """The verdicts as a table of CORRECTION_COLUMNS."""
        return table_of(self.verdicts)

    # ---- questions ------------------------------------------------------------------------

    def of_whisker(self, whisker) -> list[Span]:
        """Contacts of one whisker, in order of time."""
        return [span for span in self.spans if span.whisker == whisker]

    def at(self, whisker, frame) -> Span | None:
        """The contact of a whisker at a frame, or None."""
        return next((s for s in self.of_whisker(whisker) if frame in s), None)

    def verdict_on(self, span) -> Verdict | None:
        """The verdict that states this contact, or None; the video's end may cut it off."""
        stated = (v for v in self.verdicts if v.verdict != FREE and v.whisker == span.whisker)
        return next(
            (v for v in stated if (v.onset_frame, min(v.offset_frame, self.n_frames)) == span[1:]),
            None,
        )

    def dismissed(self, span) -> bool:
        """A person said that there is no contact in (most of) this stretch."""
        return any(
            v.verdict == FREE
            and v.whisker == span.whisker
            and 2 * overlap(v.cover, span[1:]) > span.offset - span.onset
            for v in self.verdicts
        )

    # ---- edits ----------------------------------------------------------------------------

    def add(self, whisker, onset, offset) -> Span:
        """Add a contact; EditError if it is empty or runs into another one."""
        span = self._checked(Span(whisker, onset, offset))
        deleted = [
            v
            for v in self.verdicts
            if v.verdict == FREE and v.whisker == whisker and overlap(v.cover, span[1:])
        ]
        self._state(span, CONTACT, [span, *deleted])
        return span

    def delete(self, span) -> None:
        """Say that there is no such contact."""
        stated = self.verdict_on(span)
        others = [v for v in self.verdicts if v is not stated]
        left = spans_of(self._applied(others))
        if stated and set(left) <= set(self.spans) - {span}:
            self._change(others)  # an added contact leaves nothing to deny
        else:
            self._state(span, FREE, [span, stated])

    def confirm(self, span) -> None:
        """Say that a contact is right as it is."""
        if self.verdict_on(span) is None:
            self._state(span, CONFIRMED, [span])

    def dismiss(self, span) -> None:
        """Say that there is no contact in a stretch that holds none: right as it is."""
        if not self.dismissed(span):
            self._state(span, FREE, [span])

    def move(self, span, onset=None, offset=None) -> Span:
        """Move one or both edges of a contact; EditError if it is no contact any more."""
        moved = Span(
            span.whisker,
            span.onset if onset is None else onset,
            span.offset if offset is None else offset,
        )
        if moved == span:
            return span
        self._checked(moved, instead_of=(span,))
        self._state(moved, CONTACT, [moved, span, self.verdict_on(span)])
        return moved

    def merge(self, span) -> Span:
        """Make one of a contact and the next one of the same whisker."""
        later = [s for s in self.of_whisker(span.whisker) if s.onset >= span.offset]
        if not later:
            raise EditError(
                f"{span.whisker} has no contact after {span} to merge with: select an earlier one"
            )
        merged = Span(span.whisker, span.onset, later[0].offset)
        stated = [self.verdict_on(span), self.verdict_on(later[0])]
        self._state(merged, CONTACT, [merged, *stated])
        return merged

    def undo(self) -> bool:
        """Take back the last edit; False if there is none."""
        return self._step(self._past, self._future)

    def redo(self) -> bool:
        """Make the edit again that was taken back last; False if there is none."""
        return self._step(self._future, self._past)

    # ---- how ------------------------------------------------------------------------------

    def _step(self, source, target):
        if not source:
            return False
        before = self.verdicts
        self._put(source[-1])
        source.pop()
        target.append(before)
        return True

    def _change(self, rows):
        before = self.verdicts
        self._put(rows)
        self._past.append(before)
        self._future.clear()

    def _put(self, rows):
        """Take these verdicts and save them; where that fails, all is as it was before."""
        before = self.verdicts
        self._set(rows)
        try:
            self._save(self.corrections)
        except OSError as error:
            self._set(before)
            raise EditError(
                f"not changed, for it cannot be saved ({why(error)}): correct this, and press the "
                "key again"
            ) from error

    def _state(self, span, verdict, about):
        """Put a verdict in place of those in `about`, over the frames of everything in it."""
        about = [each for each in about if each is not None]
        replaced = [each for each in about if isinstance(each, Verdict)]
        covers = [e.cover if isinstance(e, Verdict) else e[1:] for e in about]
        start, stop = min(c[0] for c in covers), max(c[1] for c in covers)
        if verdict == CONTACT and self._is_all_detected(span, start, stop):
            verdict = CONFIRMED
        if verdict == FREE:
            span = Span(span.whisker, start, stop)
        now = datetime.now(UTC).isoformat(timespec="seconds")
        new = Verdict(*span[:1], verdict, *span[1:], start, stop, now, self.person)
        denied = [v for v in self.verdicts if verdict != FREE and v.verdict == FREE]
        replaced += [v for v in denied if v.lies_in(new)]
        self._change([v for v in self.verdicts if v not in replaced] + [new])

    def _is_all_detected(self, span, start, stop):
        """Whether a contact is just what was detected between two frames."""
        there = Span(span.whisker, start, stop)
        return [s for s in spans_of(self.detected) if _collide(s, there)] == [span]

    def _checked(self, span, instead_of=()):
        if span.onset >= span.offset:
            raise EditError(
                f"the first frame after the contact ({span.offset}) must come behind the first "
                f"frame of contact ({span.onset}): go to another frame, then press the key again"
            )
        if span.onset < 0 or span.offset > self.n_frames:
            raise EditError(
                f"{span} is not in the video, which has frames 0 to {self.n_frames - 1}; choose "
                "edges within it"
            )
        for other in self.of_whisker(span.whisker):
            if other not in instead_of and _collide(span, other):
                raise EditError(
                    f"{span} would run into contact {other} of {span.whisker}; to make one of "
                    "two, select the earlier and press m"
                )
        return span


def spans_of(intervals: pd.DataFrame) -> list[Span]:
    """Return the spans of a table of contact intervals or contacts."""
    columns = (intervals[c] for c in ("whisker", "onset_frame", "offset_frame"))
    return [Span(str(w), int(a), int(b)) for w, a, b in zip(*columns, strict=True)]


def _collide(a, b):
    return a.whisker == b.whisker and overlap(a[1:], b[1:]) > 0
