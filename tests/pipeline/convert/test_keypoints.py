"""Key points of DeepLabCut and SLEAP become lines that are worth what the points are."""

import contextlib
import itertools
import os
import pickle
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import pytest
import traced_motion
from hypothesis import given
from hypothesis import strategies as st
from tracked_files import settings_of

from pipeline.convert import keypoints, pandas_hdf5
from pipeline.convert.deeplabcut import read_deeplabcut
from pipeline.convert.keypoints import KeyPoints, lines_of, points_along
from pipeline.convert.sleap import read_sleap
from pipeline.errors import InputError
from pipeline.run import analyse_lines
from synthetic.presets import make_trial
from synthetic.truth import contact_table

DATA = Path(__file__).parents[2] / "data"
NOISE_PX, POINTS = 0.4, 10
noise_tolerance = 0.2  # relative
line_tolerance = 0.6  # px, root mean square
edge_tolerance = 2  # frames
peak_force_tolerance = 0.15  # relative, of strong touches
STRONG_UN = 3.0


@pytest.fixture(scope="module")
def motion():
    return make_trial("noisy", 0, 0, 400).motion


@pytest.fixture(scope="module")
def true_lines(motion):
    return traced_motion.trace_lines(motion, np.random.default_rng(0), 0.001)


@pytest.fixture(scope="module")
def points(true_lines):
    """Noisy points at even distances along every line, (frames, 1, parts, 2)."""
    rng = np.random.default_rng(1)
    xy = np.stack([points_along(true_lines.row(i), POINTS) for i in range(len(true_lines))])
    xy = (xy + rng.normal(0, NOISE_PX, xy.shape))[:, None]
    parts = tuple(f"C2_{i}" for i in range(POINTS))
    return KeyPoints(("",), parts, xy, np.ones(xy.shape[:3]))


def deeplabcut_table(points):
    """The table that DeepLabCut writes."""
    levels = ["scorer", "individuals", "bodyparts", "coords"]
    one = len(points.individuals) == 1
    columns = {}
    for i, individual in enumerate(points.individuals):
        for p, part in enumerate(points.parts):
            for c, values in enumerate([*points.xy[:, i, p].T, points.score[:, i, p]]):
                name = ("DLC", individual, part, ("x", "y", "likelihood")[c])
                columns[name] = values
    table = pd.DataFrame(columns)
    table.columns = table.columns.set_names(levels)
    return table.droplevel("individuals", axis=1) if one else table


def sleap_file(path, points):
    """The analysis file that SLEAP writes."""
    with h5py.File(path, "w") as file:
        file["tracks"] = points.xy.transpose(1, 3, 2, 0)
        file["point_scores"] = points.score.transpose(1, 2, 0)
        file["node_names"] = np.array(points.parts, "S")
        file["track_names"] = np.array(points.individuals, "S")


def sleap_table(points):
    """The CSV that SLEAP writes."""
    rows = []
    for f, i in np.ndindex(points.xy.shape[:2]):
        row = {"track": points.individuals[i], "frame_idx": f, "instance.score": 0.9}
        for p, part in enumerate(points.parts):
            row[f"{part}.x"], row[f"{part}.y"] = points.xy[f, i, p]
            row[f"{part}.score"] = points.score[f, i, p]
        rows.append(row)
    return pd.DataFrame(rows)


def several(individuals=("a", "b"), frames=3):
    rng = np.random.default_rng(0)
    xy = rng.uniform(0, 99, (frames, len(individuals), 5, 2)).round(3)
    parts = tuple(f"p{i}" for i in range(5))
    return KeyPoints(individuals, parts, xy, rng.uniform(0, 1, xy.shape[:3]).round(3))


def check(found, expected):
    assert found.parts == expected.parts
    if len(expected.individuals) > 1:
        assert found.individuals == expected.individuals
    np.testing.assert_allclose(found.xy, expected.xy)
    np.testing.assert_allclose(found.score, expected.score)


@pytest.mark.parametrize("individuals", [("a",), ("a", "b")])
def test_deeplabcut_files(tmp_path, individuals):
    expected = several(individuals)
    table = deeplabcut_table(expected)
    table.to_csv(tmp_path / "a.csv")
    table.to_hdf(tmp_path / "a.h5", key="df_with_missing", format="table", mode="w")
    check(read_deeplabcut(tmp_path / "a.csv"), expected)
    check(read_deeplabcut(tmp_path / "a.h5"), expected)


@pytest.mark.parametrize("layout", ["table", "fixed"])
@pytest.mark.parametrize("kinds", [(float, float), (float, np.float32)])
def test_tables_of_pandas_are_read_as_pandas_reads_them(tmp_path, layout, kinds):
    table = deeplabcut_table(several()).set_index(pd.Index([0, 2, 5]))
    table = table.astype(dict(zip(table.columns[::2], itertools.cycle(kinds), strict=False)))
    table.to_hdf(tmp_path / "a.h5", key="df_with_missing", format=layout, mode="w")
    pd.testing.assert_frame_equal(
        pandas_hdf5.read_table(tmp_path / "a.h5"), table, check_index_type=False,
        check_column_type=False,
    )  # fmt: skip


class Runs:
    """Makes a folder as it is unpickled."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return os.mkdir, (str(self.path),)


@pytest.mark.parametrize("attribute", ["info", "non_index_axes", "values_cols", "levels"])
@pytest.mark.parametrize("protocol", [0, 2, 4])
def test_nothing_in_a_deeplabcut_file_is_run(tmp_path, attribute, protocol):
    path, made = tmp_path / "a.h5", tmp_path / "made"
    deeplabcut_table(several()).to_hdf(path, key="df_with_missing", format="table", mode="w")
    with h5py.File(path, "a") as file:
        file["df_with_missing"].attrs[attribute] = np.bytes_(pickle.dumps(Runs(made), protocol))
    with contextlib.suppress(InputError):
        read_deeplabcut(path)
    assert not made.exists()


@pytest.mark.parametrize(("separator", "name"), [("\t", "tabs"), (";", "semicolons")])
def test_a_deeplabcut_table_without_commas_says_so(tmp_path, separator, name):
    deeplabcut_table(several(("a",))).to_csv(tmp_path / "a.csv", sep=separator)
    with pytest.raises(InputError, match=f"a.csv: .* separated by {name}.*save it so"):
        read_deeplabcut(tmp_path / "a.csv")


@pytest.mark.parametrize(("separator", "name"), [("\t", "tabs"), (";", "semicolons")])
def test_a_sleap_table_without_commas_says_so(tmp_path, separator, name):
    sleap_table(several(("a",))).to_csv(tmp_path / "a.csv", index=False, sep=separator)
    with pytest.raises(InputError, match=f"a.csv: .* separated by {name}.*expected commas"):
        read_sleap(tmp_path / "a.csv")


@pytest.mark.parametrize("lines", [slice(1, None), slice(1, 2)])
def test_a_sleap_table_with_decimal_commas_says_so(tmp_path, lines):
    table = sleap_table(several(("a",))).to_csv(index=False).splitlines()
    table[lines] = [line.replace(".", ",") for line in table[lines]]
    (tmp_path / "a.csv").write_text("\n".join(table))
    with pytest.raises(InputError, match=r"a.csv: .* more values than names on top: decimal comm"):
        read_sleap(tmp_path / "a.csv")


@pytest.mark.parametrize("individuals", [("a",), ("a", "b")])
def test_sleap_files(tmp_path, individuals):
    expected = several(individuals)
    sleap_file(tmp_path / "a.h5", expected)
    sleap_table(expected).to_csv(tmp_path / "a.csv", index=False)
    check(read_sleap(tmp_path / "a.h5"), expected)
    check(read_sleap(tmp_path / "a.csv"), expected)


@pytest.mark.parametrize(
    ("read", "file"), [(read_sleap, "sleap_io.csv"), (read_deeplabcut, "deeplabcut.csv")]
)
def test_files_that_the_programs_wrote(motion, read, file):
    found = read(DATA / file)
    frame, i = np.arange(4)[:, None], np.arange(12)
    expected = np.stack([100 + 30 * i + frame, 200 - 10 * i + frame / 2], axis=-1)
    expected[2, 5] = np.nan
    order = [found.parts.index(f"point_{part}") for part in i]
    np.testing.assert_array_equal(found.xy[:, 0, order], expected)
    lines = lines_of(found, settings_of(motion), file, ["C2"])
    ends = np.stack([lines.offsets[:-1], lines.offsets[1:] - 1])
    np.testing.assert_allclose(lines.x_px[ends].T, expected[:, [0, -1], 0], atol=1)  # px


def test_lines_pass_where_the_whisker_was(motion, points, true_lines):
    lines = lines_of(points, settings_of(motion), "a.csv")
    assert lines.names == ("C2",)
    np.testing.assert_array_equal(lines.frame, np.arange(400))
    noise = np.sqrt(POINTS / np.diff(lines.offsets) / lines.information[lines.offsets[:-1]])
    np.testing.assert_allclose(noise, NOISE_PX, rtol=noise_tolerance)
    off = []
    for i in range(0, 400, 20):
        line, true = lines.row(i), true_lines.row(i)
        off += [np.hypot(*(true - point).T).min() for point in line[5:-5:10]]
    assert np.sqrt(np.mean(np.square(off))) < line_tolerance


@pytest.mark.slow
def test_contacts_and_forces_from_key_points(motion, points):
    without_pole = settings = settings_of(motion)
    x, y = motion.scene.to_pixels(motion.pole_x[:1], motion.pole_y[:1])
    pole = settings.pole.model_copy(update={"x_px": float(x[0]), "y_px": float(y[0])})
    settings = settings.model_copy(update={"pole": pole})
    lines = lines_of(points, settings, "a.csv")
    found = analyse_lines(lines, settings).contacts
    truth = contact_table(motion, "trial")
    truth = truth[truth["peak_force_uN"] > STRONG_UN]
    assert len(truth) > 1
    assert (
        "traced lines do not show where the pole is"
        in analyse_lines(lines, without_pole).messages[0]
    )
    for _, one in truth.iterrows():
        near = found.iloc[(found["onset_frame"] - one["onset_frame"]).abs().argmin()]
        assert abs(near["onset_frame"] - one["onset_frame"]) <= edge_tolerance
        assert near["peak_force_uN"] == pytest.approx(
            one["peak_force_uN"], rel=peak_force_tolerance
        )


def test_points_run_from_the_face_and_doubtful_ones_are_left_out(motion, points):
    turned = KeyPoints(("",), points.parts, points.xy[:, :, ::-1], points.score.copy())
    turned.score[3, 0, 1] = 0.2
    turned.score[4, 0, 2:] = 0.2
    lines = lines_of(turned, settings_of(motion), "a.csv")
    first = lines.offsets[:-1]
    assert (lines.x_px[first] < lines.x_px[lines.offsets[1:] - 1]).all()
    assert 3 in lines.frame
    assert 4 not in lines.frame


@pytest.mark.parametrize(
    "shuffled", [[0, 9, 1, 2, 3, 4, 5, 6, 7, 8], [4, 2, 9, 0, 7, 1, 8, 5, 3, 6]]
)
def test_points_that_a_program_has_sorted_by_name_follow_each_other_again(
    motion, points, shuffled
):
    settings = settings_of(motion)
    first = KeyPoints(("",), points.parts, points.xy[:50], points.score[:50].copy())
    first.score[7, 0, 4] = 0.1  # belongs to its point
    parts = tuple(points.parts[i] for i in shuffled)
    mixed = KeyPoints(("",), parts, first.xy[:, :, shuffled], first.score[:, :, shuffled])
    expected, found = (lines_of(each, settings, "a.csv") for each in (first, mixed))
    np.testing.assert_allclose(found.x_px, expected.x_px, atol=1e-3)
    np.testing.assert_allclose(found.y_px, expected.y_px, atol=1e-3)


def test_a_whisker_that_curls_keeps_the_order_of_the_file():
    turn = np.linspace(0, 1.5 * np.pi, POINTS)
    circle = 50 * np.column_stack([np.sin(turn), 1 - np.cos(turn)])
    xy = np.random.default_rng(0).normal(circle, NOISE_PX, (30, POINTS, 2))
    order = keypoints._order_along(xy, np.ones((30, POINTS)))
    np.testing.assert_array_equal(order, np.arange(POINTS))


@pytest.mark.parametrize(
    ("part", "whisker"),
    [("C2_0", "C2"), ("C2-11", "C2"), ("w 1", "w"), ("D1_base", "D1"), ("D1_tip", "D1")],
)
def test_whiskers_are_found_by_the_names_of_their_parts(part, whisker):
    assert keypoints.LAST_PART.sub("", part) == whisker


def test_another_number_of_whiskers_is_reported(motion, points):
    with pytest.raises(
        InputError, match=r"a\.csv: holds 1 whisker \(C2\).* 2 names given \(D1, D2\)"
    ):
        lines_of(points, settings_of(motion), "a.csv", ["D1", "D2"])
    few = KeyPoints(("",), points.parts[:3], points.xy[:, :, :3], points.score[..., :3])
    with pytest.raises(InputError, match="C2 has 3 key points, expected at least 4"):
        lines_of(few, settings_of(motion), "a.csv")


def test_no_score_is_above_one(tmp_path):
    """SLEAP's are heights of a peak that the network has learnt to be 1."""
    marked = several(("a",))
    marked.score[2] = 1.04
    sleap_table(marked).to_csv(tmp_path / "sleap.csv", index=False)
    assert read_sleap(tmp_path / "sleap.csv").score.max() == 1


def test_points_that_a_person_has_placed_have_no_score_and_are_certain(tmp_path):
    """SLEAP scores its own points only; a score that is not a number stands for none."""
    marked = several()
    marked.score[1, 0] = np.nan
    marked.xy[2, 1, 3] = np.nan
    deeplabcut_table(marked).to_csv(tmp_path / "dlc.csv")
    sleap_file(tmp_path / "sleap.h5", marked)
    sleap_table(marked).to_csv(tmp_path / "sleap.csv", index=False)
    for name, read in [("dlc.csv", read_deeplabcut), ("sleap.h5", read_sleap),
                       ("sleap.csv", read_sleap)]:  # fmt: skip
        score = read(tmp_path / name).score
        assert (score[1, 0] == 1).all()
        assert score[2, 1, 3] == 0
        np.testing.assert_allclose(score[0], marked.score[0])


def test_a_deeplabcut_table_without_likelihoods_is_read(tmp_path):
    table = deeplabcut_table(several())
    table.drop(columns="likelihood", level="coords").to_csv(tmp_path / "a.csv")
    assert (read_deeplabcut(tmp_path / "a.csv").score == 1).all()


@pytest.mark.parametrize("number", [0.5, -1, 1e8])
def test_frame_numbers_of_no_video_are_named(tmp_path, number):
    table = deeplabcut_table(several())
    table.set_axis([0, number, 2]).to_csv(tmp_path / "dlc.csv")
    sleap_table(several(("a",))).assign(frame_idx=[0, number, 2]).to_csv(tmp_path / "sleap.csv")
    for read, name in ((read_deeplabcut, "dlc"), (read_sleap, "sleap")):
        with pytest.raises(InputError, match=rf"{name}\.csv: .*no whole number from 0 to"):
            read(tmp_path / f"{name}.csv")


def test_two_instances_of_one_track_are_refused(tmp_path):
    table = sleap_table(several())
    table["track"] = np.nan
    table.to_csv(tmp_path / "a.csv", index=False)
    with pytest.raises(InputError, match="frame 0 has two instances of track_0: track them"):
        read_sleap(tmp_path / "a.csv")


def test_an_end_that_is_never_certain_does_not_turn_the_whisker(motion, points):
    """DeepLabCut places such a point anywhere; SLEAP leaves it out."""
    xy, score = points.xy.copy(), points.score.copy()
    score[:, :, 0] = 0.1
    for place, step in itertools.product((600.0, np.nan), (1, -1)):
        xy[:, :, 0] = place
        given = KeyPoints(("",), points.parts, xy[:, :, ::step], score[:, :, ::step])
        lines = lines_of(given, settings_of(motion), "a.csv")
        assert len(lines) == len(xy)
        assert (lines.x_px[lines.offsets[:-1]] < lines.x_px[lines.offsets[1:] - 1]).all()


@pytest.mark.parametrize("read", [read_deeplabcut, read_sleap])
@pytest.mark.parametrize("suffix", ["csv", "h5"])
@given(content=st.binary(max_size=60))
def test_other_files_are_named_in_one_line(tmp_path_factory, read, suffix, content):
    path = tmp_path_factory.mktemp("k") / f"a.{suffix}"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"cannot be read as") as caught:
        read(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def of_two_levels(table):
    return table.droplevel(0, axis=1)


def of_other_names(table):
    return table.set_axis(table.columns.set_names(["a", "b", "coords"]), axis=1)


def of_one_column(table):
    return table.iloc[:, :0]


@pytest.mark.parametrize(
    ("suffix", "change"), [("h5", of_two_levels), ("h5", of_other_names), ("csv", of_one_column)]
)
def test_other_tables_than_deeplabcuts_are_named(tmp_path, suffix, change):
    path, table = tmp_path / f"a.{suffix}", change(deeplabcut_table(several(("a",))))
    table.to_csv(path) if suffix == "csv" else table.to_hdf(path, key="df_with_missing")
    with pytest.raises(InputError, match=r"a\.\w+: cannot be read as key points of DeepLabCut"):
        read_deeplabcut(path)


@pytest.mark.parametrize("program", ["dlc", "sleap"])
def test_a_place_that_is_no_number_is_named(tmp_path, program):
    path, table = (
        tmp_path / "a.csv",
        (deeplabcut_table if program == "dlc" else sleap_table)(several()),
    )
    table.to_csv(path)
    text = path.read_text().splitlines()
    cells = text[-1].split(",")
    path.write_text("\n".join([*text[:-1], ",".join([*cells[:-1], "abc"])]))
    with pytest.raises(InputError, match=r"a\.csv: .*\(\S.* is 'abc' in row \d+ of its points\)"):
        (read_deeplabcut if program == "dlc" else read_sleap)(path)


def far(points):
    return replace(points, xy=1e9 * points.xy)


def doubtful(points):
    return replace(points, score=0.1 * points.score)


def not_there(points):
    return replace(points, xy=np.nan * points.xy)


def of_no_frame(points):
    return replace(points, xy=points.xy[:0], score=points.score[:0])


def of_nobody(points):
    return KeyPoints((), points.parts, points.xy[:, :0], points.score[:, :0])


@pytest.mark.parametrize("change", [far, doubtful, not_there, of_no_frame, of_nobody])
def test_points_through_which_no_line_leads_are_named(motion, points, change):
    with pytest.raises(InputError, match="in no frame has a whisker 4 key points with x, y"):
        lines_of(change(points), settings_of(motion), "a.csv")


@pytest.mark.parametrize("suffix", ["csv", "h5"])
@pytest.mark.parametrize("program", ["dlc", "sleap"])
def test_a_cut_file_is_named(tmp_path, program, suffix):
    path, expected = tmp_path / f"a.{suffix}", several()
    if program == "sleap":
        sleap_file(path, expected) if suffix == "h5" else sleap_table(expected).to_csv(path)
    elif suffix == "h5":
        deeplabcut_table(expected).to_hdf(path, key="df_with_missing", format="table", mode="w")
    else:
        deeplabcut_table(expected).to_csv(path)
    path.write_bytes(path.read_bytes()[: 40 if suffix == "csv" else path.stat().st_size // 2])
    with pytest.raises(InputError, match=r"a\.\w+: cannot be read as"):
        (read_sleap if program == "sleap" else read_deeplabcut)(path)
