"""Tables on disk: parquet and CSV, each whole or not at all, and the dictionary of columns."""

import contextlib
import json
import os
import tempfile
from pathlib import Path

import numpy as np
import pandas as pd

from pipeline.records import (
    CENTRELINE_COLUMNS,
    CONTACT_COLUMNS,
    CONTACT_FLAGS,
    CORRECTION_COLUMNS,
    EVIDENCE_COLUMNS,
    FRAME_COLUMNS,
    VIDEO_COLUMNS,
    Centrelines,
    Column,
    as_table,
)

ROWS_PER_GROUP = 8192


@contextlib.contextmanager
def whole_file(path):
    """Yield a temporary path beside `path` that replaces it when the block ends well.

    Readers see the old file or the new one, never a part; if the block fails, the temporary
    file goes and `path` stays as it was.
    """
    path = Path(path)
    handle, name = tempfile.mkstemp(prefix=".", suffix=f".part{path.suffix}", dir=path.parent)
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        temporary.chmod(0o666 & ~_umask())
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def _umask() -> int:
    """The process's file-mode mask, which can only be read by setting it."""
    mask = os.umask(0o022)
    os.umask(mask)
    return mask


def write_text(path, text: str) -> None:
    """Write a text file, whole or not at all."""
    with whole_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def write_json(path, value) -> None:
    """Write a JSON file, whole or not at all."""
    write_text(path, json.dumps(value, indent=2, ensure_ascii=False) + "\n")


def read_json(path, default=None):
    """Read a JSON object from a file; `default` where there is none."""
    try:
        value = json.loads(Path(path).read_text(encoding="utf-8"))
    except (FileNotFoundError, NotADirectoryError, ValueError):
        return default
    return value if isinstance(value, dict) else default


# --- CSV ---------------------------------------------------------------------------------


def _digits(column: Column) -> str:
    """Number format of a float column: microseconds for times, six digits for the rest."""
    return "{:.6f}" if column.unit == "s" else "{:.6g}"


def _csv_text(values: pd.Series, column: Column):
    """Values of one column as they stand in a CSV."""
    if column.dtype == "bool":
        return values.map({True: "true", False: "false"})
    if column.dtype == "float64":
        form = _digits(column).format
        return [form(v) if np.isfinite(v) else ("" if np.isnan(v) else str(v)) for v in values]
    return values


def write_csv(path, table: pd.DataFrame, columns) -> None:
    """Write `table` with exactly the declared `columns`: true/false, nothing for missing."""
    table = as_table(table, columns)
    text = {c.name: _csv_text(table[c.name], c) for c in columns}
    with whole_file(path) as temporary:
        pd.DataFrame(text).to_csv(temporary, index=False, lineterminator="\n")


def read_csv(path, columns) -> pd.DataFrame:
    """Read a CSV of the declared `columns`, as `write_csv` left it.

    Raises
    ------
    ValueError
        Where a declared column is missing or holds something else; it names file, column and
        line.
    """
    try:
        table = pd.read_csv(path, dtype="str", keep_default_na=False, encoding="utf-8-sig")
    except ValueError as error:  # no table at all, or a line of too many values
        raise ValueError(f"{path}: {' '.join(str(error).split())}") from None
    table = table.fillna("")  # a line of too few values
    missing = [c.name for c in columns if c.name not in table]
    if missing:
        raise ValueError(f"{path}: expected column {missing[0]}, found {list(table.columns)}")
    out = {}
    for c in columns:
        try:
            out[c.name] = _parsed(table[c.name], c)
        except ValueError as error:
            raise ValueError(f"{path}: {error}") from None
    return as_table(pd.DataFrame(out), columns)


def _parsed(text: pd.Series, column: Column):
    """Text of one CSV column as values of its declared dtype."""
    if column.dtype == "bool":
        return text.str.lower().isin(["true", "1"])
    if column.dtype == "string":
        return text
    whole = column.dtype.startswith("int")
    values = []
    for line, value in enumerate(text, start=2):
        try:
            values.append(int(value) if whole else float(value or "nan"))
        except ValueError:
            raise ValueError(
                f"line {line}: {column.name} is {value!r}, expected a "
                f"{'whole ' if whole else ''}number"
            ) from None
    return values


# --- parquet -----------------------------------------------------------------------------


def _arrow_schema(columns):
    """Arrow schema of declared columns; unit and meaning travel as field metadata."""
    import pyarrow as pa

    types = {
        "int32": pa.int32(),
        "int64": pa.int64(),
        "float64": pa.float64(),
        "bool": pa.bool_(),
        "string": pa.string(),
        "list<float32>": pa.list_(pa.float32()),
    }
    return pa.schema(
        [
            pa.field(c.name, types[c.dtype], metadata={"unit": c.unit, "meaning": c.meaning})
            for c in columns
        ]
    )


@contextlib.contextmanager
def _parquet_writer(path, columns):
    """Yield a parquet writer of the declared columns whose file appears when the block ends."""
    import pyarrow.parquet as pq

    # dictionaries suit names; numbers pack better by their bytes, and many times faster
    paths = {"float64": "{}", "list<float32>": "{}.list.element"}
    numbers = [paths[c.dtype].format(c.name) for c in columns if c.dtype in paths]
    options = {
        "compression": "zstd",
        "use_dictionary": [c.name for c in columns if c.dtype == "string"],
        "column_encoding": dict.fromkeys(numbers, "BYTE_STREAM_SPLIT"),
        # least and greatest serve filters, and nobody asks for rows by their points
        "write_statistics": [c.name for c in columns if not c.dtype.startswith("list")],
    }
    with (
        whole_file(path) as temporary,
        pq.ParquetWriter(temporary, _arrow_schema(columns), **options) as writer,
    ):
        yield writer


def write_rows(path, table: pd.DataFrame, columns) -> None:
    """Write a table of the declared columns as a parquet file."""
    import pyarrow as pa

    table = as_table(table, columns)
    with _parquet_writer(path, columns) as writer:
        for start in range(0, len(table), ROWS_PER_GROUP):
            part = table.iloc[start : start + ROWS_PER_GROUP]
            writer.write_table(
                pa.Table.from_pandas(part, schema=writer.schema, preserve_index=False)
            )


def write_frames(path, frames: pd.DataFrame) -> None:
    """Write frames.parquet: a row per whisker and frame."""
    write_rows(path, frames, FRAME_COLUMNS)


def read_frames(path, columns=None, filters=None) -> pd.DataFrame:
    """Read frames.parquet: the `columns` named (None: all) of the rows that pass `filters`.

    `filters` as pyarrow takes them, e.g. ``[("frame", ">=", 100), ("whisker", "==", "C2")]``.
    """
    import pyarrow.parquet as pq

    return pq.read_table(path, columns=columns, filters=filters).to_pandas()


@contextlib.contextmanager
def centreline_file(path):
    """Yield a function that takes `Centrelines`, chunk by chunk, into centrelines.parquet.

    The file, a row per whisker and frame with the points as lists, appears when the block ends.
    """
    with _parquet_writer(path, CENTRELINE_COLUMNS) as writer:

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


def centreline_chunks(path, filters=None):
    """Yield the `Centrelines` of a centrelines.parquet in parts that fit into memory."""
    import pyarrow.dataset as ds
    import pyarrow.parquet as pq

    expression = None if filters is None else pq.filters_to_expression(filters)
    # starting threads takes longer than what they would do
    batches = ds.dataset(path).to_batches(filter=expression, batch_size=1024, use_threads=False)
    for batch in batches:
        if len(batch):
            yield _centrelines(batch)


def read_centrelines(path, filters=None) -> Centrelines:
    """Read centrelines.parquet, the rows that pass `filters` (as in `read_frames`).

    Standard error and confidence, which the file lacks, are NaN.
    """
    import pyarrow.parquet as pq

    return _centrelines(pq.read_table(path, filters=filters).combine_chunks())


def _centrelines(table) -> Centrelines:
    """An arrow table or batch of centrelines.parquet as `Centrelines`."""
    whiskers = table.column("whisker").to_pylist()
    names = tuple(dict.fromkeys(whiskers))
    number = {name: i for i, name in enumerate(names)}
    frame = np.asarray(table.column("frame")).astype(np.int32)
    x, y = (_flat(table.column(name)) for name in ("x_px", "y_px"))
    lengths = _list_lengths(table.column("x_px"))
    return Centrelines(
        names=names,
        frame=frame,
        whisker=np.array([number[name] for name in whiskers], dtype=np.int32),
        offsets=np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64),
        x_px=x,
        y_px=y,
        se_px=np.full(len(x), np.nan, np.float32),
        confidence=np.full(len(frame), np.nan, np.float32),
    )


def _flat(column) -> np.ndarray:
    """All points of a list column, one after the other."""
    import pyarrow.compute as pc

    return np.asarray(pc.list_flatten(column)).astype(np.float32)


def _list_lengths(column) -> np.ndarray:
    import pyarrow.compute as pc

    return np.asarray(pc.list_value_length(column)).astype(np.int64)


# --- how a video was processed (run.json in its folder) -----------------------------------


def pole_runs(track) -> dict | None:
    """A `PoleTrack` as runs of frames at one place, [first frame, x, y], for run.json."""
    if track is None:
        return None
    places = np.column_stack([track.x_px, track.y_px]).round(3)
    same = (places[1:] == places[:-1]) | (np.isnan(places[1:]) & np.isnan(places[:-1]))
    starts = np.flatnonzero(np.concatenate([[True], ~same.all(axis=1)]))
    runs = [[int(i), *(None if np.isnan(v) else float(v) for v in places[i])] for i in starts]
    return {"radius_px": float(track.radius_px), "runs": runs}


def pole_at(state: dict, frame: int) -> tuple[float, float, float] | None:
    """(x, y, radius) [px] of the pole at a frame, from a video's run.json; None: not in view."""
    pole = state.get("pole")
    if not pole:
        return None
    starts = [run[0] for run in pole["runs"]]
    _, x, y = pole["runs"][max(int(np.searchsorted(starts, frame, side="right")) - 1, 0)]
    return None if x is None else (x, y, pole["radius_px"])


# --- the dictionary of columns -----------------------------------------------------------

FILES = {
    "centrelines.parquet": ("A row per whisker and frame.", CENTRELINE_COLUMNS),
    "frames.parquet": ("A row per whisker and frame.", FRAME_COLUMNS),
    "contacts.csv": ("A row per contact.", CONTACT_COLUMNS),
    "videos.csv": ("A row per input video.", VIDEO_COLUMNS),
    "corrections.csv": (
        "What a person said of a video's contacts (docs/curate.md), a row per verdict.",
        CORRECTION_COLUMNS,
    ),
    "evidence.parquet": (
        "What the contacts of a video rest on, a row per whisker and frame, in SI units.",
        EVIDENCE_COLUMNS,
    ),
}


def data_dictionary() -> str:
    """Every table, column and flag with its meaning, as markdown (docs/tables.md)."""
    lines = [
        "# Tables",
        "",
        "Written from the declarations in the code by `python -m pipeline.tables`; do not edit.",
        "Missing values are NaN (parquet) or empty (CSV).",
    ]
    for name, (what, columns) in FILES.items():
        lines += ["", f"## {name}", "", what, "", "| column | type | unit | meaning |"]
        lines.append("|---|---|---|---|")
        lines += [
            f"| `{c.name}` | {c.dtype} | {c.unit} | {c.meaning.replace('|', chr(92) + '|')} |"
            for c in columns
        ]
    lines += ["", "## Flags of contacts", "", "| flag | meaning |", "|---|---|"]
    lines += [f"| `{flag}` | {meaning} |" for flag, meaning in CONTACT_FLAGS.items()]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    print(data_dictionary(), end="")
