"""Two views put together: from points, from straight lines, and from rendered motion's truth."""

import shutil
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from pipeline.app import calibrate_views, cli
from pipeline.calibrate import views as views_module
from pipeline.calibrate.lines_3d import path_row, space_line, unroll
from pipeline.calibrate.two_views import ViewsError, fit_views, read_points
from pipeline.calibrate.views import _lag
from pipeline.convert.results import lines_of_rows
from pipeline.session.session_file import settings_from, write_session
from pipeline.tables import centrelines, files, whole_files
from pipeline.tables.calibration_columns import (
    CALIBRATED_VIEW_COLUMNS,
    POINT_COLUMNS,
    VIEW_CONTACT_COLUMNS,
    VIEW_FRAME_COLUMNS,
)
from pipeline.tables.columns import CONTACT_COLUMNS, FRAME_COLUMNS, VIDEO_COLUMNS, as_table
from pipeline.tables.run_record import STATE_FILE
from synthetic.staging import Setting
from synthetic.two_view_session import matched_points, true_rows
from synthetic.two_views import whisker_in_space

FIRST, SECOND = 25.0, 22.0  # px/mm
AXIS, ROLL = np.deg2rad(20.0), np.deg2rad(-2.0)
CLICK_PX = 0.3


def seen(x, y, z):
    """Points in space [mm] in both pictures [px], (n, 4)."""
    along = x * np.cos(AXIS) + y * np.sin(AXIS)
    right = along * np.cos(ROLL) - z * np.sin(ROLL)
    up = along * np.sin(ROLL) + z * np.cos(ROLL)
    return np.column_stack([FIRST * x, -FIRST * y, 30 + SECOND * right, 150 - SECOND * up])


def points(rng, n=12, height=4.0, click=CLICK_PX):
    x, y, z = (rng.uniform(*side, n) for side in ((4, 20), (-12, -2), (-height, height)))
    return seen(x, y, z) + rng.normal(scale=click, size=(n, 4))


def test_views_are_put_together_with_errors_that_hold():
    off = []
    for seed in range(60):
        found = fit_views(points(np.random.default_rng(seed)), FIRST)
        turned = np.arctan2(found.second_shared[1], found.second_shared[0]) - ROLL
        off.append([(found.second_scale - SECOND) / found.second_se, turned / found.angle_se])
    assert found.second_scale == pytest.approx(SECOND, rel=0.01)
    covered = np.mean(np.abs(off) < 1.96, axis=0)
    assert (covered > 0.85).all()


def test_a_mirrored_second_view_is_seen_from_the_points():
    given = points(np.random.default_rng(1), click=0.0)
    given[:, 2] = 640 - given[:, 2]
    found = fit_views(given, FIRST)
    along, height = found.in_second(given[:, 2:])
    np.testing.assert_allclose(along, found.along_first(given[:, :2]), atol=1e-9)
    true = fit_views(points(np.random.default_rng(1), click=0.0), FIRST)
    other = points(np.random.default_rng(1), click=0.0)
    np.testing.assert_allclose(np.ptp(height), np.ptp(true.in_second(other[:, 2:])[1]), rtol=1e-9)


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        (np.zeros((30, 3)), r"expected finite numbers \(n, 4\), got the shape \(30, 3\)"),
        (np.full((30, 4), np.nan), "matched points: expected finite numbers"),
        (points(np.random.default_rng(0), n=5), "5 matched points; expected at least 6"),
        (points(np.random.default_rng(0), height=0.0), "lie in a plane"),
        (np.random.default_rng(0).uniform(0, 600, (12, 4)), "do not match: .* px apart"),
    ],
)
def test_points_that_are_no_good_are_refused(given, expected):
    with pytest.raises(ViewsError, match=expected):
        fit_views(given, FIRST)


@pytest.fixture(scope="module")
def views():
    return fit_views(points(np.random.default_rng(3), click=0.0), FIRST)


def straight(elevation, azimuth=0.2, n=300, droop=0.0):
    """Both pictures' lines of a whisker of 16 mm, from 1.4 mm beyond its follicle on."""
    s = np.linspace(1.4, 16.0, n)
    climb = s * np.sin(elevation) + droop * s**2
    x, y = (
        2 + s * np.cos(elevation) * np.cos(azimuth),
        -8 + s * np.cos(elevation) * np.sin(azimuth),
    )
    both = seen(x, y, climb)
    return both[:, :2], both[:, 2:], seen(*np.array([[2.0], [-8.0], [0.0]]))[0, :2]


@pytest.mark.parametrize("degrees", [-14.0, 0.0, 9.0])
def test_a_straight_whisker_is_short_by_the_cosine_of_its_elevation(views, degrees):
    elevation = np.deg2rad(degrees)
    line = space_line(views, *straight(elevation))
    path = path_row(line, FIRST * 9.0 * np.cos(elevation), FIRST)
    error = 100 * (1 - np.cos(elevation))
    assert path["elevation_deg"] == pytest.approx(degrees, abs=0.01)
    assert path["true_path_mm"] == pytest.approx(9.0, abs=0.01)
    assert path["projection_error_percent"] == pytest.approx(error, abs=1e-3)
    assert path["droop_part_percent"] == pytest.approx(0, abs=1e-3)
    unrolled, pole = unroll(line, line.first[150], FIRST)
    length = np.hypot(*np.diff(unrolled, axis=0).T).sum() / FIRST
    assert length == pytest.approx(14.6, abs=0.01)
    np.testing.assert_allclose(pole, unrolled[149], atol=1e-3)


def test_droop_is_what_elevation_leaves(views):
    line = space_line(views, *straight(0.1, droop=0.01))
    path = path_row(line, FIRST * 9.0, FIRST)
    assert 0.05 < path["droop_part_percent"] < 0.2


def test_lines_that_share_too_little_are_left_out(views):
    first, second, follicle = straight(0.1)
    assert space_line(views, first[:40], second[200:], follicle) is None


@pytest.mark.parametrize("lag", [-7, 0, 3])
def test_views_out_of_step_are_noticed(lag):
    rng = np.random.default_rng(5)
    course = np.cumsum(np.convolve(rng.normal(size=300), np.ones(9) / 9, "same"))
    first, second = course[20:220], course[20 - lag : 220 - lag]
    assert _lag(first, second + rng.normal(scale=0.05, size=200)) == lag


# As a user runs it ---------------------------------------------------------------------------

NOISE_PX = 0.04
FRAMES = 70
HIDDEN_MM = 1.4
HOLDS = 3.0  # standard errors
FORCE = 0.03  # relative error of the force in the whisker's own plane


@pytest.fixture(scope="module")
def space():
    return whisker_in_space(Setting("two_views", 4, 0, np.random.default_rng(10), FRAMES))


@pytest.fixture(scope="module")
def session(space, tmp_path_factory):
    """Results of both views as `run` would write them, and the points."""
    folder = tmp_path_factory.mktemp("views")
    rng = np.random.default_rng(1)
    x, y, z = space.places
    pictures = {
        "first": space.motion.scene.to_pixels(x, y),
        "second": space.second.project(x, y, z),
    }
    for name, (px, py) in pictures.items():
        _write_results(folder / name, space, px, py, rng, name == "first")
    columns = ["first_x_px", "first_y_px", "second_x_px", "second_y_px"]
    given = pd.DataFrame(matched_points(space, rng), columns=columns)
    given.to_csv(folder / "points.csv", index=False)
    return folder


def _write_results(folder, space, x, y, rng, above):
    own = folder / "one"
    own.mkdir(parents=True)
    scale = space.motion.scene.camera.pixels_per_mm
    hidden = np.searchsorted(space.arc_length, 1e-3 * HIDDEN_MM)
    lines = [_traced(px[hidden:], py[hidden:], rng) for px, py in zip(x, y, strict=True)]
    keys = [(k, 0) for k in range(len(lines))]
    centrelines.write_centrelines(own / "centrelines.parquet", lines_of_rows(["C2"], keys, lines))
    touching = space.contact.touching
    frames = pd.DataFrame(
        {
            "frame": np.arange(len(lines)), "time_s": 1e-3 * np.arange(len(lines)),
            "whisker": "C2", "tracked": True, "follicle_x_px": x[:, 0],
            "follicle_y_px": y[:, 0], "in_contact": touching,
        }
    )  # fmt: skip
    files.write_frames(own / "frames.parquet", as_table(frames, FRAME_COLUMNS))
    edges = np.flatnonzero(np.diff(touching.astype(int), prepend=0, append=0)).reshape(-1, 2)
    contacts = [
        {"video": "one", "whisker": "C2", "contact": k, "onset_frame": a, "offset_frame": b}
        for k, (a, b) in enumerate(edges, 1)
    ]
    table = as_table(pd.DataFrame(contacts), CONTACT_COLUMNS)
    for place in (own, folder):
        files.write_csv(place / "contacts.csv", table, CONTACT_COLUMNS)
    pole = space.motion.scene.pole
    px, py = space.motion.scene.to_pixels(pole.x, pole.y)
    runs = [[0, float(px), float(py)]]
    state = {"pole": {"radius_px": 1e3 * pole.radius * scale, "runs": runs}}
    whole_files.write_json(own / STATE_FILE, state if above else {})
    whisker = {
        "name": "C2", "length_mm": 18.0, "cone_length_mm": 18 / 0.95, "base_radius_um": 37.0,
        "hidden_length_mm": HIDDEN_MM,
    }  # fmt: skip
    recording = {"frames_per_second": 1e3, "pixels_per_mm": scale, "face": "left"}
    write_session(
        own / "session.toml", settings_from({"recording": recording, "whisker": [whisker]})
    )
    video = {"video": "one", "path": "one.avi", "status": "done", "frames": len(lines)}
    files.write_csv(
        folder / "videos.csv", as_table(pd.DataFrame([video]), VIDEO_COLUMNS), VIDEO_COLUMNS
    )


def _traced(x, y, rng):
    """A line as it is traced: 1 px apart, with errors that run along it."""
    arc = np.concatenate([[0], np.cumsum(np.hypot(np.diff(x), np.diff(y)))])
    at = np.arange(0, arc[-1], 1.0)
    knots = np.arange(0, at[-1] + 8, 8)
    off = np.interp(at, knots, rng.normal(scale=NOISE_PX, size=len(knots)))
    return np.column_stack([np.interp(at, arc, x), np.interp(at, arc, y) + off])


def run(*arguments) -> int:
    with pytest.raises(SystemExit) as caught:
        cli.main(["calibrate", "views", *(str(a) for a in arguments)])
    return caught.value.code or 0


@pytest.mark.slow
def test_elevation_paths_and_force_are_found(space, session, tmp_path, capsys):
    out, given = tmp_path / "out", session / "points.csv"
    first = shutil.copytree(session / "first", tmp_path / "first")
    second = shutil.copytree(session / "second", tmp_path / "second")
    _add_video(first, "alone")
    assert run(first, second, "--points", given, "--out", out) == 1
    found = files.read_csv(out / "views.csv", VIEW_FRAME_COLUMNS).set_index("frame")
    true = true_rows(space).set_index("frame")
    found = found.loc[true.index]
    for name in ("elevation_deg", "projection_error_percent"):
        off = (found[name] - true[name]) / found[f"{name}_se"]
        assert off.abs().max() < HOLDS, name
    np.testing.assert_allclose(found["true_path_mm"], true["true_path_mm"], atol=0.06)
    strong = true["contact_force_uN"] > 0.5 * true["contact_force_uN"].max()
    force = true["contact_force_uN"][strong]
    own = (found["own_plane_force_uN"][strong] / force - 1).median()
    assert abs(own) < FORCE
    (camera,) = files.read_csv(out / "calibration.csv", CALIBRATED_VIEW_COLUMNS).itertuples()
    assert camera.second_pixels_per_mm == pytest.approx(
        space.second.camera.pixels_per_mm, abs=HOLDS * camera.second_pixels_per_mm_se
    )
    contacts = files.read_csv(out / "view_contacts.csv", VIEW_CONTACT_COLUMNS)
    assert contacts["force_effect_percent"].notna().all()
    names = {path.name for path in out.glob("[!.]*")}
    assert names == {
        "calibration.csv", "fig4.png", "lines_3d.parquet", "view_contacts.csv", "views.csv",
    }  # fmt: skip
    said = capsys.readouterr().out
    assert "contact frames, elevation" in said
    assert f"left out: alone: no video of that name in {second}" in said


def _add_video(results, name):
    shutil.copytree(results / "one", results / name)
    table = files.read_csv(results / "videos.csv", VIDEO_COLUMNS)
    both = pd.concat([table, table.assign(video=name)])
    files.write_csv(results / "videos.csv", both, VIDEO_COLUMNS)


def _shuffled(table):
    names = ["second_x_px", "second_y_px"]
    table[names] = table[names].to_numpy()[::-1]
    return table


@pytest.mark.parametrize("scales", [(25.0, 40.0), (30.0, 25.0)], ids=["above", "beside"])
def test_a_video_of_another_scale_is_not_put_together_by_these_points(scales):
    recording = {"frames_per_second": 1e3, "pixels_per_mm": 30, "face": "left"}
    settings = settings_from({"recording": recording})
    video = SimpleNamespace(name="friday", folder="results/friday", settings=settings)
    with pytest.raises(ViewsError, match="friday: has 30 pixels per mm, the first video 25"):
        calibrate_views._measured((video, video), scales, "second", SimpleNamespace(), "C2")


def test_points_saved_with_semicolons_say_so(tmp_path):
    names = [column.name for column in POINT_COLUMNS]
    table = pd.DataFrame(np.arange(24.0).reshape(6, 4) / 2, columns=names)
    table.to_csv(tmp_path / "points.csv", index=False, sep=";", decimal=",")
    with pytest.raises(ViewsError, match=r"points.csv: .*separated by semicolons"):
        read_points(tmp_path / "points.csv")


@pytest.mark.parametrize("content", [b"", b"\xff\xfe", b'a,b\n"1'], ids=["empty", "text", "quote"])
def test_points_in_a_file_of_another_kind_say_so(tmp_path, content):
    (tmp_path / "points.csv").write_bytes(content)
    with pytest.raises(ViewsError, match=r"--points .*points.csv: .*; save a table with the col"):
        read_points(tmp_path / "points.csv")


@pytest.mark.parametrize(
    ("place", "expected"),
    [
        (".", "is a directory.*; give a CSV file with the columns first_x_px, "),
        ("a.csv", "No such"),
    ],
)
def test_points_that_are_no_file_name_the_option(tmp_path, place, expected):
    with pytest.raises(ViewsError, match=f"(?i)--points .*{expected}"):
        read_points(tmp_path / place)


@pytest.mark.parametrize(
    ("cell", "expected"), [("abc", "first_x_px is 'abc', expected a number"), ("", "four numbers")]
)
def test_a_place_of_a_point_that_is_no_number_is_named_with_its_line(tmp_path, cell, expected):
    path, names = tmp_path / "points.csv", ",".join(column.name for column in POINT_COLUMNS)
    path.write_text(f"{names}\n1,2,3,4\n{cell},6,7,8\n", encoding="utf-8")
    with pytest.raises(ViewsError, match=f"points.csv: line 3: .*{expected}"):
        read_points(path)


@pytest.mark.parametrize("row", [0, 4, 11])
def test_the_point_that_does_not_match_is_named(row):
    """As where a person has lost a decimal point."""
    given = points(np.random.default_rng(2))
    given[row, 2] *= 10
    with pytest.raises(ViewsError, match=f"do not match: .*the most in row {row + 2};"):
        fit_views(given, FIRST)


@pytest.mark.parametrize(
    ("change", "options", "expected"),
    [
        (_shuffled, (), ["points.csv: the matched points do not match", "row"]),
        (
            lambda t: t.drop(columns="second_x_px"),
            (),
            ["points.csv: expected column second_x_px, found"],
        ),
        (lambda t: t.head(4), (), ["points.csv: 4 matched points"]),
        (
            lambda t: t.assign(second_x_px=t["second_x_px"] + 90),
            (),
            ["leaves the face", "do the points belong", "the view from above"],
        ),
        (lambda t: t, ("--whisker", "D1"), ["--whisker D1", "one of C2"]),
    ],
)
def test_views_that_do_not_match_leave_nothing_behind(
    session, tmp_path, capsys, change, options, expected
):
    given, out = tmp_path / "points.csv", tmp_path / "out"
    change(pd.read_csv(session / "points.csv")).to_csv(given, index=False)
    folders = session / "first", session / "second"
    assert run(*folders, "--points", given, "--out", out, *options) == 2
    said = "".join(capsys.readouterr())
    assert all(part in said for part in expected), said
    assert not out.exists()


def test_a_view_without_pole_or_without_the_other_view_says_what_to_do(monkeypatch):
    video = SimpleNamespace(
        name="one", of=lambda name: pd.DataFrame({"frame": [0]}), pole=lambda: None
    )
    monkeypatch.setattr(views_module, "_space_lines", lambda *given: {})
    with pytest.raises(ViewsError, match=r"^one: no pole .*; give \[pole\] x_px, y_px in its"):
        views_module.measure_views(video, video, None, "C2", None)
    with pytest.raises(ViewsError, match=r"^one: no video of that name in side; run it, or name"):
        calibrate_views._measured((video, None), (25, 22), "side", None, "C2")
