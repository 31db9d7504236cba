"""What earlier runs left in a results folder: whether it is whole and still holds, and of what."""

import contextlib
import os
from dataclasses import replace
from pathlib import Path

from pipeline import __version__
from pipeline.app.outcome import Outcome
from pipeline.contacts.corrections import read_corrections
from pipeline.curate.corrected import settings_of_results
from pipeline.errors import CorrectionsError, InputError, in_words, some_of
from pipeline.session.content import same_input, stamp
from pipeline.session.input_settings import session_of
from pipeline.session.inputs import Input
from pipeline.session.session_file import SettingsError, read_session, settings_digest
from pipeline.tables import files
from pipeline.tables.columns import (
    CENTRELINE_COLUMNS,
    CONTACT_COLUMNS,
    EVIDENCE_COLUMNS,
    FRAME_COLUMNS,
)
from pipeline.tables.result_exchange import is_settled
from pipeline.tables.run_record import STATE_FILE, is_saved, read_state, recorded_path, write_state

PARQUETS = {
    "centrelines.parquet": CENTRELINE_COLUMNS,
    "frames.parquet": FRAME_COLUMNS,
    "evidence.parquet": EVIDENCE_COLUMNS,
}


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


def earlier_in_words(folder, path, digest) -> str:
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


def _has_sound_corrections(folder) -> bool:
    with contextlib.suppress(CorrectionsError):
        read_corrections(folder)
        return True
    return False


def _outcome(state) -> Outcome:
    return Outcome(**{k: v for k, v in state.items() if k in Outcome.__dataclass_fields__})


def of_other_videos(out, names) -> list[Outcome]:
    """Outcomes of results in `out` of videos that are not among this run's inputs."""
    folders = [path.parent for path in sorted(out.glob(f"*/{STATE_FILE}"))]
    others = [folder for folder in folders if folder.name not in names and _is_video(folder)]
    return [kept_outcome(folder) or _damaged(folder) for folder in others]


def digests_of(outcomes, out) -> set[str]:
    """Hashes of the settings that results were made with."""
    found = (read_state(out / each.video).get("settings_sha256", "") for each in outcomes)
    return set(filter(None, found))


def made_otherwise(outcomes, out, digests) -> list[str]:
    """A sentence on results whose settings have been changed since they were made, if any.

    Parameters
    ----------
    outcomes : of videos in `out` that are not among a run's inputs
    digests : of the run's settings
    """
    names = [
        each.video for each in outcomes if each.frames and _is_out_of_date(each, out, digests)
    ]
    if not names:
        return []
    were, are, them = ("was", "is", "it") if len(names) == 1 else ("were", "are", "them")
    return [
        f"{some_of(names)} {were} made with other settings than session.toml has now, and {are} "
        f"in contacts.csv beside the videos of this run: run {them} again, too"
    ]


def _is_out_of_date(outcome, out, digests) -> bool:
    """Whether results are of other settings than this run's, and than their video's now."""
    path, digest = Path(outcome.path), read_state(out / outcome.video).get("settings_sha256")
    if digest in digests or not path.exists():
        return False
    with contextlib.suppress(InputError, SettingsError, OSError):
        return digest != settings_digest(read_session(session_of(Input(path, Path(path.anchor)))))
    return False


def _is_video(folder) -> bool:
    """What a run left of a video: not a results folder within this one, nor what others wrote."""
    is_of_video = any((folder / name).exists() for name in PARQUETS)
    return is_of_video and not (folder / "videos.csv").exists() and not is_saved(folder)


def _damaged(folder) -> Outcome:
    return Outcome(
        folder.name,
        recorded_path(folder),
        "failed",
        message=f"its results are damaged: run the video again ({folder} holds what is left)",
    )


def without_lost(outcomes, paths) -> tuple[list[Outcome], tuple[str, ...]]:
    """Outcomes to keep in the tables, and names of videos that are gone from a searched folder.

    Their results stay where they are: they may be all that is left of the video.
    """
    searched = [path.resolve() for path in map(Path, paths) if path.is_dir()]
    lost = tuple(
        each.video
        for each in outcomes
        if not os.path.exists(each.path)
        and any(folder in Path(each.path).parents for folder in searched)
    )
    return [each for each in outcomes if each.video not in lost], lost
