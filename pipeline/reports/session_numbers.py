"""The contacts of a session, the truth where it is known, and their numbers beside the paper's."""

from pathlib import Path

import numpy as np
import pandas as pd

from pipeline.errors import InputError, need_content, with_advice
from pipeline.session.results_folders import need_results
from pipeline.session.session_file import read_session
from pipeline.tables import files
from pipeline.tables.columns import (
    CENTRELINE_COLUMNS,
    CONTACT_COLUMNS,
    FRAME_COLUMNS,
    VIDEO_COLUMNS,
)
from pipeline.tables.run_record import read_run

# Hires, Efros & Svoboda 2013, Results: 12,417 contacts of mouse C2 whiskers.
PAPER = {
    ("contacts", "number"): 12417,
    ("peak force", "5 %"): 1.8,
    ("peak force", "median"): 16.1,
    ("peak force", "mean"): 19.6,
    ("peak force", "95 %"): 44.4,
    ("duration", "5 %"): 5.0,
    ("duration", "median"): 16.0,
    ("duration", "mean"): 30.9,
    ("duration", "95 %"): 113.0,
    ("peak force and duration", "r²"): 0.368,
}
UNITS = {"peak force": "µN", "duration": "ms"}


def damaged_videos(results) -> dict[str, str]:
    """Why the results of some videos of a results folder cannot be read, by the videos' names."""
    need_results(results)
    videos = files.read_csv(Path(results) / "videos.csv", VIDEO_COLUMNS)
    names = map(str, videos.loc[videos["frames"] > 0, "video"])
    return {name: fault for name in names if (fault := _fault(Path(results) / name))}


def _fault(folder) -> str:
    """Why a video's results cannot be read; "" where they can."""
    try:
        read_session(folder / "session.toml")
        files.check_parquet(folder / "frames.parquet", FRAME_COLUMNS)
        files.check_parquet(folder / "centrelines.parquet", CENTRELINE_COLUMNS)
    except (OSError, ValueError) as error:
        return with_advice(error)
    return ""


def read_contacts(results, damaged=None) -> pd.DataFrame:
    """contacts.csv of a results folder, without the `damaged_videos`; InputError if it is none."""
    damaged = damaged_videos(results) if damaged is None else damaged
    contacts = files.read_csv(Path(results) / "contacts.csv", CONTACT_COLUMNS)
    return contacts[~contacts["video"].isin(damaged)]


def read_truth(results, truth=None) -> pd.DataFrame | None:
    """True contacts of the videos of a results folder, None where they are not known.

    `video` is the name of the results folder of each. `truth` as in `write_fig3`; InputError where
    it holds none of these videos.
    """
    if truth:
        need_content(truth, "true tables of `whiskerforce synth`")
    inputs = read_run(results)["inputs"]
    parts = []
    for video, state in inputs.items():
        path = Path(state["path"])
        places = [Path(truth)] if truth else [p / "truth" for p in list(path.parents)[:2]]
        for place in places:
            table = place / path.stem / "contacts.csv"
            if state["frames"] and table.is_file():
                parts.append(files.read_csv(table, CONTACT_COLUMNS).assign(video=video))
                break
    if truth and not parts:
        raise InputError(
            f"--truth {truth}: no true tables of these videos in it; give the `truth` folder that "
            "`whiskerforce synth` wrote beside them"
        )
    return pd.concat(parts, ignore_index=True) if parts else None


def statistics(contacts: pd.DataFrame) -> dict:
    """The numbers the paper gives of its contacts, keyed as in `PAPER`."""
    out = {("contacts", "number"): len(contacts)}
    for what, column in (("peak force", "peak_force_uN"), ("duration", "duration_ms")):
        values = contacts[column]
        low, middle, high = values.quantile([0.05, 0.5, 0.95])
        out[what, "5 %"], out[what, "median"], out[what, "95 %"] = low, middle, high
        out[what, "mean"] = values.mean()
    out["peak force and duration", "r²"] = r_squared(
        contacts["duration_ms"], contacts["peak_force_uN"]
    )
    return out


def r_squared(x, y) -> float:
    """Squared correlation of two columns, NaN with fewer than three pairs."""
    return float(x.corr(y, min_periods=3) ** 2)


def fig3_numbers(contacts, true_contacts=None) -> pd.DataFrame:
    """Recovered, published and (where there is one) true statistics side by side."""
    recovered = statistics(contacts)
    true = statistics(true_contacts) if true_contacts is not None else {}
    rows = [
        {
            "quantity": what,
            "statistic": which,
            "unit": UNITS.get(what, ""),
            "recovered": recovered[what, which],
            "truth": true.get((what, which), np.nan),
            "paper": published,
        }
        for (what, which), published in PAPER.items()
    ]
    return pd.DataFrame(rows)
