"""The outcome of one video, and whether results of earlier runs are whole and still hold."""

import contextlib
from dataclasses import asdict, dataclass, field, replace

from pipeline import __version__
from pipeline.contacts.corrections import read_corrections
from pipeline.curate.corrected import MADE_WITH, corrections_digest, settings_of_results
from pipeline.errors import CorrectionsError, counted, in_words
from pipeline.session.content import same_input, stamp
from pipeline.session.session_file import SettingsError
from pipeline.tables import files
from pipeline.tables.columns import (
    CENTRELINE_COLUMNS,
    CONTACT_COLUMNS,
    EVIDENCE_COLUMNS,
    FRAME_COLUMNS,
)
from pipeline.tables.result_exchange import is_settled
from pipeline.tables.run_record import STATE_FILE, read_state, write_state
from pipeline.tables.video_messages import sentences_of

PARQUETS = {
    "centrelines.parquet": CENTRELINE_COLUMNS,
    "frames.parquet": FRAME_COLUMNS,
    "evidence.parquet": EVIDENCE_COLUMNS,
}
BULLET = "  - "


@dataclass(frozen=True)
class Outcome:
    """What became of one video: a row of videos.csv, and for run.json how it was made.

    `status` is "done", "warning" or "failed"; `details` is the traceback of a fault. `frames` is
    0 where there are no results; where a video failed, those of before may be there.
    """

    video: str
    path: str
    status: str
    frames: int = 0
    frames_per_s: float = 0.0
    message: str = ""
    contacts: int = 0
    stages: dict = field(default_factory=dict)
    sha256: str = ""
    pole: dict | None = None
    details: str = ""

    def line(self) -> str:
        """The outcome in one line."""
        if self.status == "failed":
            return f"failed: {self.message}"
        message = f"; {self.message}" if self.message else ""
        return f"{self._state()}{message}"

    def lines(self, said: set) -> list[str]:
        """The outcome in a line, below it the messages that are not yet `said`; adds them to it.

        So a message that holds for all videos of a run is shown with the first one only.
        """
        if self.status == "failed":
            return [self.line()]
        return [self._state(), *_new_lines(sentences_of(self.message), said)]

    def warning_lines(self, said: set) -> list[str]:
        """The messages alone, as of `lines`, where the outcome has been shown before."""
        head, lines = f"warning: {self.video}:", _new_lines(sentences_of(self.message), said)
        return [f"{head} {lines[0].removeprefix(BULLET)}"] if len(lines) == 1 else [head, *lines]

    def _state(self) -> str:
        return (
            f"{self.status}, {counted(self.frames, 'frame')}, {self.frames_per_s:.0f} frames/s, "
            f"{counted(self.contacts, 'contact')}"
        )


def _new_lines(sentences, said: set) -> list[str]:
    """A line for each sentence that is not `said` yet, and one that counts the others."""
    new = [each for each in sentences if each not in said]
    said.update(new)
    lines, before = [f"{BULLET}{each}" for each in new], len(sentences) - len(new)
    if before:
        lines.append(f"{BULLET}{'and ' if new else ''}{counted(before, 'message')} as above")
    return lines


# --- what earlier runs left ----------------------------------------------------------------


def finished_outcome(path, folder, digest) -> Outcome | None:
    """The outcome of an earlier run whose results still hold for a video, or None.

    `digest` is that of the settings. Results hold if version, settings, corrections and the
    input's content are the same, and all files are there and whole. The content is read only where
    size or times differ. A video that has been moved keeps its results; its new place is written
    into their record.
    """
    state = read_state(folder)
    if state.get("version") != __version__ or kept_outcome(folder) is None:
        return None
    if state["settings_sha256"] != digest or not same_input(state, path):
        return None
    if not _has_sound_corrections(folder):
        return None  # to process it anew says why not
    now = {"path": str(path), "input": stamp(path)}
    if state | now != state:
        state |= now
        with contextlib.suppress(OSError):  # hearing it twice does no harm
            write_state(folder, state)
    return _outcome(state)


def kept_outcome(folder) -> Outcome | None:
    """The outcome of whole results in a folder, whatever their settings and version."""
    state = read_state(folder)
    return _outcome(state) if state and is_settled(folder) and not damage(folder, state) else None


def damage(folder, state) -> str:
    """What is wrong with the files of a video's results, '' if nothing.

    Only what was written after the video was finished (by a curation, or by a fault of the disk)
    is read throughout; of other tables, beginning and end.
    """
    written = (folder / STATE_FILE).stat().st_mtime_ns
    try:
        for name, columns in PARQUETS.items():
            changed = (folder / name).stat().st_mtime_ns >= written
            known = columns if state["version"] == __version__ else ()
            files.check_parquet(folder / name, known, thorough=changed)
        files.read_csv(folder / "contacts.csv", CONTACT_COLUMNS)
        if (folder / "session.toml").stat().st_mtime_ns >= written:
            settings_of_results(folder)
    except (OSError, ValueError, SettingsError) as error:
        return in_words(error)
    return ""


def earlier_results(folder, path, digest) -> str:
    """Say that earlier results are kept, and in what they differ from those that are due."""
    state = read_state(folder)
    if state.get("version") != __version__:
        return f"earlier results kept, made by version {state.get('version')}"
    if state["settings_sha256"] != digest:
        return "earlier results kept, made with other settings"
    if not same_input(state, path):
        return "earlier results kept, made of the video before it changed"
    return "earlier results kept"


def failure(folder, path, message, kept_results="earlier results kept") -> Outcome:
    """The outcome of a failure; the message says that earlier results stay, if there are any."""
    kept = kept_outcome(folder)
    message = " ".join(message.split())
    if kept is None:
        return Outcome(folder.name, path, "failed", message=message)
    return replace(kept, path=path, status="failed", message=f"{message}; {kept_results}")


def save_state(folder, outcome, corrections, known) -> None:
    """Write how the results in `folder` were made: with `corrections`, and what is `known`."""
    state = {
        "version": __version__,
        **{key: value for key, value in asdict(outcome).items() if key != "details"},
        MADE_WITH: corrections_digest(corrections),
        **known,
    }
    write_state(folder, state)


def _has_sound_corrections(folder) -> bool:
    with contextlib.suppress(CorrectionsError):
        read_corrections(folder)
        return True
    return False


def _outcome(state) -> Outcome:
    return Outcome(**{k: v for k, v in state.items() if k in Outcome.__dataclass_fields__})
