"""A results folder under curation: its videos, and their tables kept in step with corrections."""

import contextlib
import threading
import time
import weakref
from collections import OrderedDict, deque
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import pandas as pd

from pipeline.contacts import analysis, intervals
from pipeline.contacts.corrections import CORRECTIONS_FILE, read_corrections, write_corrections
from pipeline.curate.corrected import (
    contacts_with,
    finished_videos,
    save_contacts,
    session_contacts,
    settings_of_results,
)
from pipeline.curate.decisions import write_decisions
from pipeline.curate.frames import FrameReader
from pipeline.curate.items import Item, items_of, probabilities
from pipeline.curate.review import Review
from pipeline.errors import InputError, VideoError, in_words
from pipeline.scene import pole_runs
from pipeline.session.content import check_video
from pipeline.session.results_folders import need_results
from pipeline.tables import centrelines, files
from pipeline.tables.columns import CONTACT_COLUMNS
from pipeline.tables.evidence import EVIDENCE_FILE, read_evidence
from pipeline.tables.known_names import never_shown
from pipeline.tables.run_record import found_video, frame_count, read_pole, recorded_path
from pipeline.video.open import open_video

LINES_AROUND = 256  # frames whose centrelines are read together
LINE_BLOCKS = 16  # such blocks kept
DELAY_S = 0.2  # before tables are made: the page has answered by then
KEPT_OPEN = 8  # videos whose tables and undo history stay in memory


@dataclass(frozen=True)
class Traces:
    """Time courses of one whisker, one value per frame of the video; NaN where not known.

    `would_be_force_uN` is what the frame's force would be if the whisker touched the pole.
    """

    distance_mm: np.ndarray
    curvature_change: np.ndarray
    force_uN: np.ndarray
    would_be_force_uN: np.ndarray
    probability: np.ndarray


class LastMade:
    """What was made last, and the objects that it was made from."""

    def __init__(self):
        self._last = (), None

    def of(self, make, *objects):
        """Return `make()`, or what it returned before, where it was of the same objects."""
        before, made = self._last
        if len(before) != len(objects) or any(
            a is not b for a, b in zip(before, objects, strict=True)
        ):
            made = make()
            self._last = objects, made
        return made


class VideoUnderReview:
    """One video's results: tables, contacts under review, time courses, picture, centrelines.

    Attributes
    ----------
    review : the contacts, to be edited
    tables : `contacts.ContactTables` as in the tables
    whiskers : names, in the order of the tables, of all but lines that could not be identified
    """

    def __init__(self, folder: Path, changed=None):
        self.folder = Path(folder)
        self.name = self.folder.name
        self._pole = read_pole(self.folder)
        self.settings = settings_of_results(self.folder)
        self.recording = self.settings.recording.si()
        evidence = read_evidence(self.folder)
        frames = files.read_frames(self.folder / "frames.parquet")
        self.n_frames = frame_count(self.folder, frames)
        corrections = read_corrections(self.folder)
        never = never_shown(frames) - set(corrections["whisker"])
        self.whiskers = tuple(n for n in dict.fromkeys(frames["whisker"]) if n not in never)
        detected = intervals.find_intervals(
            evidence,
            self.settings.analysis.curvature_at,
            self.recording.frames_per_second,
            params=self.settings.advanced.contacts,
        )
        contacts = files.read_csv(self.folder / "contacts.csv", CONTACT_COLUMNS)
        self.tables = analysis.ContactTables(frames, contacts, detected, evidence)
        self._changed = changed
        self.review = Review(detected, corrections, self.n_frames, self._corrected, self.whiskers)
        self._lines = OrderedDict()
        self._traces, self._items, self._probability = (LastMade() for _ in range(3))

    # ---- corrections → tables -------------------------------------------------------------

    def _corrected(self, corrections):
        kept = write_corrections(self.folder, corrections)
        if self._changed is not None:
            self._changed(self, kept)

    def update(self) -> list[str]:
        """Make contacts, forces, pulses and base moments anew from the corrections; write them.

        Returns what `save_contacts` does.
        """
        corrections, tables = self.review.corrections, self.tables
        self.tables = contacts_with(
            corrections, tables.frames, tables.evidence, self.settings, self.name
        )
        return save_contacts(self.folder, self.tables, corrections)

    # ---- to look at -----------------------------------------------------------------------

    def items(self) -> list[Item]:
        """Contacts, and stretches that might be contacts, by onset."""
        tables, verdicts = self.tables, self.review.verdicts
        probability = self._probability.of(lambda: probabilities(tables.evidence), tables)
        own = {name: values for name, values in probability.items() if name in self.whiskers}
        return self._items.of(
            lambda: items_of(self.review, tables.contacts, own), tables, verdicts
        )

    def traces(self) -> dict[str, Traces]:
        """Time courses of every whisker."""
        tables = self.tables  # another thread may replace it
        return self._traces.of(lambda: self._all_traces(tables), tables)

    def _all_traces(self, tables):
        frames, evidence = tables.frames, tables.evidence
        would_be = evidence.get("shape_force_N", pd.Series(np.nan, evidence.index))
        table = frames.assign(would_be=1e6 * would_be.to_numpy())
        return {
            name: self._traces_of(part)
            for name, part in table.groupby("whisker", sort=False, observed=True)
            if name in self.whiskers
        }

    def _traces_of(self, part):
        columns = (
            "pole_distance_mm",
            "curvature_change_per_m",
            "contact_force_uN",
            "would_be",
            "contact_probability",
        )
        values = np.full((len(columns), self.n_frames), np.nan)
        values[:, part["frame"].to_numpy()] = part[list(columns)].to_numpy(float).T
        return Traces(*values)

    def pole(self, frame: int):
        """(x, y, radius) [px] of the pole, or None while it is not in view."""
        return pole_runs.pole_at(self._pole, frame)

    def centrelines(self, frame: int) -> dict[str, np.ndarray]:
        """Traced whiskers of one frame: name → points (n, 2) [px]."""
        block = frame // LINES_AROUND
        if block not in self._lines:
            self._lines[block] = self._read_lines(block)
            if len(self._lines) > LINE_BLOCKS:
                self._lines.popitem(last=False)
        self._lines.move_to_end(block)
        return self._lines[block].get(frame, {})

    no_lines = ""  # why there are none

    def _read_lines(self, block):
        start = block * LINES_AROUND
        inside = [("frame", ">=", start), ("frame", "<", start + LINES_AROUND)]
        try:
            rows = centrelines.read_centrelines(self.folder / "centrelines.parquet", inside)
        except (OSError, ValueError, KeyError) as error:
            self.no_lines = f"whiskers cannot be drawn: {in_words(error)}"
            return {}
        lines = {}
        for frame, name, points in rows.each():
            if name in self.whiskers:
                lines.setdefault(frame, {})[name] = points
        return lines

    @cached_property
    def reader(self) -> FrameReader | None:
        """The video's frames, or None where it cannot be read or is another: see `no_picture`."""
        path = found_video(self.folder, recorded_path(self.folder) or self.name)
        try:
            open_video(path).close()
            check_video(self.folder, path)
        except VideoError as error:
            self.no_picture = str(error)
            return None
        return FrameReader(path, self.n_frames)

    no_picture = ""

    def close(self):
        """Let go of the video."""
        reader = self.__dict__.pop("reader", None)
        if reader is not None:
            reader.close()


class Results:
    """All videos of a results folder; a thread keeps their tables in step with corrections.

    InputError or ValueError where there is nothing to curate, or a corrections.csv is broken.

    Attributes
    ----------
    names : the videos' results folders, in the order of videos.csv
    listeners : called from the thread, with a video whose tables are new
    """

    def __init__(self, folder, faults=None):
        self.folder = Path(folder)
        self.names = _curatable(self.folder)
        for name in self.names:
            read_corrections(self.folder / name)  # a broken file is reported first
        self.listeners = []
        self.faults = dict(faults or {})  # video → what went wrong when its tables were made
        self.kept = []  # sentences on files that a person has changed meanwhile
        self._videos = weakref.WeakValueDictionary()
        self._recent = deque(maxlen=KEPT_OPEN)
        self._opening = threading.Lock()
        self._contacts = session_contacts(self.folder, finished_videos(self.folder))
        self._due = []
        self._closed = False
        self._changed = threading.Condition()
        self._thread = threading.Thread(target=self._work, name="tables", daemon=True)
        self._thread.start()

    def video(self, name: str) -> VideoUnderReview:
        """One of the videos; the same object for all who have it, the last few are kept."""
        with self._opening:
            video = self._videos.get(name)
            if video is None:
                video = VideoUnderReview(self.folder / name, self._mark)
                self._videos[name] = video
            if video not in self._recent:
                self._recent.append(video)
            return video

    def settle(self) -> None:
        """Wait until all tables are written; those that could not be are tried once more."""
        with self._changed:
            self._due += [name for name in self.faults if name not in self._due]
            self._changed.notify_all()
            self._changed.wait_for(lambda: not self._due)

    def write_decisions(self) -> tuple[Path, int, list[str]]:
        """Write what was decided so far, by whom and when: as `decisions.write_decisions`."""
        corrections = {name: read_corrections(self.folder / name) for name in self.names}
        return write_decisions(self.folder, corrections)

    def close(self) -> None:
        """Write what is due; let go of files and thread."""
        self.settle()
        with self._changed:
            self._closed = True
            self._changed.notify_all()
        self._thread.join()
        for video in list(self._videos.values()):
            video.close()
        if any((self.folder / name / CORRECTIONS_FILE).exists() for name in self.names):
            with contextlib.suppress(OSError):  # each corrections.csv has them, too
                self.write_decisions()

    @property
    def busy(self) -> bool:
        """Some correction is not yet in the tables."""
        return bool(self._due)

    # ---- the thread -----------------------------------------------------------------------

    def _mark(self, video, kept):
        with self._changed:
            self.kept += kept
            self._due.append(video.name)
            self._changed.notify_all()

    def _work(self):
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._due or self._closed)
                if self._closed:
                    return
            time.sleep(DELAY_S)
            with self._changed:
                name, count = self._due[0], self._due.count(self._due[0])
            self._update(name)
            with self._changed:
                for _ in range(count):  # what was corrected meanwhile stays due
                    self._due.remove(name)
                self._changed.notify_all()
            for listener in list(self.listeners):
                listener(name)

    def _update(self, name):
        """Make and write one video's tables, and its rows of the whole contacts.csv."""
        try:
            video = self.video(name)
            self.kept += video.update()
            self.kept += self._replace_rows(name, video.tables.contacts)
            self.faults.pop(name, None)
        except Exception as error:  # the thread must live; corrections.csv is safe
            kind = "" if isinstance(error, OSError) else f"{type(error).__name__}: "
            self.faults[name] = f"{kind}{in_words(error)}"

    def _replace_rows(self, name, contacts):
        parts = dict(list(self._contacts.groupby("video", sort=False)))
        parts[name] = contacts
        order = [*self.names, *(n for n in parts if n not in self.names)]
        kept = [parts[n] for n in order if n in parts]
        self._contacts = pd.concat(kept, ignore_index=True)
        return files.replace_csv(self.folder / "contacts.csv", self._contacts, CONTACT_COLUMNS)


def _curatable(folder) -> list[str]:
    """Names of the videos that can be curated; InputError where there is none."""
    need_results(folder)
    done = finished_videos(folder)
    names = [name for name in done if (folder / name / EVIDENCE_FILE).is_file()]
    if not names:
        raise InputError(
            f"{folder}: no finished video with {EVIDENCE_FILE} in it; `whiskerforce run` the "
            "videos (again)"
        )
    return names
