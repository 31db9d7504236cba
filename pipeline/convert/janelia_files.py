"""Files of the Janelia Whisker Tracker: `.whiskers` (whiskbin1), `.measurements` (v1–v3), `.bar`.

All binary numbers are little-endian. Points are (x, y) in pixels as here: x right, y down.
"""

import struct
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from pipeline.errors import InputError
from pipeline.tables.whole_files import whole_file

WHISKERS_MAGIC = b"bwhiskbin1\0\0"
MEASUREMENTS_MAGIC = {b"measV1\0\0": 1, b"measv2\0\0": 2, b"measv3\0\0": 3}
HEAD = struct.Struct("<3i")  # of a segment: its number, frame, count of points
FOLLICLE = 4, 5  # the columns of values with its x and y
BYTES_OF_ROW = {1: 40, 2: 48, 3: 41}  # before the values, as 64-bit systems write them


class Segment(NamedTuple):
    """One traced line: its number in the frame, the frame, and float32 values of its points."""

    number: int
    frame: int
    x: np.ndarray
    y: np.ndarray
    thickness: np.ndarray
    score: np.ndarray


@dataclass(frozen=True)
class Measurements:
    """A table of measurements, a row per segment.

    Attributes
    ----------
    frame, segment : int32 (rows,), which segment of the `.whiskers` file a row is of
    label : int32 (rows,), number of the whisker along the face; −1: no whisker
    face : (x, y) [px]
    face_axis : "x", "y" or "" where the version does not say
    follicle_columns : columns of `values` with the follicle's x and y
    values, velocity : float64 (rows, columns); the columns are length, score, angle, curvature,
        follicle's x and y, tip's x and y, and the distance to the bar where there is one
    velocity_known : bool (rows,)
    """

    frame: np.ndarray
    segment: np.ndarray
    label: np.ndarray
    values: np.ndarray
    velocity: np.ndarray
    velocity_known: np.ndarray
    face: tuple[int, int] = (0, 0)
    face_axis: str = ""
    follicle_columns: tuple[int, int] = FOLLICLE

    def __len__(self):
        return len(self.frame)

    @property
    def follicle(self) -> np.ndarray:
        """Where the segments leave the face, float64 (rows, 2) [px]."""
        return self.values[:, list(self.follicle_columns)]


# --- .whiskers ---------------------------------------------------------------------------


def read_whiskers(path) -> list[Segment]:
    """Read the segments of a binary `.whiskers` file.

    Raises
    ------
    InputError
        Where it is of another kind, or damaged.
    """
    data = _bytes(path)
    if data[:8] in MEASUREMENTS_MAGIC:
        raise InputError(
            f"{path}: holds measurements of lines, not the lines; name the .whiskers file, and "
            "leave this one beside it"
        )
    if not data.startswith(WHISKERS_MAGIC):
        raise InputError(
            f"{path}: is not a binary .whiskers file (it begins with {data[:12]!r}, expected "
            f"{WHISKERS_MAGIC!r}); convert it with `whisker_convert IN OUT whiskbin1`"
        )
    place, end, segments = len(WHISKERS_MAGIC), len(data) - 4, []
    while place < end:  # the count at the end counts lines without points, which are not there
        segment, place = _segment(data, place, end, path)
        segments.append(segment)
    if place != end:
        raise _cut(path, "the number of its lines is missing at the end")
    return segments


def _segment(data, place, end, path):
    """The segment that begins at byte `place`, and where the next one does."""
    if place + HEAD.size > end:
        raise _cut(path, f"a line begins at byte {place} and does not end")
    number, frame, n = HEAD.unpack_from(data, place)
    stop = place + HEAD.size + 16 * n
    if n < 0 or frame < 0 or stop > end:
        raise _cut(path, f"the line at byte {place} says frame {frame}, {n} points")
    values = np.frombuffer(data, "<f4", 4 * n, place + HEAD.size).reshape(4, n)
    return Segment(number, frame, *values.astype(np.float32)), stop


def write_whiskers(path, segments) -> None:
    """Write segments as a binary `.whiskers` file, whole or not at all."""
    parts, count = [WHISKERS_MAGIC], 0
    for each in segments:
        parts.append(HEAD.pack(each.number, each.frame, len(each.x)))
        parts.append(np.stack(each[2:]).astype("<f4").tobytes())
        count += 1
    parts.append(struct.pack("<i", count))
    _write(path, b"".join(parts))


# --- .measurements -----------------------------------------------------------------------


def read_measurements(path) -> Measurements:
    """Read a `.measurements` file of version 1, 2 or 3, rows in the order of the table.

    Raises
    ------
    InputError
        Where it is of another kind, or damaged.
    """
    data = _bytes(path)
    version = MEASUREMENTS_MAGIC.get(data[:8])
    if version is None:
        raise InputError(
            f"{path}: is not a .measurements file of version 1 to 3 (begins with {data[:8]!r}); "
            "convert it with `measurements_convert IN OUT v3`"
        )
    rows = _rows(data, version, path)[::-1]  # the last row comes first in the file
    head = rows["head"]
    axis = rows["axis"][0].decode("latin-1") if version > 1 and len(rows) else ""
    first = head[0] if len(rows) else np.array([0, 0, 0, 0, 0, 0, *FOLLICLE, 0, 0])
    return Measurements(
        frame=head[:, 1].copy(),
        segment=head[:, 2].copy(),
        label=head[:, 3].copy(),
        values=rows["values"].copy(),
        velocity=rows["velocity"].copy(),
        velocity_known=head[:, 8] != 0,
        face=(int(first[4]), int(first[5])),
        face_axis=axis,
        follicle_columns=_follicle_columns(first, rows, path),
    )


def _follicle_columns(first, rows, path):
    """The columns with the follicle's place, checked."""
    columns, count = (int(first[6]), int(first[7])), rows["values"].shape[1]
    if len(rows) and not all(0 <= column < count for column in columns):
        raise _cut(path, f"its follicle is in columns {columns} of {count}")
    return columns


def _rows(data, version, path):
    """Rows as a structured array; their length follows from the file's.

    Version 2 depends on the computer that wrote it: 44 or 48 bytes come before the values.
    """
    if len(data) < 16:
        raise _cut(path, f"it has {len(data)} bytes")
    count, columns = struct.unpack_from("<2i", data, 8)
    if count == 0:
        return np.empty(0, _row_type(max(columns, 0), BYTES_OF_ROW[version]))
    before = (len(data) - 16) / count - 16 * columns
    least = 40 if version == 1 else 41
    if count < 0 or columns < 1 or not least <= before <= 48 or before % 1:
        raise _cut(path, f"it says {count} rows of {columns} columns and has {len(data)} bytes")
    return np.frombuffer(data, _row_type(columns, int(before)), count, 16)


def _row_type(columns, before):
    """Type of a row with so many columns and so many bytes before its values."""
    fields = [("head", "<i4", (10,))]
    fields += [("axis", "S1")] if before > 40 else []
    fields += [("gap", f"V{before - 41}")] if before > 41 else []
    return np.dtype([*fields, ("values", "<f8", (columns,)), ("velocity", "<f8", (columns,))])


def write_measurements(path, table: Measurements, version: int = 3) -> None:
    """Write a `.measurements` file, whole or not at all; version 1 forgets the face's axis."""
    magic = next(magic for magic, v in MEASUREMENTS_MAGIC.items() if v == version)
    count, columns = table.values.shape
    rows = np.zeros(count, _row_type(columns, BYTES_OF_ROW[version]))
    head = rows["head"]
    head[:, 0] = np.arange(count) * columns // 8  # an offset, which readers make anew
    head[:, 1], head[:, 2], head[:, 3] = table.frame, table.segment, table.label
    head[:, 4:8] = *table.face, *table.follicle_columns
    head[:, 8], head[:, 9] = table.velocity_known, columns
    if version > 1:
        rows["axis"] = table.face_axis.encode("latin-1")
    rows["values"], rows["velocity"] = table.values, table.velocity
    _write(path, magic + struct.pack("<2i", count, columns) + rows[::-1].tobytes())


# --- .bar --------------------------------------------------------------------------------


def read_bar(path) -> np.ndarray:
    """Read a `.bar` file: frame, x, y [px] of the pole's centre, float64 (rows, 3).

    Raises
    ------
    InputError
        Where a line is something else.
    """
    rows = []
    text = _bytes(path).decode("utf-8-sig", "replace")
    for number, line in enumerate(text.splitlines(), start=1):
        words = line.split()
        if not words:
            continue
        try:
            row = [float(word) for word in words]
            if len(row) != 3 or row[0] != int(row[0]) or row[0] < 0:
                raise ValueError
        except (ValueError, OverflowError):
            raise InputError(
                f"{path}: line {number} is {line[:40]!r}, expected the frame's number, x and y "
                "of the pole; correct the line, or track the pole again"
            ) from None
        rows.append(row)
    return np.array(rows, float).reshape(-1, 3)


def write_bar(path, rows) -> None:
    """Write a `.bar` file of rows (frame, x, y), whole or not at all."""
    text = "".join(f"{int(frame)} {x:.9g} {y:.9g}\n" for frame, x, y in rows)
    _write(path, text.encode())


# --- bytes -------------------------------------------------------------------------------


def _bytes(path) -> bytes:
    try:
        return Path(path).read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); check the name") from None


def _write(path, data):
    with whole_file(path) as temporary:
        temporary.write_bytes(data)


def _cut(path, what) -> InputError:
    return InputError(f"{path}: is cut off or damaged: {what}; copy it again, or track it again")
