"""Tables computed from a run's measurements and a person's corrections, whenever these change.

run.json of a video names the corrections that its tables were made with. Where its corrections.csv
holds other ones (a curation was killed, or the file was edited or removed), contacts and forces
are made anew from evidence.parquet; the video is not needed.
"""

import contextlib
import hashlib
from pathlib import Path

import pandas as pd

from pipeline.contacts.analysis import ContactOptions, ContactTables, find_contacts, no_contacts
from pipeline.contacts.corrections import (
    CORRECTIONS_FILE,
    DECISIONS_FILE,
    left_out,
    read_corrections,
)
from pipeline.curate.decisions import write_decisions
from pipeline.errors import CorrectionsError, InputError, in_words
from pipeline.session.schema import Settings
from pipeline.session.session_file import read_session, settings_digest
from pipeline.tables import files
from pipeline.tables.columns import (
    CONTACT_COLUMNS,
    CORRECTION_COLUMNS,
    VIDEO_COLUMNS,
    as_table,
    empty_table,
)
from pipeline.tables.evidence import EVIDENCE_FILE, read_evidence
from pipeline.tables.own_files import is_changed
from pipeline.tables.result_exchange import draft, is_settled, put_in_place, settled
from pipeline.tables.run_record import read_state, write_state
from pipeline.tables.video_messages import as_cell, sentences_of

MADE_WITH = "corrections_sha256"  # in run.json of a video; "" where there were none
DECIDED_ON = "corrections_of"  # there, too: what the record said when a person last decided, of
DOUBTS = {
    "sha256": "corrections.csv was made before the video changed: check its contacts",
    "whiskers": (
        "corrections.csv was made before whiskers were named, added or moved in session.toml: "
        "check whose its contacts are"
    ),
}
BY_HAND = (
    "{} was changed since whiskerforce wrote it: its rows count as they are now, but the video's "
    "next tables replace them, and other tables do not follow from them; contacts that you change "
    "in `whiskerforce curate` stay changed"
)


def corrections_digest(corrections: pd.DataFrame) -> str:
    """Hash of a table of corrections; "" where it has no rows."""
    text = as_table(corrections, CORRECTION_COLUMNS).to_csv(index=False)
    return hashlib.sha256(text.encode()).hexdigest() if len(corrections) else ""


def is_behind(folder) -> bool:
    """Whether a video's tables were made with other corrections than it has now.

    Raises CorrectionsError where its corrections.csv cannot be read.
    """
    now = corrections_digest(read_corrections(folder))
    return read_state(folder).get(MADE_WITH, "") != now


def settings_of_results(folder) -> Settings:
    """The settings that a video's results were made with.

    ValueError where the file has been changed since: measurements do not follow from it then.
    """
    path, state = Path(folder) / "session.toml", read_state(folder)
    settings = read_session(path)
    checked = state and is_changed(path) and not settings.image.mask_problem()
    if checked and settings_digest(settings) != state["settings_sha256"]:
        raise ValueError(
            f"{path}: not the settings of these results; change the session.toml beside the "
            "videos, and run again"
        )
    return settings


def contacts_with(
    corrections: pd.DataFrame, frames: pd.DataFrame, evidence: pd.DataFrame, settings: Settings,
    video: str,
) -> ContactTables:  # fmt: skip
    """Contacts, forces, pulses and base moments of a video, with these corrections.

    frames, evidence : as `run` left them, or an earlier call; `video` is its name in the tables
    """
    if frames.empty:
        return no_contacts(frames)
    return find_contacts(
        frames,
        evidence,
        settings.recording.si(),
        {w.name: w.si() for w in settings.whisker},
        ContactOptions(settings.analysis.curvature_at, video=video, params=settings.advanced),
        corrections,
    )


def save_contacts(folder, tables: ContactTables, corrections: pd.DataFrame) -> list[str]:
    """Write frames.parquet and contacts.csv of a video, and what they were made with, together.

    Returns a sentence on each file that a person had changed, and which is kept.
    """
    folder = Path(folder)
    kept = put_in_place(folder)  # what could not be put there before, since the disk was full
    state = read_state(folder)
    with draft(folder) as new:
        files.write_frames(new / "frames.parquet", tables.frames)
        files.write_csv(new / "contacts.csv", tables.contacts, CONTACT_COLUMNS)
        if state:
            write_state(new, _decided(state, tables.contacts, corrections))
    return kept + put_in_place(folder)  # a person may be saving the next correction


def _decided(state, contacts, corrections) -> dict:
    """A video's record after a person has decided on its contacts as they are now."""
    said = [each for each in sentences_of(state["message"]) if each not in DOUBTS.values()]
    return state | {
        "contacts": len(contacts),
        "status": "warning" if said else "done",
        "message": as_cell(said),
        MADE_WITH: corrections_digest(corrections),
        DECIDED_ON: decided_on(state),
    }


def decided_on(state) -> dict:
    """What a record says of all that a person's decisions hold for."""
    return {key: state[key] for key in DOUBTS if state.get(key, "") != ""}


def correct(folder) -> list[str]:
    """Make the tables of one video anew with its present corrections.

    Returns sentences as `save_contacts`, and on corrections that are not of this video.
    """
    folder = Path(folder)
    corrections = read_corrections(folder)
    frames, evidence = files.read_frames(folder / "frames.parquet"), read_evidence(folder)
    settings = settings_of_results(folder)
    tables = contacts_with(corrections, frames, evidence, settings, folder.name)
    last = frames["frame"].max() if len(frames) else -1
    unused = left_out(corrections, list(frames["whisker"].unique()), last + 1)
    return save_contacts(folder, tables, corrections) + [f"{folder}: {each}" for each in unused]


# --- the whole folder ----------------------------------------------------------------------


def follow_corrections(out) -> tuple[dict[str, str], list[str]]:
    """Bring the videos' tables in a results folder up to their corrections; it must be locked.

    Returns why not, by the video's name, where a video's tables cannot be, and sentences as
    `correct`. The session's tables follow with `write_session_tables`.
    """
    problems, kept = {}, []
    for folder in _with_evidence(out):
        try:
            if is_behind(folder):
                kept += correct(folder)
        except CorrectionsError as error:
            problems[folder.name] = str(error)
        except Exception as error:  # whatever is wrong with one video costs no other
            problems[folder.name] = (
                f"corrections are not in its tables ({in_words(error)}): run the video again"
            )
    return problems, kept


def renew_tables(out) -> tuple[dict[str, str], list[str]]:
    """As `follow_corrections`, and the session's tables; also what a person should know."""
    problems, kept = follow_corrections(out)
    return problems, kept + write_session_tables(out)


def bring_up_to_date(out) -> list[str]:
    """As `renew_tables`, for programs that only read: locks only if there is anything to do.

    Returns what a person should know. InputError where another program is using the folder, or
    some tables cannot be made.
    """
    out = Path(out)
    if not (out / "videos.csv").is_file() or _is_up_to_date(out):
        return []
    with settled(out) as kept:
        problems, said = renew_tables(out)
    if problems:
        faults = [f"{out / name}: {why}" for name, why in problems.items()]
        raise InputError("\n".join([*faults, *kept, *said]))
    return kept + said


def finished_videos(out) -> list[str]:
    """Names of the videos of videos.csv that have results."""
    videos = files.read_csv(Path(out) / "videos.csv", VIDEO_COLUMNS)
    return [str(name) for name in videos.loc[videos["frames"] > 0, "video"]]


def session_contacts(out, names) -> pd.DataFrame:
    """The contacts of these videos, in this order; earlier ones where a video's are damaged."""
    parts = [_contacts_of(Path(out), name) for name in names]
    table = pd.concat(parts, ignore_index=True) if parts else pd.DataFrame()
    return as_table(table, CONTACT_COLUMNS)


def write_session_tables(out, names=None) -> list[str]:
    """Write contacts.csv of all videos and, where someone has decided anything, decisions.csv.

    names : of the videos; None: those that are in the tables
    Returns what a person should know.
    """
    out = Path(out)
    names = _listed(out) if names is None else names
    contacts = session_contacts(out, names)
    said = [BY_HAND.format(path) for name in names if is_changed(path := _contacts_in(out, name))]
    said += files.replace_csv(out / "contacts.csv", contacts, CONTACT_COLUMNS)
    decided = [name for name in names if (out / name / CORRECTIONS_FILE).exists()]
    if decided or (out / DECISIONS_FILE).exists():
        said += write_decisions(out, _sound_corrections(out, decided))[-1]
    return said


def _with_evidence(out) -> list[Path]:
    return sorted(path.parent for path in Path(out).glob(f"*/{EVIDENCE_FILE}"))


def _is_up_to_date(out) -> bool:
    if not all(map(is_settled, _with_evidence(out))) or any(map(is_behind, _with_evidence(out))):
        return False
    return session_contacts(out, _listed(out)).equals(_whole(out))


def _listed(out) -> list[str]:
    """Names of the videos with results, and of those that only contacts.csv knows."""
    return list(dict.fromkeys([*finished_videos(out), *_whole(out)["video"]]))


def _whole(out) -> pd.DataFrame:
    path = Path(out) / "contacts.csv"
    return files.read_csv(path, CONTACT_COLUMNS) if path.exists() else empty_table(CONTACT_COLUMNS)


def _contacts_in(out, name) -> Path:
    return out / name / "contacts.csv"


def _contacts_of(out, name) -> pd.DataFrame:
    try:
        return files.read_csv(_contacts_in(out, name), CONTACT_COLUMNS)
    except (OSError, ValueError):
        whole = _whole(out)
        return whole[whole["video"] == name]


def _sound_corrections(out, names) -> dict[str, pd.DataFrame]:
    """The corrections of those of the videos whose file of them can be read."""
    tables = {}
    for name in names:
        with contextlib.suppress(CorrectionsError):
            tables[name] = read_corrections(out / name)
    return tables
