"""Slips in a results folder: where a whisker slips off the pole, and how long it is free after."""

import math
from dataclasses import dataclass

import numpy as np
import pandas as pd

from pipeline.convert.results import VideoResults, read_results
from pipeline.reports.session_numbers import read_contacts
from pipeline.tables.files import read_frames

COLUMNS = ["frame", "time_s", "tracked", "curvature_change_per_m", "curvature_change_per_m_se"]


@dataclass(frozen=True)
class Slip:
    """A slip of one whisker in one video.

    Attributes
    ----------
    video, whisker : the video's results, the whisker's name
    first : the first free frame
    end : the first frame of the next contact; inf where none follows
    """

    video: VideoResults
    whisker: str
    first: int
    end: float

    def __str__(self):
        return f"{self.video.name}, whisker {self.whisker}, frame {self.first}"

    @property
    def frames(self) -> pd.DataFrame:
        """The whisker's rows of frames.parquet from the slip to its end, by frame."""
        inside = [("whisker", "==", self.whisker), ("frame", ">=", self.first)]
        if self.end < math.inf:
            inside.append(("frame", "<", self.end))
        return read_frames(self.video.folder / "frames.parquet", COLUMNS, inside).sort_values(
            "frame", ignore_index=True
        )


def find_slips(results) -> list[Slip]:
    """All contacts of a results folder that end with a slip.

    Raises
    ------
    ValueError
        Where the folder holds no results, or there is no slip.
    """
    contacts, videos = _read(results)
    slips = [
        _slip(videos[row.video], contacts, row.whisker, int(row.offset_frame))
        for row in contacts[contacts["slip"]].itertuples()
        if row.video in videos
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
    contacts, videos = _read(results)
    slips = []
    for place in places:
        *names, frame = place.rsplit(":", 2)  # a video may have colons in its name
        if not frame.strip().isdecimal():
            raise ValueError(
                f"--frames {place}: expected VIDEO:WHISKER:FRAME, or FRAME where there is one "
                "video and whisker; the first frame in which the whisker is free"
            )
        video = videos[_one_of(place, "video", names[:1], list(videos))]
        whiskers = [w.name for w in video.settings.whisker]
        whisker = _one_of(place, "whisker", names[1:], whiskers)
        slips.append(_slip(video, contacts, whisker, int(frame)))
    return slips


def _read(results) -> tuple[pd.DataFrame, dict[str, VideoResults]]:
    """The contacts of a results folder, and its videos by name."""
    return read_contacts(results), {video.name: video for video in read_results(results)}


def _one_of(place, what, given, known):
    """The name given or, if only one is known, that one; ValueError lists all."""
    if not given and len(known) == 1:
        return known[0]
    if not given or given[0] not in known:
        raise ValueError(
            f"--frames {place}: expected a {what} of {', '.join(known) or 'which there is none'}"
        )
    return given[0]


def _slip(video, contacts, whisker, first):
    """The slip at `first`, free until the next contact."""
    own = contacts[(contacts["video"] == video.name) & (contacts["whisker"] == whisker)]
    later = own["onset_frame"][own["onset_frame"] >= first]
    return Slip(video, whisker, first, min(later, default=math.inf))


def tracked(frames) -> np.ndarray:
    """Rows in which the whisker was followed and its curvature is known."""
    return (frames["tracked"] & np.isfinite(frames["curvature_change_per_m"])).to_numpy()
