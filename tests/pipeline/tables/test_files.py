"""Tables on disk: columns as promised, the same when read back."""

from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.detection.static_scene import PoleTrack
from pipeline.scene import pole_runs
from pipeline.tables import centrelines, dictionary, files
from pipeline.tables.centrelines import Centrelines
from pipeline.tables.columns import CONTACT_COLUMNS, CORRECTION_COLUMNS, FRAME_COLUMNS, as_table

CONTACT_NAMES = (
    "video,whisker,contact,onset_frame,offset_frame,onset_s,duration_ms,peak_force_uN,"
    "mean_force_uN,impulse_uN_ms,peak_base_moment_nN_m,peak_axial_force_uN,"
    "contact_arc_length_mm,pulse_peak_uN,pulse_duration_ms,pulse_centre_s,pulse_r2,"
    "steady_peak_nN_m,vibration_max_nN_m,vibration_min_nN_m,vibration_ratio,slip,curated,flags,"
    # the error budget, behind what the contract promises
    "peak_force_se_uN,tracking_se_uN,hidden_length_se_uN,"
    "radius_uN_per_percent,modulus_uN_per_percent,scale_uN_per_percent"
)
FRAME_NAMES = (
    "frame,time_s,whisker,tracked,follicle_x_px,follicle_y_px,base_angle_deg,curvature_per_m,"
    "rest_curvature_per_m,curvature_change_per_m,pole_distance_mm,in_contact,"
    "contact_arc_length_mm,contact_force_uN,axial_force_uN,lateral_force_uN,base_moment_nN_m"
)
MEASURED = (
    "curvature_per_m",
    "rest_curvature_per_m",
    "curvature_change_per_m",
    "contact_force_uN",
    "axial_force_uN",
    "lateral_force_uN",
    "base_moment_nN_m",
)


def lines(sizes, names=("C2", "D1"), rng=None):
    rng = rng or np.random.default_rng(0)
    rows, points = len(sizes), int(np.sum(sizes))
    return Centrelines(
        names=names,
        frame=np.arange(rows, dtype=np.int32) // len(names),
        whisker=np.arange(rows, dtype=np.int32) % len(names),
        offsets=np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64),
        x_px=rng.uniform(0, 600, points).astype(np.float32),
        y_px=rng.uniform(0, 600, points).astype(np.float32),
        se_px=np.full(points, 0.05, np.float32),
        confidence=np.ones(rows, np.float32),
    )


def test_contacts_csv_has_the_promised_columns_and_spelling(tmp_path):
    row = {"video": "a", "whisker": "C2", "contact": 1, "onset_s": 12.0004, "slip": True}
    row |= {"peak_force_uN": 12.3456789, "flags": "one;two, three"}
    files.write_csv(tmp_path / "contacts.csv", pd.DataFrame([row]), CONTACT_COLUMNS)
    header, values, *rest = (tmp_path / "contacts.csv").read_text().split("\n")
    assert header == CONTACT_NAMES
    assert rest == [""]
    assert '"one;two, three"' in values
    assert ",12.000400," in values
    assert ",12.3457," in values
    assert ",true,false," in values
    assert "nan" not in values.lower()


def test_contacts_read_back_as_written(tmp_path):
    row = {"video": "007", "whisker": "NA", "contact": 3, "peak_force_uN": 1.5, "slip": True}
    table = as_table(pd.DataFrame([row, {**row, "contact": 4, "slip": False}]), CONTACT_COLUMNS)
    files.write_csv(tmp_path / "c.csv", table, CONTACT_COLUMNS)
    pd.testing.assert_frame_equal(files.read_csv(tmp_path / "c.csv", CONTACT_COLUMNS), table)


def test_empty_contacts_still_have_a_header(tmp_path):
    files.write_csv(tmp_path / "c.csv", pd.DataFrame(), CONTACT_COLUMNS)
    assert (tmp_path / "c.csv").read_text() == CONTACT_NAMES + "\n"
    assert len(files.read_csv(tmp_path / "c.csv", CONTACT_COLUMNS)) == 0


@given(st.floats(allow_nan=False, allow_infinity=False, min_value=-1e9, max_value=1e9))
def test_csv_numbers_keep_six_digits(value):
    (text,) = files.csv_text(pd.Series([value]))
    assert float(text) == pytest.approx(value, rel=1e-5)


def test_a_foreign_csv_is_refused_by_name(tmp_path):
    (tmp_path / "c.csv").write_text("video,whisker\na,b\n")
    with pytest.raises(ValueError, match=r"column contact, found video, whisker; .* run` writes"):
        files.read_csv(tmp_path / "c.csv", CONTACT_COLUMNS)
    text = CONTACT_NAMES + "\n" + "x," * CONTACT_NAMES.count(",") + "\n"
    (tmp_path / "c.csv").write_text(text)
    with pytest.raises(ValueError, match=r"c\.csv: line 2: contact is 'x', expected a whole"):
        files.read_csv(tmp_path / "c.csv", CONTACT_COLUMNS)
    (tmp_path / "c.csv").write_text(text.replace("x,", "x,y,"))
    with pytest.raises(ValueError, match=r"c\.csv: .*line 2"):
        files.read_csv(tmp_path / "c.csv", CONTACT_COLUMNS)


def test_frames_parquet_has_the_promised_columns(tmp_path):
    frames = pd.DataFrame({"frame": range(3), "whisker": "C2", "tracked": True})
    files.write_frames(tmp_path / "frames.parquet", frames)
    schema = pq.read_schema(tmp_path / "frames.parquet")
    assert ",".join(n for n in schema.names if n in FRAME_NAMES.split(",")) == FRAME_NAMES
    assert all(f"{name}_se" in schema.names for name in MEASURED)
    assert schema.field("frame").type == pa.int32()
    assert schema.field("tracked").type == pa.bool_()
    assert schema.field("time_s").type == pa.float64()
    assert schema.field("contact_force_uN").metadata[b"unit"].decode() == "µN"
    back = files.read_frames(tmp_path / "frames.parquet")
    assert list(back["frame"]) == [0, 1, 2]
    assert back["contact_force_uN"].isna().all()


def test_frames_can_be_read_in_part(tmp_path, monkeypatch):
    monkeypatch.setattr(files, "ROWS_PER_GROUP", 7)
    frames = pd.DataFrame({"frame": np.repeat(range(20), 2), "whisker": ["C2", "D1"] * 20})
    files.write_frames(tmp_path / "f.parquet", frames)
    assert pq.ParquetFile(tmp_path / "f.parquet").num_row_groups == 6
    inside = [("frame", ">=", 5), ("frame", "<", 8), ("whisker", "==", "D1")]
    part = files.read_frames(tmp_path / "f.parquet", ["frame"], inside)
    assert list(part["frame"]) == [5, 6, 7]


def test_centrelines_read_back_as_written(tmp_path):
    first, second = lines([5, 0, 3, 1]), lines([2, 4])
    second.frame[:] += 2
    with centrelines.centreline_file(tmp_path / "c.parquet") as keep:
        keep(first)
        keep(second)
    schema = pq.read_schema(tmp_path / "c.parquet")
    assert schema.names == ["frame", "whisker", "x_px", "y_px"]
    assert schema.field("x_px").type == pa.list_(pa.float32())
    assert schema.field("frame").type == pa.int32()
    back = centrelines.read_centrelines(tmp_path / "c.parquet")
    assert back.names == ("C2", "D1")
    assert list(back.frame) == [0, 0, 1, 1, 2, 2]
    rows = [first.row(i) for i in range(4)] + [second.row(i) for i in range(2)]
    for i, row in enumerate(rows):
        np.testing.assert_array_equal(back.row(i), row)


def test_centrelines_come_in_chunks_and_by_frame(tmp_path):
    written = lines(np.full(5000, 3))
    centrelines.write_centrelines(tmp_path / "c.parquet", written)
    chunks = list(centrelines.centreline_chunks(tmp_path / "c.parquet"))
    assert len(chunks) > 1
    assert sum(len(chunk) for chunk in chunks) == 5000
    np.testing.assert_array_equal(np.concatenate([c.x_px for c in chunks]), written.x_px)
    inside = [("frame", "==", 1700), ("whisker", "==", "D1")]
    (part,) = centrelines.centreline_chunks(tmp_path / "c.parquet", inside)
    np.testing.assert_array_equal(part.row(0), written.row(3401))


def test_no_centrelines_is_a_table_too(tmp_path):
    with centrelines.centreline_file(tmp_path / "c.parquet"):
        pass
    assert len(centrelines.read_centrelines(tmp_path / "c.parquet")) == 0


def test_interrupted_centrelines_leave_nothing(tmp_path):
    def write_half():
        with centrelines.centreline_file(tmp_path / "c.parquet") as keep:
            keep(lines([3, 3]))
            raise KeyError

    with pytest.raises(KeyError):
        write_half()
    assert list(tmp_path.iterdir()) == []


def test_pole_track_as_runs():
    x = np.array([np.nan, np.nan, 5.0, 5.0, 7.0, np.nan])
    state = {"pole": pole_runs.pole_runs(PoleTrack(x, x + 1, 6.25))}
    assert state["pole"]["runs"] == [[0, None, None], [2, 5, 6], [4, 7, 8], [5, None, None]]
    at = [pole_runs.pole_at(state, frame) for frame in range(8)]
    assert at[:3] == [None, None, (5, 6, 6.25)]
    assert at[4] == (7, 8, 6.25)
    assert at[5:] == [None] * 3
    assert pole_runs.pole_runs(None) is None
    assert pole_runs.pole_at({}, 3) is None


def test_dictionary_of_columns_is_up_to_date():
    docs = Path(dictionary.__file__).parents[2] / "docs" / "tables.md"
    assert docs.read_text("utf-8") == dictionary.data_dictionary(), (
        "run `python -m pipeline.tables.dictionary > docs/tables.md`"
    )


def test_every_column_has_a_meaning():
    units = ("mm", "uN", "ms", "px", "deg", "m", "rad", "N")
    for _, columns in dictionary.FILES.values():
        for column in columns:
            assert column.meaning
            assert column.unit or column.name.split("_")[-1] not in units


@pytest.mark.parametrize("where", [0.1, 0.3, 0.5, 0.7])
def test_a_changed_byte_of_the_values_in_a_parquet_is_found(tmp_path, where):
    path = tmp_path / "frames.parquet"
    rng = np.random.default_rng(0)
    frames = pd.DataFrame({"frame": range(3000), "whisker": "C2", "time_s": rng.random(3000)})
    files.write_frames(path, frames)
    assert files.check_parquet(path, FRAME_COLUMNS, thorough=True) == 3000
    content = bytearray(path.read_bytes())
    footer = len(content) - 8 - int.from_bytes(content[-8:-4], "little")
    content[int(where * footer)] ^= 4
    path.write_bytes(content)
    with pytest.raises(ValueError, match=r"frames\.parquet"):
        files.check_parquet(path, FRAME_COLUMNS, thorough=True)
    with pytest.raises(ValueError, match=r"frames.parquet: damaged"):
        files.read_frames(path)


def test_whole_numbers_beyond_their_column_are_named(tmp_path):
    path = tmp_path / "corrections.csv"
    path.write_text(
        "whisker,verdict,onset_frame,offset_frame,covers_from,covers_to,saved_at\n"
        "C2,free,2,99999999999999999999,1,5,\n"
    )
    with pytest.raises(ValueError, match="line 2: offset_frame is '99999999999999999999'"):
        files.read_csv(path, CORRECTION_COLUMNS)


def test_pandas_reads_centrelines_as_an_array_per_row(tmp_path):
    written = lines([3, 5, 2, 4])
    centrelines.write_centrelines(tmp_path / "c.parquet", written)
    table = pd.read_parquet(tmp_path / "c.parquet")
    assert list(table["whisker"]) == ["C2", "D1", "C2", "D1"]
    for row in range(4):
        points = np.column_stack([table["x_px"][row], table["y_px"][row]])
        assert points.dtype == np.float32
        np.testing.assert_array_equal(points, written.row(row))


def test_a_column_of_another_type_is_not_what_was_written(tmp_path):
    path = tmp_path / "frames.parquet"
    table = pd.DataFrame({"frame": [0, 1], "whisker": "C2", "tracked": True})
    files.write_frames(path, as_table(table, FRAME_COLUMNS))
    assert files.check_parquet(path, FRAME_COLUMNS) == 2
    files.read_frames(path).astype({"frame": float}).to_parquet(path)
    with pytest.raises(ValueError, match="expected column frame of type int"):
        files.check_parquet(path, FRAME_COLUMNS)
