"""What people decided in a whole session, by whom and when: decisions.csv."""

import getpass
from pathlib import Path

import pandas as pd

from pipeline.contacts.corrections import CONFIRMED, CONTACT, DECISIONS_FILE, FREE
from pipeline.session.schema import FORMULA
from pipeline.session.session_file import SettingsError, read_session
from pipeline.tables.columns import DECISION_COLUMNS, as_table
from pipeline.tables.files import replace_csv

WORDS = {CONTACT: "added or moved", CONFIRMED: "confirmed", FREE: "no contact"}
LONGEST_NAME = 60  # characters of a person's name


def user_name() -> str:
    """The user's name on this computer, "" where it has none."""
    try:
        return getpass.getuser()
    except (KeyError, OSError):
        return ""


def name_of(text: str) -> str:
    """A person's name as tables can hold it, without what spreadsheets would compute.

    >>> name_of("  =Ada \\n Lovelace ")
    'Ada Lovelace'
    """
    printed = "".join(c if c.isprintable() else " " for c in text)
    return " ".join(printed.split()).lstrip("".join(FORMULA)).strip()[:LONGEST_NAME]


def write_decisions(folder, corrections: dict[str, pd.DataFrame]) -> tuple[Path, int, list[str]]:
    """Write decisions.csv into a results folder, from the corrections of its videos by name.

    Returns its path, how many there are, and a sentence where an edited file is kept.
    """
    folder = Path(folder)
    parts = [_of_video(folder / name, table) for name, table in corrections.items()]
    table = pd.concat(parts, ignore_index=True) if parts else pd.DataFrame()
    table, path = as_table(table, DECISION_COLUMNS), folder / DECISIONS_FILE
    return path, len(table), replace_csv(path, table, DECISION_COLUMNS)


def _rate(folder) -> float:
    """Frames per second of a video; NaN where its settings are damaged: decisions are kept."""
    try:
        return read_session(folder / "session.toml").recording.frames_per_second
    except SettingsError:
        return float("nan")


def _of_video(folder, corrections) -> pd.DataFrame:
    if corrections.empty:
        return as_table(pd.DataFrame(), DECISION_COLUMNS)
    rate = _rate(folder)
    onset, offset = corrections["onset_frame"], corrections["offset_frame"]
    table = pd.DataFrame(
        {
            "whisker": corrections["whisker"],
            "decision": corrections["verdict"].map(WORDS),
            "onset_frame": onset,
            "offset_frame": offset,
            "onset_s": onset / rate,
            "duration_ms": 1e3 * (offset - onset) / rate,
            "decided_by": corrections["saved_by"],
            "decided_at": corrections["saved_at"],
        }
    )
    return table.assign(video=folder.name).sort_values("onset_frame", kind="stable")
