"""A person's corrections of contacts, as data: corrections.csv, and contacts with them applied.

A correction is a verdict over a stretch of one whisker's frames: in [covers_from, covers_to)
there is this contact and no other, or there is none. It refers neither to the contact's number
nor to how the program found it, so it holds when the video is processed again.
"""

import contextlib
import itertools
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from pipeline.errors import CorrectionsError, InputError, counted
from pipeline.tables.columns import CORRECTION_COLUMNS, DECISION_COLUMNS, as_table, empty_table
from pipeline.tables.files import read_csv, read_numbered_csv, replace_csv

CORRECTIONS_FILE = "corrections.csv"  # of a video
DECISIONS_FILE = "decisions.csv"  # of all videos, made of these
CONTACT, CONFIRMED, FREE = "contact", "confirmed", "free"
VERDICTS = (CONTACT, CONFIRMED, FREE)
MOSTLY = 0.5  # a detected contact is dropped if a verdict covers more than this part of it


class Verdict(NamedTuple):
    """One row of corrections.csv; frames are half-open."""

    whisker: str
    verdict: str
    onset_frame: int
    offset_frame: int
    covers_from: int
    covers_to: int
    saved_at: str = ""
    saved_by: str = ""

    @property
    def span(self):
        """(onset, offset)."""
        return self.onset_frame, self.offset_frame

    @property
    def cover(self):
        """(covers_from, covers_to)."""
        return self.covers_from, self.covers_to

    def lies_in(self, contact) -> bool:
        """Whether all frames that it speaks of are those of a contact of the same whisker."""
        inside = overlap(self.cover, (contact.onset_frame, contact.offset_frame))
        return self.whisker == contact.whisker and inside == self.covers_to - self.covers_from


FRAMES = Verdict._fields[2:6]  # columns that hold numbers of frames


def read_corrections(folder) -> pd.DataFrame:
    """Read corrections.csv of a video's results folder; no rows if nobody has curated the video.

    Raises
    ------
    CorrectionsError
        Where the file is no table of corrections; it names file, line and what is expected.
    """
    path = Path(folder) / CORRECTIONS_FILE
    if not path.exists():
        return empty_table(CORRECTION_COLUMNS)
    try:
        corrections, lines = read_numbered_csv(path, CORRECTION_COLUMNS, advice="")
    except ValueError as error:
        raise CorrectionsError(str(error)) from None
    for line, fault in _faults(lines, corrections, "line"):
        raise CorrectionsError(f"{path}: line {line}: {fault}")
    return corrections


def corrections_given(corrections) -> pd.DataFrame | None:
    """Corrections as Python code gives them: None, or a table that is checked as a file's is.

    Raises
    ------
    InputError
        Where it is something else; it names the row and what is expected.
    """
    if corrections is None:
        return None
    if not isinstance(corrections, pd.DataFrame):
        raise InputError(
            f"corrections: expected a table, as `pipeline.contacts.read_corrections(folder)` "
            f"gives, got {type(corrections).__name__}"
        )
    known, there = set(Verdict._fields), set(map(str, corrections.columns))
    if there - known or known - set(Verdict._field_defaults) - there:
        raise InputError(
            f"corrections: expected the columns {', '.join(Verdict._fields)}, got "
            f"{', '.join(sorted(there)) or 'none'}"
        )
    frames = corrections[list(FRAMES)].apply(pd.to_numeric, errors="coerce")
    for row in np.flatnonzero((frames % 1 != 0).any(axis=1)):
        given = ", ".join(map(str, corrections[list(FRAMES)].iloc[row]))
        raise InputError(
            f"corrections: row {row}: expected whole numbers as {', '.join(FRAMES)}, got {given}"
        )
    for row, fault in _faults(range(len(corrections)), corrections, "row"):
        raise InputError(f"corrections: row {row}: {fault}")
    return corrections


def write_corrections(folder, corrections: pd.DataFrame) -> list[str]:
    """Write corrections.csv into a video's results folder; one edited by hand is kept, too.

    Returns a sentence on that, if there is anything to say.
    """
    return replace_csv(Path(folder) / CORRECTIONS_FILE, corrections, CORRECTION_COLUMNS)


def verdicts(corrections: pd.DataFrame) -> tuple[Verdict, ...]:
    """Return the rows of a table of corrections."""
    corrections = as_table(corrections, CORRECTION_COLUMNS)
    return tuple(Verdict(*row) for row in corrections.itertuples(index=False, name=None))


def table_of(rows) -> pd.DataFrame:
    """Return the table of corrections with these `Verdict` rows."""
    return as_table(pd.DataFrame(list(rows), columns=Verdict._fields), CORRECTION_COLUMNS)


def _faults(numbers, corrections, what):
    """Numbers of `what` is wrong in a table of corrections, rows or a file's lines, and why."""
    numbered = list(zip(numbers, verdicts(corrections), strict=True))
    faults = [(number, fault) for number, verdict in numbered if (fault := _fault(verdict))]
    return faults or itertools.chain(_clashes(numbered, what), _contradictions(numbered, what))


def _fault(verdict):
    """Say what is wrong with a verdict, '' if nothing."""
    if verdict.verdict not in VERDICTS:
        return f"verdict is {verdict.verdict!r}, expected one of {', '.join(VERDICTS)}"
    if not 0 <= verdict.onset_frame < verdict.offset_frame:
        return (
            f"onset_frame {verdict.onset_frame} and offset_frame {verdict.offset_frame}: "
            "expected 0 <= onset_frame < offset_frame"
        )
    if verdict.covers_from > verdict.onset_frame or verdict.covers_to < verdict.offset_frame:
        return f"covers {verdict.cover} must contain onset and offset {verdict.span}"
    return ""


def _clashes(numbered, what):
    """Yield the number of a contact that has frames of another one, and what is wrong with it."""
    contacts = sorted(
        (verdict.whisker, verdict.span, line)
        for line, verdict in numbered
        if verdict.verdict != FREE
    )
    for (name, span, line), (other, later, number) in itertools.pairwise(contacts):
        if name == other and overlap(span, later):
            yield (
                number,
                f"contact {later} of {name!r} has frames of contact {span} in {what} {line}: keep "
                "one of them",
            )


def _contradictions(numbered, what):
    """Yield the number of a row that denies what another one states, and what is wrong with it.

    Around a contact it may deny others.
    """
    contacts = [(verdict, number) for number, verdict in numbered if verdict.verdict != FREE]
    for number, free in numbered:
        stated = (each for each in contacts if free.verdict == FREE and free.lies_in(each[0]))
        for contact, other in stated:
            yield (
                number,
                f"no contact of {free.whisker!r} in {free.cover}, but {what} {other} has contact "
                f"{contact.span} there: delete one of the two",
            )


def applicable(corrections: pd.DataFrame, whiskers, n_frames: int) -> pd.DataFrame:
    """Return the corrections of these whiskers, cut off at the end of the video."""
    rows = [
        row._replace(
            offset_frame=min(row.offset_frame, n_frames), covers_to=min(row.covers_to, n_frames)
        )
        for row in verdicts(corrections)
        if row.whisker in whiskers and row.onset_frame < n_frames
    ]
    return table_of(rows)


def decisions_in_words(results) -> str:
    """How many decisions there are, as "2 decisions in mouse1"; "" where none."""
    videos = []
    with contextlib.suppress(OSError, ValueError):  # nobody has, or it is another's file
        videos = list(read_csv(Path(results) / DECISIONS_FILE, DECISION_COLUMNS)["video"])
    names = set(videos)
    where = videos[0] if len(names) == 1 else f"{len(names)} videos"
    return f"{counted(len(videos), 'decision')} in {where}" if videos else ""


def left_out(corrections: pd.DataFrame, whiskers, n_frames: int):
    """Yield sentences on corrections that cannot be applied; the file keeps them."""
    rows = verdicts(corrections)
    for name in dict.fromkeys(row.whisker for row in rows if row.whisker not in whiskers):
        count = sum(row.whisker == name for row in rows)
        yield (
            f"{CORRECTIONS_FILE}: {count} of {name!r}, which is not a whisker of this video "
            f"({', '.join(map(str, whiskers)) or 'none'}): not applied; use one name in both"
        )
    late = sum(row.offset_frame > n_frames for row in rows)
    if late:
        yield (
            f"{CORRECTIONS_FILE}: {late} reach beyond the video's end "
            f"(it has {counted(n_frames, 'frame')})"
        )


def apply(intervals: pd.DataFrame, corrections: pd.DataFrame) -> pd.DataFrame:
    """Return the contact intervals with a person's corrections on top.

    Parameters
    ----------
    intervals : a row per detected contact: `whisker`, `onset_frame`, `offset_frame` (half-open)
        and any other columns
    corrections : table of CORRECTION_COLUMNS

    Returns
    -------
    The same columns and `curated` (bool), ordered by whisker and onset. A verdict replaces a
    detected contact of which it covers more than half; others lose only the covered frames. A
    moved contact keeps the other columns of the detected one that it replaces. In an added one
    they are missing ("" for text, False for bool).
    """
    rows = verdicts(corrections)
    detected = [Interval.of(row) for row in intervals.to_dict("records")]
    kept = [piece for each in detected for piece in each.without(rows)]
    stated = [_stated(row, detected) for row in rows if row.verdict != FREE]
    order = {w: k for k, w in enumerate(dict.fromkeys(i.whisker for i in detected + stated))}
    result = sorted(kept + stated, key=lambda i: (order[i.whisker], i.onset, i.offset))
    return _interval_table(result, intervals)


class Interval(NamedTuple):
    """A contact of one whisker over [onset, offset); `other` holds its remaining columns."""

    whisker: str
    onset: int
    offset: int
    other: dict
    curated: bool = False

    @classmethod
    def of(cls, row: dict):
        """Take a table's row."""
        other = dict(row)
        other.pop("curated", None)
        names = "whisker", "onset_frame", "offset_frame"
        return cls(*(other.pop(name) for name in names), other)

    def without(self, rows) -> list["Interval"]:
        """Return what the verdicts leave of this detected contact: all, pieces or nothing."""
        pieces = [self]
        for row in rows:
            if row.whisker != self.whisker:
                continue
            share = overlap((self.onset, self.offset), row.cover) / (self.offset - self.onset)
            if share > MOSTLY:
                return []
            if share:
                pieces = [part for piece in pieces for part in piece.outside(*row.cover)]
        return pieces

    def outside(self, start, stop) -> list["Interval"]:
        """Return the parts that lie before `start` and from `stop` on."""
        if stop <= self.onset or start >= self.offset:
            return [self]
        before = self._replace(offset=start, curated=True)
        after = self._replace(onset=stop, curated=True)
        return [part for part in (before, after) if part.onset < part.offset]


def overlap(a, b) -> int:
    """Return the number of frames that two half-open stretches have in common."""
    return max(0, min(a[1], b[1]) - max(a[0], b[0]))


def _stated(row, detected):
    """Return a verdict's contact, with the other columns of the detected one it replaces."""
    same = [i for i in detected if i.whisker == row.whisker]
    nearest = max(same, key=lambda i: overlap((i.onset, i.offset), row.cover), default=None)
    if nearest is None or not overlap((nearest.onset, nearest.offset), row.cover):
        return Interval(row.whisker, *row.span, {}, curated=True)
    as_found = row.verdict == CONFIRMED and (nearest.onset, nearest.offset) == row.span
    return Interval(row.whisker, *row.span, nearest.other, curated=not as_found)


def _interval_table(result, like):
    """Table of intervals with the columns and dtypes of `like`, and `curated`."""
    dtypes = like.dtypes.drop("curated", errors="ignore")
    missing = {"f": float("nan"), "i": 0, "b": False}
    blank = {name: missing.get(dtype.kind, "") for name, dtype in dtypes.items()}
    rows = [
        blank | i.other | {"whisker": i.whisker, "onset_frame": i.onset, "offset_frame": i.offset}
        for i in result
    ]
    table = pd.DataFrame(rows, columns=list(dtypes.index)).astype(dtypes)
    return table.assign(curated=[bool(i.curated) for i in result])
