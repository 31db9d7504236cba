"""Tables on disk: CSV and parquet, of declared columns."""

import contextlib
import csv
import json
from pathlib import Path

import numpy as np
import pandas as pd

from pipeline.errors import renamed
from pipeline.tables.columns import FRAME_COLUMNS, Column, as_table, units_of
from pipeline.tables.own_files import replace_own
from pipeline.tables.whole_files import whole_file

DIGITS, MICROSECONDS = "{:.6g}", "{:.6f}"  # of the numbers in a CSV, and of times [s]
ROWS_PER_GROUP = 8192
SHOWN = 40  # characters of a wrong value
SEPARATORS = {";": "semicolons", "\t": "tabs"}  # of spreadsheets, in place of commas
RUN_AGAIN = "; it was damaged or changed: `whiskerforce run` writes it anew"
PARQUET, TAIL_BYTES = b"PAR1", 8  # how such a file begins; what follows on its list of contents


# --- CSV ---------------------------------------------------------------------------------


def csv_text(values: pd.Series, digits=DIGITS):
    """Values of one column as text for a CSV: true/false, numbers of some digits, "" for none."""
    if values.dtype.kind == "b":
        return values.map({True: "true", False: "false"})
    if values.dtype.kind == "f":
        return ["" if np.isnan(v) else digits.format(v) for v in values]
    return values.fillna("")


def write_csv(path, table: pd.DataFrame, columns=()) -> None:
    """Write `table` with exactly the declared `columns`: true/false, nothing for missing.

    Without `columns` it is written as it is. pandas' own writer takes three times as long.
    """
    times = {column.name: MICROSECONDS for column in columns if column.unit == "s"}
    table = as_table(table, columns) if columns else table
    text = {name: csv_text(values, times.get(name, DIGITS)) for name, values in table.items()}
    with whole_file(path) as temporary, open(temporary, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(text)
        writer.writerows(zip(*text.values(), strict=True))


def replace_csv(path, table: pd.DataFrame, columns) -> list[str]:
    """Write a CSV of a results folder as `write_csv`; one that a person has changed is kept.

    Returns a sentence on that, if there is anything to say.
    """
    return replace_own(path, lambda new: write_csv(new, table, columns))


def read_csv(path, columns) -> pd.DataFrame:
    """Read a CSV of the declared `columns`, as `write_csv` left it.

    Raises
    ------
    ValueError
        Where a declared column is missing or holds something else; it names file, column and
        line.
    """
    return read_numbered_csv(path, columns)[0]


def read_numbered_csv(path, columns, advice=RUN_AGAIN) -> tuple[pd.DataFrame, list[int]]:
    """As `read_csv`, and the line of the file in which each row is; errors end with `advice`."""
    try:
        return _csv_table(path, columns)
    except ValueError as error:
        raise ValueError(f"{path}: {error}{advice}") from None


def _csv_table(path, columns):
    header, rows, lines = _csv_rows(path)
    missing = [c.name for c in columns if c.name not in header and not c.later]
    if missing:
        found = ", ".join(header)[: 5 * SHOWN] or "none"
        raise ValueError(f"expected column {missing[0]}, found {found}")
    out = {}
    for c in [c for c in columns if c.name in header]:
        place = header.index(c.name)
        out[c.name] = _parsed([row[place] for row in rows], c, lines)
    table = pd.DataFrame(out)
    return (table if len(out) == len(columns) else as_table(table, columns)), lines


def check_separator(names) -> None:
    """ValueError where a table's column `names` came as one, separated by no commas."""
    for separator, what in SEPARATORS.items():
        if len(names) == 1 and separator in names[0]:
            raise ValueError(
                f"its columns are separated by {what}, as some spreadsheets save them; expected "
                "commas, and points in decimal numbers"
            )


def _csv_rows(path):
    """Header, rows and their lines of a CSV; each row has as many values as the header.

    Rows of empty cells are left out: spreadsheets leave them where a row was emptied. ValueError
    if it is no CSV. Many small files are read far more quickly so than by pandas.
    """
    try:
        with open(path, newline="", encoding="utf-8-sig") as file:
            reader = csv.reader(file, strict=True)
            numbered = [(reader.line_num, row) for row in reader if any(row)]
    except UnicodeDecodeError:
        raise ValueError(
            "some of its letters are not UTF-8; save it as `CSV UTF-8`, as spreadsheets call it"
        ) from None
    except csv.Error as error:
        raise ValueError(str(error)) from None
    (_, header), *numbered = numbered or [(1, [])]
    check_separator(header)
    width = len(header)
    for line, row in numbered:
        if len(row) > width:
            raise ValueError(f"line {line}: expected {width} values, found {len(row)}")
    lines = [line for line, _ in numbered]
    return header, [row + [""] * (width - len(row)) for _, row in numbered], lines


def _parsed(text: list[str], column: Column, lines: list[int]):
    """Text of one CSV column as an array of its declared dtype."""
    if column.dtype == "bool":
        return np.array([value.lower() in ("true", "1") for value in text], bool)
    if column.dtype == "string":
        values = pd.Series(text, dtype="str")
        return values if values.dtype == "string" else values.astype("string")
    whole = column.dtype.startswith("int")
    values = np.empty(len(text), column.dtype)
    for k, (line, value) in enumerate(zip(lines, text, strict=True)):
        try:
            values[k] = _whole(value, column) if whole else float(value or "nan")
        except ValueError:
            raise ValueError(
                f"line {line}: {column.name} is {value[:SHOWN]!r}, expected a "
                f"{'whole ' if whole else ''}number"
            ) from None
    return values


def _whole(text, column) -> int:
    """A whole number that the column can hold; ValueError else."""
    limits = np.iinfo(column.dtype)
    text = text.removesuffix(".0")  # as pandas writes a column in which a number is missing
    if limits.min <= (value := int(text)) <= limits.max:
        return value
    raise ValueError("too large")


# --- parquet -----------------------------------------------------------------------------


def _arrow_schema(columns):
    """Arrow schema of declared columns; unit and meaning travel as field metadata.

    What `pandas.read_parquet` puts into `attrs` travels under a key of pandas.
    """
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
        ],
        metadata={"PANDAS_ATTRS": json.dumps({"units": units_of(columns)})},
    )


@contextlib.contextmanager
def parquet_writer(path, columns):
    """Yield a parquet writer of the declared columns whose file appears when the block ends."""
    import pyarrow.parquet as pq

    # dictionaries suit names; numbers pack better by their bytes, and many times faster
    paths = {"float64": "{}", "list<float32>": "{}.list.element"}
    numbers = [paths[c.dtype].format(c.name) for c in columns if c.dtype in paths]
    options = {
        "compression": "zstd",
        "use_dictionary": [c.name for c in columns if c.dtype == "string"],
        "column_encoding": dict.fromkeys(numbers, "BYTE_STREAM_SPLIT"),
        # minima and maxima serve filters, and nobody filters rows by their points
        "write_statistics": [c.name for c in columns if not c.dtype.startswith("list")],
        "write_page_checksum": True,
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
    with parquet_writer(path, columns) as writer:
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
    ValueError where it is damaged, or lacks a column.
    """
    return read_rows(path, FRAME_COLUMNS, columns, filters).to_pandas()


def read_rows(path, declared=(), columns=None, filters=None):
    """Read an arrow table of `declared` columns from a parquet file, as `read_frames` does.

    Raises
    ------
    ValueError
        Where the file is damaged, or lacks a column that is read: it names the file.
    """
    import pyarrow.parquet as pq

    with whole_parquet(path):
        wanted = [c for c in declared if columns is None or c.name in columns]
        _check_parts(path, pq.read_metadata(path), wanted)
        return pq.read_table(
            path, columns=columns, filters=filters, page_checksum_verification=True
        )


@contextlib.contextmanager
def whole_parquet(path):
    """Turn what pyarrow raises at a damaged file into a ValueError that names it."""
    import pyarrow as pa

    try:
        yield
    except FileNotFoundError as error:
        raise renamed(error, path) from None  # pyarrow's has no file name
    except (OSError, pa.ArrowException) as error:
        reason = " ".join(str(error).split())[: 5 * SHOWN]
        raise ValueError(
            f"{path}: damaged, or not a table of whiskerforce ({reason}); run its video again"
        ) from None


def _check_parts(path, metadata, columns) -> None:
    """ValueError where a parquet file lacks a column, or its end does not list all that it holds.

    Checksums protect its pages, but not the list of them.
    """
    names = metadata.schema.to_arrow_schema().names
    for column in columns:
        if column.name not in names:
            raise ValueError(f"{path}: expected column {column.name}; run its video again")
    groups = [metadata.row_group(k) for k in range(metadata.num_row_groups)]
    pages = sum(g.column(k).total_compressed_size for g in groups for k in range(g.num_columns))
    size = len(PARQUET) + pages + metadata.serialized_size + TAIL_BYTES
    rows = sum(group.num_rows for group in groups)
    if size != Path(path).stat().st_size or rows != metadata.num_rows:
        raise ValueError(f"{path}: damaged, its list of contents is wrong; run its video again")


def check_parquet(path, columns, thorough=False) -> int:
    """Check that a parquet file holds the declared `columns`; return the number of its rows.

    Raises
    ------
    FileNotFoundError, ValueError
        Where it is missing or damaged. Only a `thorough` check reads all of it, and finds any
        byte of the values that has changed.
    """
    import pyarrow.parquet as pq

    with whole_parquet(path), pq.ParquetFile(path, page_checksum_verification=True) as file:
        _check_parts(path, file.metadata, columns)
        for column in _arrow_schema(columns):
            if file.schema_arrow.field(column.name).type != column.type:
                raise ValueError(f"{path}: expected column {column.name} of type {column.type}")
        for group in range(file.num_row_groups if thorough else 0):
            file.read_row_group(group, use_threads=False)
        return file.metadata.num_rows
