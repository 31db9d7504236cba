"""A results folder as the formats' writers want it: its finished videos, one by one."""

import re
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import pandas as pd

from pipeline.detection.static_scene import PoleTrack
from pipeline.errors import InputError, VideoError
from pipeline.scene import pole_runs
from pipeline.session.content import check_video
from pipeline.session.results_folders import need_results
from pipeline.session.schema import Settings
from pipeline.session.session_file import read_session
from pipeline.tables import files
from pipeline.tables.centrelines import (
    MOST_FRAMES,
    Centrelines,
    are_frames,
    read_centrelines,
)
from pipeline.tables.columns import CONTACT_COLUMNS, VIDEO_COLUMNS
from pipeline.tables.run_record import (
    found_video,
    frame_count,
    read_pole,
    read_state,
    recorded_path,
)

TRIAL_NUMBER = re.compile(r".*[-_](\d{1,18})$")  # of a video's name


@dataclass(frozen=True)
class VideoResults:
    """The tables of one video, read when they are wanted; `path` is where the video was."""

    name: str
    folder: Path
    path: str

    @cached_property
    def settings(self) -> Settings:
        """The settings that the results were made with."""
        return read_session(self.folder / "session.toml")

    @property
    def made_of(self) -> str:
        """What tells the results from those of other videos: the video's hash, or a place."""
        return read_state(self.folder).get("sha256") or str(self.folder.resolve())

    def whisker_made_of(self, whisker) -> str:
        """The same of what is made of one whisker's results, such as a calibration."""
        return f"{self.made_of} {whisker}"

    @cached_property
    def source(self) -> Path | None:
        """The video's file, None where it has gone, or another lies there."""
        path = Path(self.path)
        try:
            check_video(self.folder, path)
        except VideoError:
            return None
        return path if path.exists() else None

    @cached_property
    def frames(self) -> pd.DataFrame:
        """The table frames.parquet."""
        return files.read_frames(self.folder / "frames.parquet")

    @cached_property
    def contacts(self) -> pd.DataFrame:
        """The table contacts.csv."""
        return files.read_csv(self.folder / "contacts.csv", CONTACT_COLUMNS)

    @cached_property
    def whiskers(self) -> tuple[str, ...]:
        """Names, in the order of the tables."""
        return tuple(dict.fromkeys(self.frames["whisker"]))

    @cached_property
    def n_frames(self) -> int:
        """Frames of which there are results."""
        return frame_count(self.folder, self.frames)

    def of(self, whisker) -> pd.DataFrame:
        """Rows of one whisker in frames.parquet, by frame."""
        return self.frames[self.frames["whisker"] == whisker].sort_values("frame")

    def lines(self, filters=None) -> Centrelines:
        """The centrelines: the rows that pass `filters`, as `tables.read_centrelines` has them."""
        return read_centrelines(self.folder / "centrelines.parquet", filters)

    def lines_of(self, whisker, fewest) -> dict[int, np.ndarray]:
        """Frame → points (n, 2) of a whisker's centreline, of those that have `fewest` or more."""
        rows = self.lines().of((whisker,)).each()
        return {frame: row.astype(float) for frame, _, row in rows if len(row) >= fewest}

    def pole(self) -> PoleTrack | None:
        """Where the pole was, NaN while it was away; None: never seen."""
        state = read_pole(self.folder)
        places = [pole_runs.pole_at(state, frame) for frame in range(self.n_frames)]
        known = [place for place in places if place is not None]
        if not known:
            return None
        away = (np.nan, np.nan, known[0][2])
        x, y, radius = np.array([place or away for place in places]).T
        return PoleTrack(x, y, float(radius[0]))


def trial_number(name: str) -> int | None:
    """The number at the end of a video's name, after the last - or _; None where there is none.

    >>> trial_number("AH0407x160609-12"), trial_number("trial_0007"), trial_number("C2")
    (12, 7, None)
    """
    found = TRIAL_NUMBER.match(name)
    return int(found[1]) if found else None


def read_results(folder) -> list[VideoResults]:
    """The finished videos of a results folder, or the one that `Analysis.save` wrote there.

    InputError where there is none.
    """
    folder = Path(folder)
    if (folder / "frames.parquet").is_file():
        name = folder.resolve().name
        return [VideoResults(name, folder, recorded_path(folder) or name)]
    need_results(folder)
    videos = files.read_csv(folder / "videos.csv", VIDEO_COLUMNS)
    done = videos[videos["frames"] > 0]
    if not len(done):
        raise InputError(f"{folder}: no finished video in it; videos.csv says why")
    rows = zip(done["video"], done["path"], strict=True)
    return [
        VideoResults(str(name), own := folder / str(name), str(found_video(own, str(path))))
        for name, path in rows
    ]


def frames_of(numbers) -> np.ndarray:
    """Frame numbers (rows,) as integers; ValueError where these are none of a video."""
    given = np.asarray(numbers, float)
    if not are_frames(given).all():
        raise ValueError(f"a frame that is no whole number from 0 to {MOST_FRAMES}")
    return given.astype(np.int64)


def numbers_in(column: pd.Series) -> np.ndarray:
    """The numbers in a table's column, NaN where there is none; ValueError at anything else."""
    numbers = pd.to_numeric(column, errors="coerce")
    for row in np.flatnonzero(numbers.isna() & column.notna()):
        name = " ".join(filter(None, np.atleast_1d(column.name)))
        raise ValueError(f"{name} is {column.iloc[row]!r} in row {row} of its points")
    return numbers.to_numpy(float)


def lines_of_rows(names, keys, rows) -> Centrelines:
    """`Centrelines` of rows of points (n, 2); `keys` are (frame, number of the name)."""
    frame, whisker = np.array(keys, np.int32).reshape(-1, 2).T
    points = np.concatenate([np.empty((0, 2)), *rows]).T
    return Centrelines.of_points(names, frame, whisker, [len(row) for row in rows], points)
