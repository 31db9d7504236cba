"""Centrelines of all whiskers and frames as one ragged table, in memory and on disk."""

import contextlib
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from pipeline.tables.columns import CENTRELINE_COLUMNS, as_table, with_units
from pipeline.tables.files import ROWS_PER_GROUP, parquet_writer, read_rows, whole_parquet

MOST_FRAMES = 10_000_000  # a larger number is damage, or a time
PER_ROW = ("frame", "whisker", "confidence", "end_px", "hidden_px")
PER_POINT = ("x_px", "y_px", "se_px", "offset_px", "information", "thickness_px")


@dataclass
class Centrelines:
    """Ragged centrelines of a whole video: row i is one whisker in one frame.

    Attributes
    ----------
    frame, whisker : int32 (rows,); `whisker` indexes `names`
    offsets : int64 (rows + 1,); row i owns points offsets[i]:offsets[i+1]
    x_px, y_px : float32 (points,), follicle side → tip, spacing about 1 px
    se_px : float32 (points,), standard error of the position across the whisker
    confidence : float32 (rows,), 0–1
    offset_px, information : float32 (points,) or None; the unsmoothed measurement of every
        point: its offset from (x, y) along the normal (tangent turned counter-clockwise on the
        screen) [px] and the Fisher information of that offset [1/px²]
    thickness_px : float32 (points,) or None; absorbance integrated across the line, NaN where
        it cannot be measured
    end_px : float16 (rows, places) or None; the same about the row's last point and beyond it
        (`detection/line_end.py`)
    hidden_px : float64 (rows,) or None; arc length from the follicle to the row's first point
    """

    names: tuple[str, ...]
    frame: np.ndarray
    whisker: np.ndarray
    offsets: np.ndarray
    x_px: np.ndarray
    y_px: np.ndarray
    se_px: np.ndarray
    confidence: np.ndarray
    offset_px: np.ndarray | None = None
    information: np.ndarray | None = None
    thickness_px: np.ndarray | None = None
    end_px: np.ndarray | None = None
    hidden_px: np.ndarray | None = None

    @classmethod
    def of_points(cls, names, frame, whisker, counts, points, **known) -> "Centrelines":
        """Rows of `counts` points each, x and y (2, points) one row after the other.

        known : other fields; without them names are certain, and errors unknown
        """
        x, y = np.ascontiguousarray(points, np.float32)
        unknown = {"se_px": np.full(len(x), np.nan, np.float32)}
        certain = {"confidence": np.ones(len(counts), np.float32)}
        frame, whisker = np.array(frame, np.int32), np.array(whisker, np.int32)
        offsets = np.append(0, np.cumsum(counts)).astype(np.int64)
        return cls(tuple(names), frame, whisker, offsets, x, y, **(unknown | certain | known))

    def __len__(self):
        return len(self.frame)

    def raw(self) -> tuple[np.ndarray, np.ndarray]:
        """Offset [px] and information [1/px²] of every point; without, the points themselves."""
        if self.offset_px is None:
            se = np.maximum(self.se_px.astype(float), 1e-3)
            return np.zeros(len(self.x_px)), 1 / se**2
        return self.offset_px, self.information

    def hidden_of(self, nominal_px) -> np.ndarray:
        """Hidden length per row [px]: what was found, or else one nominal length per name."""
        if self.hidden_px is not None:
            return self.hidden_px
        return np.asarray(nominal_px, float)[self.whisker]

    def row(self, i: int) -> np.ndarray:
        """Points of row `i`, float32 (points, 2)."""
        part = slice(self.offsets[i], self.offsets[i + 1])
        return np.column_stack([self.x_px[part], self.y_px[part]])

    def each(self):
        """Yield (frame, name, points) of every row."""
        for i, (frame, whisker) in enumerate(zip(self.frame, self.whisker, strict=True)):
            yield int(frame), self.names[whisker], self.row(i)

    def of(self, names) -> "Centrelines":
        """Return the rows of the whiskers with these names, numbered anew; None: all."""
        if names is None:
            return self
        kept = [k for k, name in enumerate(self.names) if name in names]
        part = self.rows(np.flatnonzero(np.isin(self.whisker, kept)))
        number = np.searchsorted(kept, part.whisker).astype(np.int32)
        return replace(part, names=tuple(self.names[k] for k in kept), whisker=number)

    def points_only(self) -> "Centrelines":
        """Return the same lines without what only the following steps need."""
        left_out = ("offset_px", "information", "thickness_px", "end_px", "hidden_px")
        return replace(self, **dict.fromkeys(left_out))

    def moved(self, shifts) -> "Centrelines":
        """Return the lines moved by the shift x, y [px] of every frame."""
        by = np.reshape(shifts, (-1, 2))[self.frame]
        x, y = np.repeat(by, np.diff(self.offsets), axis=0).T.astype(np.float32)
        return replace(self, x_px=self.x_px + x, y_px=self.y_px + y)

    def rows(self, rows, most=np.inf) -> "Centrelines":
        """Return the rows of these numbers, in their order; of each, `most` points at most."""
        counts = np.minimum(np.diff(self.offsets)[rows], most).astype(np.int64)
        offsets = np.append(0, np.cumsum(counts)).astype(np.int64)
        points = np.repeat(self.offsets[rows] - offsets[:-1], counts) + np.arange(offsets[-1])
        taken = {name: rows for name in PER_ROW} | {name: points for name in PER_POINT}
        values = {name: getattr(self, name) for name in taken}
        values = {n: v if v is None else v[taken[n]] for n, v in values.items()}
        return replace(self, offsets=offsets, **values)


@contextlib.contextmanager
def centreline_file(path):
    """Yield a function that takes `Centrelines`, chunk by chunk, into centrelines.parquet.

    The file, a row per whisker and frame with the points as lists, appears when the block ends.
    """
    with parquet_writer(path, CENTRELINE_COLUMNS) as writer:

        def keep(centrelines: Centrelines) -> None:
            for start in range(0, len(centrelines), ROWS_PER_GROUP):
                stop = min(start + ROWS_PER_GROUP, len(centrelines))
                writer.write_table(_centreline_rows(centrelines, start, stop, writer.schema))

        yield keep


def write_centrelines(path, centrelines: Centrelines) -> None:
    """Write centrelines.parquet in one go."""
    with centreline_file(path) as keep:
        keep(centrelines)


def _centreline_rows(centrelines, start, stop, schema):
    """Rows start:stop as an arrow table; the points are not copied."""
    import pyarrow as pa

    offsets = centrelines.offsets[start : stop + 1]
    points = slice(offsets[0], offsets[-1])
    offsets = pa.array((offsets - offsets[0]).astype(np.int32))
    names = np.asarray(centrelines.names, dtype=object)
    columns = [
        pa.array(np.asarray(centrelines.frame[start:stop], dtype=np.int32)),
        pa.array(names[centrelines.whisker[start:stop]], type=pa.string()),
        pa.ListArray.from_arrays(offsets, pa.array(centrelines.x_px[points], pa.float32())),
        pa.ListArray.from_arrays(offsets, pa.array(centrelines.y_px[points], pa.float32())),
    ]
    return pa.Table.from_arrays(columns, schema=schema)


def centreline_table(chunks) -> pd.DataFrame:
    """Centrelines as a table: a row per whisker and frame, the points as an array each."""
    table = {c.name: [] for c in CENTRELINE_COLUMNS}
    for lines in chunks:
        table["frame"].extend(lines.frame.tolist())
        table["whisker"].extend(lines.names[k] for k in lines.whisker)
        table["x_px"].extend(np.split(lines.x_px, lines.offsets[1:-1]) if len(lines) else [])
        table["y_px"].extend(np.split(lines.y_px, lines.offsets[1:-1]) if len(lines) else [])
    return with_units(as_table(pd.DataFrame(table), CENTRELINE_COLUMNS), CENTRELINE_COLUMNS)


def lines_of_table(table: pd.DataFrame) -> Centrelines:
    """`Centrelines` of a table with the columns of centrelines.parquet, in any order of rows.

    Raises
    ------
    ValueError
        Where it is no table or a column is missing, a frame has no number or a whisker no name or
        several lines in it, or x and y of a row are no numbers or differ in length.
    """
    check_table(table)
    x, y = (list(map(_numbers, range(len(table)), table[name])) for name in ("x_px", "y_px"))
    for row, (one, other) in enumerate(zip(x, y, strict=True)):
        if one.ndim != 1 or one.shape != other.shape:
            raise ValueError(
                f"row {row}: x_px has the shape {one.shape}, y_px {other.shape}: expected a list "
                "of as many numbers in both"
            )
    _check_rows(table)
    names = tuple(dict.fromkeys(table["whisker"]))
    whisker = [names.index(name) for name in table["whisker"]]
    points = [np.concatenate([*each, np.empty(0, np.float32)]) for each in (x, y)]
    return Centrelines.of_points(names, table["frame"], whisker, [len(row) for row in x], points)


def check_table(table) -> None:
    """ValueError where it is no table, or lacks a column of centrelines.parquet."""
    if not isinstance(table, pd.DataFrame):
        raise ValueError(
            "expected a table of centrelines, as `Analysis.centrelines` or pandas' `read_parquet` "
            f"gives it, got {type(table).__name__}"
        )
    for column in CENTRELINE_COLUMNS:
        if column.name not in table:
            raise ValueError(
                f"a table of centrelines needs the column {column.name} ({column.meaning}); this "
                f"one has {', '.join(map(str, table.columns))}"
            )


def _numbers(row, values) -> np.ndarray:
    """The numbers in a cell of the table, float32; ValueError where it holds something else."""
    try:
        return np.asarray(values, np.float32)
    except ValueError:
        raise ValueError(
            f"row {row}: has {str(values)[:40]!r} in place of a list of numbers; read the table "
            "from a parquet file, which keeps lists"
        ) from None


def _check_rows(table) -> None:
    """ValueError where a row has no name or number of a frame, or a whisker is there twice."""
    for row, name in enumerate(table["whisker"]):
        if not isinstance(name, str):
            raise ValueError(f"row {row}: whisker is {name!r}: expected its name, a text")
    frame = pd.to_numeric(table["frame"], errors="coerce").to_numpy(float)
    for row in np.flatnonzero(~are_frames(frame)):
        value = table["frame"].tolist()[row]
        raise ValueError(
            f"row {row}: frame is {value!r}: expected a whole number from 0 to {MOST_FRAMES}"
        )
    for row in np.flatnonzero(table.duplicated(["frame", "whisker"])):
        name = table["whisker"].iloc[row]
        raise ValueError(
            f"row {row}: a second line of whisker {name} in frame {frame[row]:.0f}: expected one"
        )


def are_frames(numbers) -> np.ndarray:
    """Which numbers (rows,) may be those of a video's frames, bool (rows,)."""
    return (numbers >= 0) & (numbers <= MOST_FRAMES) & (numbers == np.floor(numbers))


def centreline_chunks(path, filters=None):
    """Yield the `Centrelines` of a centrelines.parquet in parts that fit into memory."""
    import pyarrow.dataset as ds
    import pyarrow.parquet as pq

    expression = None if filters is None else pq.filters_to_expression(filters)
    # starting threads takes longer than what they would do
    checked = ds.ParquetFragmentScanOptions(page_checksum_verification=True)
    with whole_parquet(path):
        batches = ds.dataset(path).to_batches(
            filter=expression, batch_size=1024, use_threads=False, fragment_scan_options=checked
        )
        for batch in batches:
            if len(batch):
                yield _centrelines(batch)


def read_centrelines(path, filters=None) -> Centrelines:
    """Read centrelines.parquet, the rows that pass `filters` (as in `read_frames`).

    Standard error and confidence, which the file lacks, are NaN.
    """
    return _centrelines(read_rows(path, CENTRELINE_COLUMNS, filters=filters).combine_chunks())


def _centrelines(table) -> Centrelines:
    """An arrow table or batch of centrelines.parquet as `Centrelines`."""
    import pyarrow.compute as pc

    whiskers = table.column("whisker").to_pylist()
    names = tuple(dict.fromkeys(whiskers))
    number = {name: i for i, name in enumerate(names)}
    x, y = (table.column(name) for name in ("x_px", "y_px"))
    return Centrelines.of_points(
        names,
        table.column("frame"),
        [number[name] for name in whiskers],
        np.asarray(pc.list_value_length(x)),
        [np.asarray(pc.list_flatten(each)) for each in (x, y)],
        confidence=np.full(len(whiskers), np.nan, np.float32),
    )
