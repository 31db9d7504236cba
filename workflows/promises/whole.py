"""Whether the files of a results folder are whole, each of them by itself."""

import json
from pathlib import Path

import pandas as pd

from pipeline.app.earlier_results import PARQUETS
from pipeline.session.session_file import read_session
from pipeline.tables import files
from pipeline.tables.columns import CONTACT_COLUMNS, CORRECTION_COLUMNS, VIDEO_COLUMNS

CSVS = {
    "contacts.csv": CONTACT_COLUMNS,
    "videos.csv": VIDEO_COLUMNS,
    "corrections.csv": CORRECTION_COLUMNS,
}
ENDS = {  # of files that need no other look
    ".html": (b"</html>", b"</p>"),
    ".png": (b"IEND\xaeB`\x82",),
    ".svg": (b"</svg>",),
    ".log": (b"",),
}


def visible(out) -> list[Path]:
    """All files of a folder but the hidden ones, which no one reads."""
    found = (path for path in Path(out).rglob("*") if path.is_file())
    return sorted(p for p in found if "/." not in f"/{p.relative_to(out)}")


def faults(out) -> list[str]:
    """Files of a results folder that are not whole, a sentence each.

    What somebody else changed, and was therefore kept as `….old`, may be anything.
    """
    said = []
    for path in visible(out):
        if path.suffix.startswith(".old"):
            continue
        try:
            _read(path)
        except Exception as error:
            said.append(f"{path.name} is not whole: {error}")
    return said


def _read(path) -> None:
    if path.name in PARQUETS:
        files.check_parquet(path, PARQUETS[path.name], thorough=True)
    elif path.name in CSVS:
        files.read_csv(path, CSVS[path.name])
    elif path.suffix == ".csv":
        pd.read_csv(path)
    elif path.suffix == ".json":
        json.loads(path.read_text("utf-8"))
    elif path.name == "session.toml":
        read_session(path)
    elif not path.read_bytes().rstrip().endswith(ENDS[path.suffix]):
        raise ValueError(f"ends with {path.read_bytes()[-20:]}")
