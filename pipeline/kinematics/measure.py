"""Angle, curvature and distance to the pole of a whole video's lines, chunk by chunk."""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from pipeline.detection.static_scene import PoleTrack
from pipeline.kinematics import curvature, resampled
from pipeline.kinematics.base_angle import add_bases
from pipeline.kinematics.resampled_store import StationStore
from pipeline.session.parameters import KinematicsParams
from pipeline.session.recording import Recording
from pipeline.tables.columns import FRAME_COLUMNS, as_table
from pipeline.tracking.whiskers import WhiskerSet


@dataclass(frozen=True)
class Kinematics:
    """What is known of a video's whiskers before forces.

    Attributes
    ----------
    whisker_set : the whiskers
    frames : table of FRAME_COLUMNS with the kinematics, a row per frame and whisker
    places : `Stations` of all traced rows, by whisker, until the store is closed
    pole : where the pole was; None if it was never seen
    n_frames : frames read
    unnamed : how many more whiskers are seen than have a table in session.toml
    """

    whisker_set: WhiskerSet
    frames: pd.DataFrame
    places: StationStore
    pole: PoleTrack | None
    n_frames: int
    unnamed: int = 0


class KinematicsMeter:
    """Measures a video's `Centrelines` chunk by chunk, and keeps what forces and tables need.

    Parameters
    ----------
    whisker_set : the whiskers
    recording : frame rate and scale
    curvature_at : arc length from the follicle at which curvature is taken [m]
    pole : where the pole is; None where there is none
    params : the room's parameters
    places : takes the places of all rows
    """

    def __init__(
        self,
        whisker_set: WhiskerSet,
        recording: Recording,
        curvature_at: float,
        pole: PoleTrack | None,
        params: KinematicsParams,
        places: StationStore,
    ):
        self.whisker_set, self.recording, self.curvature_at = whisker_set, recording, curvature_at
        self.pole, self.params = pole, params
        self._tables, self._places = [], places

    def add(self, chunk, interpolated=frozenset()) -> None:
        """Measure the next chunk; `interpolated` as for `measure_stations`."""
        self.whisker_set = self.whisker_set.of(chunk.names)
        hidden = self.whisker_set.hidden_lengths
        table = curvature.measure(
            chunk, self.recording, hidden, self.curvature_at, self.params, self.pole
        )
        self._tables.append(table.assign(confidence=chunk.confidence))
        self._places.add(
            resampled.measure_stations(
                chunk, self.recording, self.whisker_set.nominal, hidden, self.pole, interpolated,
                params=self.params,
            )
        )  # fmt: skip

    def result(self, n_frames: int) -> Kinematics:
        """All that was measured, of a video of `n_frames`."""
        table = frame_table(self._tables, self.whisker_set, n_frames, self.recording)
        table = add_bases(table, self._places, self.recording.pixels_per_m, self.params)
        return Kinematics(self.whisker_set, table, self._places, self.pole, n_frames)


def frame_table(
    tables, whisker_set: WhiskerSet, n_frames: int, recording: Recording
) -> pd.DataFrame:
    """Table of FRAME_COLUMNS with a row per frame and whisker, kinematics where it is tracked.

    `tables` are as in `curvature.measure`, whose `whisker` indexes `whisker_set.found`.
    """
    count = len(whisker_set.names)
    number = np.array([whisker_set.names.index(name) for name in whisker_set.found], int)
    rows = [t["frame"].to_numpy() * count + number[t["whisker"].to_numpy(int)] for t in tables]
    frame = np.repeat(np.arange(n_frames, dtype=np.int32), count)
    tracked = np.zeros(n_frames * count, bool)
    for own in rows:
        tracked[own] = True
    columns = {
        "frame": frame,
        "time_s": frame / recording.frames_per_second,
        "whisker": np.tile(np.asarray(whisker_set.names, object), n_frames),
        "tracked": tracked,
    }
    for name in tables[0].columns.difference(["frame", "whisker"]) if tables else ():
        columns[name] = np.full(n_frames * count, np.nan)
        for table, own in zip(tables, rows, strict=True):
            columns[name][own] = table[name]
    return as_table(pd.DataFrame(columns, copy=False), FRAME_COLUMNS)


def as_recorded(frames: pd.DataFrame, shifts) -> pd.DataFrame:
    """The table with follicles moved by the shift x, y [px] of every frame."""
    x, y = np.reshape(shifts, (-1, 2))[frames["frame"]].T
    return frames.assign(
        follicle_x_px=frames["follicle_x_px"] + x, follicle_y_px=frames["follicle_y_px"] + y
    )
