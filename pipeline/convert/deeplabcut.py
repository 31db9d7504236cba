"""Key points of DeepLabCut: CSV and HDF5, of one animal or several."""

from pathlib import Path

import numpy as np
import pandas as pd

from pipeline.convert.keypoints import KeyPoints, scores_of
from pipeline.convert.optional import library
from pipeline.convert.pandas_hdf5 import read_table
from pipeline.convert.results import frames_of, numbers_in
from pipeline.errors import InputError, in_words
from pipeline.tables.files import check_separator


def read_deeplabcut(path) -> KeyPoints:
    """Read a DeepLabCut table: columns scorer, (individuals,) bodyparts, coords; a row per frame.

    Raises
    ------
    InputError
        Where it is something else, or damaged.
    """
    path = Path(path)
    is_hdf5 = path.suffix.lower() in (".h5", ".hdf5")
    if is_hdf5:
        library("h5py", "formats")
    try:
        return _key_points(read_table(path) if is_hdf5 else _read_csv(path))
    except Exception as error:  # the libraries raise many kinds on a broken file
        raise _fault(path, error) from None


def _read_csv(path):
    with open(path, encoding="utf-8-sig") as file:
        lines = [file.readline() for _ in range(4)]
    check_separator(lines[0].split(","))
    names = [line.split(",")[0].strip() for line in lines]
    levels = 4 if "individuals" in names else 3
    if names[0] != "scorer" or names[levels - 1] != "coords":
        raise ValueError(f"its first column begins {names}")
    return pd.read_csv(path, header=list(range(levels)), index_col=0)


def _key_points(table) -> KeyPoints:
    """The key points of a table; ValueError, or what pandas raises, where it is another one."""
    if not isinstance(table, pd.DataFrame) or table.columns.names[-1] != "coords":
        raise ValueError("its columns are no key points")
    table.columns = table.columns.droplevel(0)  # the scorer
    if "individuals" not in table.columns.names:
        table = pd.concat({"": table}, axis=1, names=["individuals"])
    individuals = tuple(dict.fromkeys(map(str, table.columns.get_level_values("individuals"))))
    parts = tuple(dict.fromkeys(map(str, table.columns.get_level_values("bodyparts"))))
    rows = _frames(table)
    values = np.full((int(rows.max(initial=-1)) + 1, len(individuals), len(parts), 3), np.nan)
    for i, p, c in np.ndindex(values.shape[1:]):
        column = individuals[i], parts[p], ("x", "y", "likelihood")[c]
        if column in table:
            values[rows, i, p, c] = numbers_in(table[column])
    xy = values[..., :2]
    return KeyPoints(individuals, parts, xy, scores_of(xy, values[..., 2]))


def _frames(table):
    """Frame numbers of the rows."""
    rows = frames_of(table.index)
    if len(np.unique(rows)) < len(rows):
        raise ValueError("a frame is there twice")
    return rows


def _fault(path, error) -> InputError:
    reason = in_words(error)[:120]
    return InputError(
        f"{path}: cannot be read as key points of DeepLabCut ({reason}): expected a table with "
        "scorer, bodyparts and coords on top and a row per frame; save it so, or analyse the "
        "video again"
    )
