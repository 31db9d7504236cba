"""Files of the Janelia Whisker Tracker: its layouts, there and back, and damaged."""

import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from pipeline.convert import janelia_files as janelia
from pipeline.convert.janelia_files import Measurements, Segment
from pipeline.errors import InputError

counts = st.integers(0, 2**31 - 1)


@st.composite
def segments(draw):
    """A segment of up to 6 points, each any float32 there is."""
    n = draw(st.integers(0, 6))
    values = np.frombuffer(draw(st.binary(min_size=16 * n, max_size=16 * n)), "<f4")
    return Segment(draw(counts), draw(counts), *values.reshape(4, n))


@st.composite
def measurements(draw):
    """A table of up to 5 rows, with any float64 there is."""
    rows, columns = draw(st.integers(1, 5)), draw(st.integers(6, 9))
    size = 16 * rows * columns
    content = np.frombuffer(draw(st.binary(min_size=size, max_size=size)), "<f8")
    values, velocity = content.reshape(2, rows, columns)
    rng = np.random.default_rng(draw(counts))
    return Measurements(
        *rng.integers(-1, 2**31 - 1, (3, rows)).astype(np.int32),
        values=values,
        velocity=velocity,
        velocity_known=rng.random(rows) < 0.5,
        face=(draw(counts), draw(counts)),
        face_axis=draw(st.sampled_from("xy")),
    )


@given(lines=st.lists(segments(), max_size=4))
def test_whiskers_there_and_back(tmp_path_factory, lines):
    path = tmp_path_factory.mktemp("w") / "a.whiskers"
    janelia.write_whiskers(path, lines)
    back = janelia.read_whiskers(path)
    assert len(back) == len(lines)
    for one, other in zip(lines, back, strict=True):
        assert one[:2] == other[:2]
        np.testing.assert_array_equal(one[2:], other[2:])


@given(table=measurements(), version=st.sampled_from([1, 2, 3]))
def test_measurements_there_and_back(tmp_path_factory, table, version):
    path = tmp_path_factory.mktemp("m") / "a.measurements"
    janelia.write_measurements(path, table, version)
    back = janelia.read_measurements(path)
    for name, value in vars(table).items():
        if name == "face_axis" and version == 1:
            value = ""
        np.testing.assert_array_equal(getattr(back, name), value)


@given(bar=arrays(np.float64, (3, 3), elements=st.floats(0, 1e6)))
def test_bars_there_and_back(tmp_path_factory, bar):
    path = tmp_path_factory.mktemp("b") / "a.bar"
    bar[:, 0] = bar[:, 0].round()
    janelia.write_bar(path, bar)
    np.testing.assert_allclose(janelia.read_bar(path), bar, rtol=1e-8)


def test_a_bar_file_that_the_tracker_wrote(tmp_path):
    """By Save_Bars_To_Filename of whisk-janelia 1.2.5's libwhiskio; and as Notepad saves it."""
    path, written = tmp_path / "a.bar", b"0 322.451 211.661\n1 322.594 211.738\n2 322.58 212.105\n"
    expected = [[0, 322.451, 211.661], [1, 322.594, 211.738], [2, 322.58, 212.105]]
    for content in (written, b"\xef\xbb\xbf" + written.replace(b"\n", b"\r\n")):
        path.write_bytes(content)
        np.testing.assert_array_equal(janelia.read_bar(path), expected)


def test_whiskers_lie_in_the_file_as_the_tracker_lays_them(tmp_path):
    path = tmp_path / "a.whiskers"
    values = np.arange(8, dtype=np.float32).reshape(4, 2)
    janelia.write_whiskers(path, [Segment(3, 7, *values)])
    expected = b"bwhiskbin1\0\0" + struct.pack("<3i8fi", 3, 7, 2, *range(8), 1)
    assert path.read_bytes() == expected


def test_lines_without_points_are_counted_but_not_there(tmp_path):
    path = tmp_path / "a.whiskers"
    line = struct.pack("<3i4f", 0, 5, 1, 1, 2, 3, 4)
    path.write_bytes(b"bwhiskbin1\0\0" + line + struct.pack("<i", 9))
    (segment,) = janelia.read_whiskers(path)
    assert (segment.frame, *segment[2:]) == (5, 1, 2, 3, 4)


def row_of_version_3(number, frame, label, values):
    head = struct.pack("<10ic", number, frame, 0, label, 886, 162, 4, 5, 0, len(values), b"y")
    return head + np.array(values, "<f8").tobytes() + bytes(8 * len(values))


def test_measurements_lie_in_the_file_last_row_first(tmp_path):
    path = tmp_path / "a.measurements"
    rows = [row_of_version_3(i, i, 2 - i, np.arange(8.0) + i) for i in (2, 1, 0)]
    path.write_bytes(b"measv3\0\0" + struct.pack("<2i", 3, 8) + b"".join(rows))
    table = janelia.read_measurements(path)
    np.testing.assert_array_equal(table.frame, [0, 1, 2])
    np.testing.assert_array_equal(table.label, [2, 1, 0])
    np.testing.assert_array_equal(table.follicle, [[4, 5], [5, 6], [6, 7]])
    assert (table.face, table.face_axis) == ((886, 162), "y")


@pytest.mark.parametrize("before", [44, 48])
def test_version_2_of_32_and_64_bit_systems(tmp_path, before):
    path = tmp_path / "a.measurements"
    head = struct.pack("<10ic", 0, 6, 0, 1, 0, 0, 0, 1, 0, 2, b"x").ljust(before, b"\0")
    path.write_bytes(
        b"measv2\0\0" + struct.pack("<2i", 1, 2) + head + struct.pack("<4d", 1, 2, 3, 4)
    )
    table = janelia.read_measurements(path)
    np.testing.assert_array_equal(table.values, [[1, 2]])
    np.testing.assert_array_equal(table.velocity, [[3, 4]])
    assert (table.frame[0], table.face_axis) == (6, "x")


def test_a_table_without_rows(tmp_path):
    path = tmp_path / "a.measurements"
    path.write_bytes(b"measv3\0\0" + struct.pack("<2i", 0, 8))
    assert len(janelia.read_measurements(path)) == 0


READERS = {
    "whiskers": janelia.read_whiskers,
    "measurements": janelia.read_measurements,
    "bar": janelia.read_bar,
}


def whole_file(kind):
    """Bytes of a small good file."""
    if kind == "bar":
        return b"0 10.5 20\n1 11 21\n"
    if kind == "measurements":
        rows = [row_of_version_3(i, i, 0, np.arange(8.0)) for i in (1, 0)]
        return b"measv3\0\0" + struct.pack("<2i", 2, 8) + b"".join(rows)
    line = struct.pack("<3i8f", 0, 0, 2, *range(8))
    return b"bwhiskbin1\0\0" + 2 * line + struct.pack("<i", 2)


@pytest.mark.parametrize("kind", ["whiskers", "measurements"])
def test_a_cut_file_says_so_wherever_it_is_cut(tmp_path, kind):
    path, data = tmp_path / f"a.{kind}", whole_file(kind)
    for length in range(len(data)):
        path.write_bytes(data[:length])
        if kind == "whiskers" and (length - 16) % 44 == 0 and length >= 16:
            continue  # as long as a file with fewer lines
        with pytest.raises(InputError, match=r"a\.\w+: is .*(copy it again|_convert)") as caught:
            READERS[kind](path)
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize("kind", READERS)
@given(data=st.data())
def test_damage_never_crashes_a_reader(tmp_path_factory, kind, data):
    path = tmp_path_factory.mktemp("d") / f"a.{kind}"
    content = bytearray(whole_file(kind))
    for _ in range(data.draw(st.integers(1, 3))):
        place = data.draw(st.integers(0, len(content) - 1))
        content[place] = data.draw(st.integers(0, 255))
    path.write_bytes(content)
    message = str(path)
    try:
        READERS[kind](path)
    except InputError as error:
        message = str(error)
    assert str(path) in message
    assert "\n" not in message


@pytest.mark.parametrize("text", ["1 2", "1 2 3 4", "a 2 3", "1.5 2 3", "-1 2 3", "inf 2 3"])
def test_a_wrong_line_of_a_bar_file_is_named(tmp_path, text):
    path = tmp_path / "a.bar"
    path.write_text(f"0 1 2\n{text}\n")
    with pytest.raises(InputError, match=r"a\.bar: line 2 is .*expected"):
        janelia.read_bar(path)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(InputError, match=r"a\.whiskers: cannot be read"):
        janelia.read_whiskers(tmp_path / "a.whiskers")


def test_measurements_in_place_of_lines_are_not_to_be_converted(tmp_path):
    path = tmp_path / "a.measurements"
    path.write_bytes(b"measv3\0\0" + bytes(80))
    with pytest.raises(InputError, match=r"not the lines; name the \.whiskers file"):
        janelia.read_whiskers(path)
