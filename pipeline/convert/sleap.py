"""Key points of SLEAP: analysis files, HDF5 or CSV."""

from pathlib import Path

import numpy as np
import pandas as pd

from pipeline.convert.hdf5 import texts_in
from pipeline.convert.keypoints import KeyPoints, scores_of
from pipeline.convert.optional import library
from pipeline.convert.results import frames_of, numbers_in
from pipeline.errors import InputError, in_words
from pipeline.tables.files import check_separator


def read_sleap(path) -> KeyPoints:
    """Read a SLEAP analysis file; a track is an individual, a node is a part.

    Raises
    ------
    InputError
        Where it is something else, or damaged.
    """
    path = Path(path)
    return _read_csv(path) if path.suffix.lower() == ".csv" else _read_hdf5(path)


def _read_hdf5(path) -> KeyPoints:
    h5py = library("h5py", "formats")
    try:
        with h5py.File(path) as file:
            xy = np.asarray(file["tracks"], float).transpose(3, 0, 2, 1)
            parts = texts_in(file["node_names"])
            tracks = texts_in(file["track_names"]) if "track_names" in file else ()
            scores = np.asarray(file["point_scores"], float) if "point_scores" in file else None
    except (OSError, KeyError, ValueError, TypeError) as error:
        raise _fault(path, error) from None
    scores = np.ones(xy.shape[:3]) if scores is None else scores.transpose(2, 0, 1)
    if xy.shape[1:] != (xy.shape[1], len(parts), 2) or scores.shape != xy.shape[:3]:
        raise _fault(path, f"tracks are of shape {xy.shape}, scores {scores.shape}")
    if len(tracks) != xy.shape[1]:
        tracks = tuple(f"track_{i}" for i in range(xy.shape[1]))
    return KeyPoints(tracks, parts, xy, scores_of(xy, scores))


def _read_csv(path) -> KeyPoints:
    try:
        table = pd.read_csv(path)
        check_separator(table.columns)
        if not isinstance(table.index, pd.RangeIndex):  # pandas takes the first ones for names
            raise ValueError("its rows have more values than names on top: decimal commas?")
        missing = [name for name in ("track", "frame_idx") if name not in table]
        if missing:
            raise ValueError(f"no column {missing[0]}")
        stems = [name[:-2] for name in table if name.endswith(".x")]
        parts = tuple(stem for stem in stems if f"{stem}.y" in table)
        table["track"] = table["track"].astype("object").fillna("track_0").astype(str)
        if not parts:
            raise ValueError("no points")
        frame = frames_of(table["frame_idx"])
        twice = table.loc[table.duplicated(["track", "frame_idx"])]
        if len(twice):
            frame, track = twice.iloc[0][["frame_idx", "track"]]
            raise ValueError(f"frame {frame} has two instances of {track}: track them")
        return _points(table, parts, frame)
    except (ValueError, UnicodeDecodeError, OSError) as error:
        raise _fault(path, error) from None


def _points(table, parts, frame) -> KeyPoints:
    """Key points of a table with a row per frame and instance."""
    tracks = tuple(dict.fromkeys(table["track"]))
    track = table["track"].map({name: i for i, name in enumerate(tracks)}).to_numpy(int)
    shape = int(frame.max(initial=-1)) + 1, len(tracks), len(parts)
    xy, score = np.full((*shape, 2), np.nan), np.full(shape, np.nan)
    for p, part in enumerate(parts):
        for k, axis in enumerate("xy"):
            xy[frame, track, p, k] = numbers_in(table[f"{part}.{axis}"])
        if f"{part}.score" in table:
            score[frame, track, p] = numbers_in(table[f"{part}.score"])
    return KeyPoints(tracks, parts, xy, scores_of(xy, score))


def _fault(path, error) -> InputError:
    reason = in_words(error)[:120]
    return InputError(
        f"{path}: cannot be read as a SLEAP analysis file ({reason}): expected HDF5 with tracks "
        "and node_names, or CSV with track and frame_idx; export it again (Analysis HDF5 or CSV)"
    )
