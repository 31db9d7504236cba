"""Slips in a results folder: where a whisker slips off the pole, and how long it is free after."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from pipeline.session.inputs import need_results
from pipeline.session.schema import Settings
from pipeline.session.session_file import read_session
from pipeline.tables.columns import CONTACT_COLUMNS
from pipeline.tables.files import read_csv, read_frames


@dataclass(frozen=True)
class Slip:
    """A slip of one whisker in one video, with the free frames after it (half-open)."""

    video: str
    whisker: str
    first: int
    end: int

    def __str__(self):
        return f"{self.video}, whisker {self.whisker}, frame {self.first}"


def find_slips(results) -> list[Slip]:
    """All contacts of a results folder that end with a slip.

    Raises
    ------
    ValueError
        Where the folder holds no results, or there is no slip.
    """
    contacts = _contacts(results)
    rows = contacts[contacts["slip"] & (contacts["offset_frame"] > 0)]
    slips = [
        _slip(results, contacts, row.video, row.whisker, int(row.offset_frame))
        for row in rows.itertuples()
    ]
    if not slips:
        raise ValueError(
            f"{results}: none of its {len(contacts)} contacts ends with a slip past the pole; "
            "film slips, or name the frames after which a whisker rings with --frames"
        )
    return slips


def named_slips(results, places) -> list[Slip]:
    """The slips at `places`, each "VIDEO:WHISKER:FRAME".

    Video and whisker may be left out where there is only one.
    """
    contacts, folders = _contacts(results), _videos(results)
    slips = []
    for place in places:
        *names, frame = place.split(":")
        if not frame.strip().isdigit() or len(names) > 2:
            raise ValueError(
                f"--frames {place}: expected VIDEO:WHISKER:FRAME, or FRAME where there is one "
                "video and whisker; the first frame in which the whisker is free"
            )
        video = _one_of(place, "video", names[:1], folders)
        whiskers = [w.name for w in settings_of(results, video).whisker]
        whisker = _one_of(place, "whisker", names[1:], whiskers)
        slips.append(_slip(results, contacts, video, whisker, int(frame)))
    return slips


def settings_of(results, video) -> Settings:
    """The settings that a video was processed with."""
    own = Path(results) / video / "session.toml"
    return read_session(own if own.is_file() else Path(results) / "session.toml")


def _contacts(results):
    need_results(results)
    return read_csv(Path(results) / "contacts.csv", CONTACT_COLUMNS)


def _videos(results):
    return sorted(path.parent.name for path in Path(results).glob("*/frames.parquet"))


def _one_of(place, what, given, known):
    """The name given or, if only one is known, that one; ValueError lists all."""
    if not given and len(known) == 1:
        return known[0]
    if not given or given[0] not in known:
        raise ValueError(
            f"--frames {place}: expected a {what} of {', '.join(known) or 'which there is none'}"
        )
    return given[0]


def _slip(results, contacts, video, whisker, first):
    """The slip at `first`, free until the next contact or the video's end."""
    own = contacts[(contacts["video"] == video) & (contacts["whisker"] == whisker)]
    later = own["onset_frame"][own["onset_frame"] >= first]
    frames = read_frames(
        Path(results) / video / "frames.parquet", ["frame"], [("whisker", "==", whisker)]
    )["frame"]
    end = int(frames.max()) + 1 if len(frames) else first
    return Slip(video, whisker, first, int(min([end, *later])))


def frames_of(results, slip: Slip) -> pd.DataFrame:
    """frames.parquet of a slip's whisker from the slip to its end."""
    return read_frames(
        Path(results) / slip.video / "frames.parquet",
        filters=[
            ("whisker", "==", slip.whisker),
            ("frame", ">=", slip.first),
            ("frame", "<", slip.end),
        ],
    ).sort_values("frame", ignore_index=True)


def tracked(frames) -> np.ndarray:
    """Rows in which the whisker was followed and its curvature is known."""
    return (frames["tracked"] & np.isfinite(frames["curvature_change_per_m"])).to_numpy()
