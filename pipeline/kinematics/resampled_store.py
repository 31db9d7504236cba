"""Stations of a whole video: the bulky arrays are kept in files, so that memory stays flat.

Chunks go in as they are measured; the `StoredStations` of each whisker come out, whose places are
read a few rows at a time: `stored.rows(slice(0, 2000)).loaded()`.
"""

import tempfile
from dataclasses import dataclass, fields, replace
from typing import BinaryIO

import numpy as np

from pipeline.kinematics.stations import N_STATIONS, SHARED, Stations
from pipeline.tables.whole_files import temporary_room

BULKY = ("x", "y", "information")
RECORD = (len(BULKY), N_STATIONS)
DTYPE = np.dtype(np.float32)  # of metres: to a few nanometres


@dataclass(frozen=True)
class StoredStations(Stations):
    """Stations of one whisker whose x, y and information (here None) lie in a file.

    Attributes
    ----------
    file : float32 (3, stations) for every row
    place : (rows,) each row's number in the file
    added_variance : (stations,) variances added by `with_variance` [m²]
    """

    file: BinaryIO | None = None
    place: np.ndarray | None = None
    added_variance: np.ndarray | float = 0.0

    def loaded(self) -> Stations:
        """Return these rows with x, y and information in memory."""
        if len(self) == 0:
            bulky = np.empty((0, *RECORD))
        else:
            # mapped for the moment only: pages that stay mapped count as memory in use
            stored = np.memmap(self.file, DTYPE, "r").reshape(-1, *RECORD)
            bulky = stored[self.place].astype(float)
            del stored
        rest = {f.name: getattr(self, f.name) for f in fields(Stations) if f.name not in BULKY}
        parts = zip(BULKY, np.moveaxis(bulky, 1, 0), strict=True)
        seen = Stations(**rest, **{name: np.ascontiguousarray(part) for name, part in parts})
        return seen.with_variance(self.added_variance) if np.any(self.added_variance) else seen

    def with_variance(self, variance) -> "StoredStations":
        """Return the same with errors of `variance` (stations,) [m²] added to the known ones."""
        return replace(self, added_variance=self.added_variance + variance)


class StationStore:
    """Takes `Stations` chunk by chunk; `of(name)` gives back all rows of one whisker.

    Its files are there until the end of a `with` block.

    Attributes
    ----------
    names, spacing : as in `Stations`
    """

    def __init__(self):
        self.names, self.spacing = (), np.empty(0)
        self._sizes = {}
        self._files, self._columns = [], []

    def __enter__(self):
        return self

    def __exit__(self, *error):
        for file in self._files:
            file.close()

    @temporary_room()
    def add(self, chunk: Stations) -> None:
        """Take the rows of the next frames.

        Raises
        ------
        ValueError
            Where the chunk is of other whiskers than those before it.
        """
        if not self._files:
            self.names, self.spacing = chunk.names, chunk.spacing
            self._sizes = {"pole_radius": chunk.pole_radius, "pixel": chunk.pixel}
            self._files = [tempfile.TemporaryFile() for _ in chunk.names]  # noqa: SIM115
            self._columns = [{name: [] for name in _per_row()} for _ in chunk.names]
        if chunk.names != self.names or not np.array_equal(chunk.spacing, self.spacing):
            raise ValueError(
                f"chunks must be of the same whiskers, got {self.names}, {chunk.names}"
            )
        for index, (file, columns) in enumerate(zip(self._files, self._columns, strict=True)):
            rows = chunk.whisker == index
            bulky = np.stack([getattr(chunk, name)[rows] for name in BULKY], axis=1)
            file.write(bulky.astype(DTYPE).tobytes())
            file.flush()
            for name, parts in columns.items():
                parts.append(getattr(chunk, name)[rows])

    def of(self, name: str) -> StoredStations:
        """Return the rows of one whisker, in the order of their frames."""
        index = self.names.index(name)
        file, columns = self._files[index], self._columns[index]
        per_row = {column: np.concatenate(parts) for column, parts in columns.items()}
        return StoredStations(
            names=self.names,
            spacing=self.spacing,
            **self._sizes,
            **per_row,
            **dict.fromkeys(BULKY),
            file=file,
            place=np.arange(len(per_row["frame"])),
        )


def _per_row():
    """Names of the fields that stay in memory, a number per row."""
    return [f.name for f in fields(Stations) if f.name not in (*SHARED, *BULKY)]
