"""A particle followed on maps made by hand, and a rendered whisker as a user measures it."""

import shutil
import warnings
from types import SimpleNamespace

import cv2
import numpy as np
import pandas as pd
import pytest

from pipeline.app import calibrate_dust, cli
from pipeline.calibrate import thickness
from pipeline.calibrate.follicle_motion import slope_of
from pipeline.calibrate.particle import NoParticleError, follow_particle, likeliest_places
from pipeline.calibrate.thickness import ThicknessMap
from pipeline.convert.results import lines_of_rows
from pipeline.errors import VideoError
from pipeline.session.session_file import settings_from, write_session
from pipeline.tables import centrelines, files
from pipeline.tables.calibration_columns import DUST_CONTACT_COLUMNS, DUST_VIDEO_COLUMNS
from pipeline.tables.columns import CONTACT_COLUMNS, FRAME_COLUMNS, VIDEO_COLUMNS, as_table
from pipeline.tables.own_files import new_files

SCALE = 25.0  # px/mm
FRAMES, PLACES = 200, 180
NOISE = 0.15  # px of thickness
PLACE_PX = 0.1  # largest mean error of a particle's place
SE_RATIO = 0.35  # by which standard errors may be off
COURSE = 70 + 6 * np.sin(np.arange(FRAMES) / 15)  # px, of the particle


def thickness_map(course=COURSE, height=2.5, seed=0, gone_from=FRAMES, noise=NOISE):
    rng = np.random.default_rng(seed)
    at = np.arange(PLACES)
    whisker = 2.5 * (1 - at / 400)
    bump = height * np.exp(-((at - course[:, None]) ** 2) / (2 * 2.0**2))
    bump[gone_from:] = 0
    thickness = whisker + bump + rng.normal(scale=noise, size=bump.shape)
    return ThicknessMap(np.arange(FRAMES), [], np.zeros(FRAMES), thickness)


def test_a_particle_is_followed_with_errors_that_hold():
    found = follow_particle(thickness_map(), SCALE)
    error = found.place_px - COURSE
    assert found.seen.all()
    assert abs(error.mean()) < PLACE_PX
    ratio = (error - error.mean()).std() / np.median(found.se_px)
    assert ratio == pytest.approx(1, abs=SE_RATIO)


def test_of_two_particles_the_one_near_the_place_given_is_followed():
    both = thickness_map()
    other = thickness_map(COURSE + 60, height=1.5, seed=1).thickness
    both.thickness[:, 110:] = other[:, 110:]
    found = follow_particle(both, SCALE, near_mm=130 / SCALE)
    np.testing.assert_allclose(found.place_px, COURSE + 60, atol=1.0)


def test_places_that_are_never_seen_count_as_thin_without_a_warning():
    seen = thickness_map()
    seen.thickness[:, 160:] = np.nan
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = follow_particle(seen, SCALE)
    np.testing.assert_allclose(found.place_px, COURSE, atol=1.0)


@pytest.mark.parametrize(
    ("seen", "expected"),
    [
        (thickness_map(height=0.0), "no particle on it"),
        (thickness_map(height=0.02, noise=1e-4), "no particle on it: its thickest place is 0.0"),
        (thickness_map(gone_from=150), "gone from frame 150 on"),
        (
            ThicknessMap(np.arange(3), [], np.zeros(3), np.ones((3, PLACES))),
            "traced in 3 frames; expected at least 50",
        ),
    ],
)
def test_what_cannot_be_followed_is_said(seen, expected):
    with pytest.raises(NoParticleError, match=expected):
        follow_particle(seen, SCALE)


def test_no_particle_is_looked_for_in_another_video_of_that_name(tmp_path, monkeypatch):
    def is_another(folder, path):
        raise VideoError(path, "is another")

    line = np.column_stack([np.arange(9.0), np.zeros(9)])
    path = tmp_path / "a.png"
    cv2.imwrite(str(path), np.zeros((9, 9), np.uint8))
    video = SimpleNamespace(folder=tmp_path, path=path, lines_of=lambda *_, **__: {0: line})
    assert len(thickness.map_thickness(video, "C2", (-2, 0), 1.0).frame) == 1
    monkeypatch.setattr(thickness, "check_video", is_another)
    with pytest.raises(VideoError, match="is another"):
        thickness.map_thickness(video, "C2", (-2, 0), 1.0)


def test_the_likeliest_path_moves_by_small_steps():
    signal = np.zeros((5, 30))
    signal[[0, 1, 2, 3, 4], [10, 12, 28, 13, 14]] = 5.0  # the third is elsewhere
    path = likeliest_places(signal)
    assert list(path[[0, 1, 3, 4]]) == [10, 12, 13, 14]
    assert abs(np.diff(path)).max() <= 3


@pytest.mark.parametrize("slope", [0.0, -2e-3])
def test_95_percent_of_intervals_hold_the_slope(slope):
    rng = np.random.default_rng(4)
    held = []
    for _ in range(80):
        bend = rng.uniform(5, 60, 12) * rng.choice([-1, 1], 12)
        change = slope * np.abs(bend) + rng.normal(scale=0.02, size=12)
        columns = {"curvature_change_per_m": bend, "radial_change_mm": change}
        found = slope_of(pd.DataFrame(columns))
        held.append(found.low < slope < found.high)
    assert np.mean(held) > 0.88


def test_three_contacts_say_nothing_of_a_slope():
    columns = {"curvature_change_per_m": [1.0, 2, 3], "radial_change_mm": [0.1, 0.2, 0.3]}
    assert slope_of(as_table(pd.DataFrame(columns), DUST_CONTACT_COLUMNS)) is None


# As a user runs it ---------------------------------------------------------------------------

WHISKER = {"name": "C2", "hidden_length_mm": 1.0}
FOLLICLE = 10.0, 60.0  # px
ABOUT_UM = 10.0  # of the follicle's range


def radial(n):
    """The follicle's way out of the face [px]."""
    return 5 * np.sin(np.arange(n) / 12)


def write_results(folder, particle=True, n=80):
    """Results and pictures of a straight whisker that slides in and out; 1 mm lies in the fur."""
    import cv2

    pictures = folder / "one"
    (folder / "results" / "one").mkdir(parents=True)
    pictures.mkdir()
    rng = np.random.default_rng(2)
    row, column = np.mgrid[:120, :320].astype(float)
    for k, out in enumerate(radial(n)):
        turn = 0.1 * np.sin(k / 9)
        along = (column - FOLLICLE[0] - out) * np.cos(turn) + (row - FOLLICLE[1]) * np.sin(turn)
        across = (row - FOLLICLE[1]) * np.cos(turn) - (column - FOLLICLE[0] - out) * np.sin(turn)
        light = 1 - 0.6 * np.exp(-(across**2) / 2) * (along > 0)
        if particle:
            light *= 1 - 0.9 * np.exp(-((along - 110) ** 2 + across**2) / (2 * 2.5**2))
        light = 180 * light + rng.normal(scale=1.5, size=light.shape)
        cv2.imwrite(str(pictures / f"{k:03d}.png"), np.clip(light, 0, 255).astype(np.uint8))
    _write_tables(folder / "results", pictures, n)
    return folder / "results"


def _write_tables(results, pictures, n):
    turn, out = 0.1 * np.sin(np.arange(n) / 9), radial(n)
    at = np.arange(25, 290)
    lines = [
        np.column_stack([FOLLICLE[0] + o + at * np.cos(a), FOLLICLE[1] + at * np.sin(a)])
        for o, a in zip(out, turn, strict=True)
    ]
    lines = [line[line[:, 0] > FOLLICLE[0] + 25] for line in lines]
    keys = [(k, 0) for k in range(n)]
    own = results / "one"
    centrelines.write_centrelines(own / "centrelines.parquet", lines_of_rows(["C2"], keys, lines))
    frames = pd.DataFrame(
        {
            "frame": np.arange(n), "time_s": 1e-3 * np.arange(n), "whisker": "C2",
            "tracked": True, "follicle_x_px": FOLLICLE[0], "follicle_y_px": FOLLICLE[1],
            "base_angle_deg": -np.rad2deg(turn),
            "curvature_change_per_m": 10 * np.sin(np.arange(n) / 3),
        }
    )  # fmt: skip
    files.write_frames(own / "frames.parquet", as_table(frames, FRAME_COLUMNS))
    contacts = pd.DataFrame(
        [
            {
                "video": "one",
                "whisker": "C2",
                "contact": k,
                "onset_frame": f,
                "offset_frame": f + 8,
            }
            for k, f in enumerate((5, 25, 40, 55, 65), 1)
        ]
    )
    for folder in (own, results):
        files.write_csv(
            folder / "contacts.csv", as_table(contacts, CONTACT_COLUMNS), CONTACT_COLUMNS
        )
    settings = settings_from(
        {
            "recording": {"frames_per_second": 1e3, "pixels_per_mm": SCALE, "face": "left"},
            "whisker": [WHISKER],
        }
    )
    write_session(own / "session.toml", settings)
    video = {"video": "one", "path": str(pictures), "status": "done", "frames": n}
    table = as_table(pd.DataFrame([video]), VIDEO_COLUMNS)
    files.write_csv(results / "videos.csv", table, VIDEO_COLUMNS)


def run(*arguments) -> int:
    with pytest.raises(SystemExit) as caught:
        cli.main(["calibrate", "dust", *(str(a) for a in arguments)])
    return caught.value.code or 0


@pytest.mark.slow
def test_the_follicles_motion_from_a_particle(tmp_path, capsys):
    results, out = write_results(tmp_path), tmp_path / "out"
    assert run(results, "--out", out) == 0
    table = read_videos(out)
    assert list(table["video"]) == ["one", "pooled"]
    true = np.ptp(radial(80)) / SCALE
    np.testing.assert_allclose(table["radial_range_mm"], true, atol=1e-3 * ABOUT_UM)
    np.testing.assert_allclose(table["particle_mm"], 110 / SCALE, atol=0.05)
    assert (table["contacts"] == 5).all()
    names = {path.name for path in out.glob("[!.]*")}
    assert names == {"dust.csv", "dust_contacts.csv", "dust_videos.csv", "one.png"}
    said = capsys.readouterr().out
    assert "one, whisker C2: particle 4.4" in said
    assert "5 contacts" in said


@pytest.mark.slow
def test_a_video_that_is_gone_is_left_out_and_the_others_measured(tmp_path, capsys):
    results, out = write_results(tmp_path), tmp_path / "out"
    shutil.copytree(results / "one", results / "gone")
    table = files.read_csv(results / "videos.csv", VIDEO_COLUMNS)
    gone = table.assign(video="gone", path=str(tmp_path / "gone"))
    files.write_csv(results / "videos.csv", pd.concat([gone, table]), VIDEO_COLUMNS)
    assert run(results, "--out", out) == 1
    assert list(read_videos(out)["video"]) == ["one", "pooled"]
    assert f"left out: gone, whisker C2: {tmp_path / 'gone'}: does not" in capsys.readouterr().out


def test_the_results_of_another_session_are_found_before_any_work(tmp_path, monkeypatch, capsys):
    results, out = write_results(tmp_path), tmp_path / "out"
    with new_files(out, ["Monday"]) as new:
        (new / "dust.csv").write_text("of Monday")
    monkeypatch.setattr(calibrate_dust, "measure_follicle_motion", None)  # not called
    assert run(results, "--out", out) == 2
    assert f"{out / 'dust.csv'}: would be replaced, but was made of" in capsys.readouterr().err


def read_videos(out):
    return files.read_csv(out / "dust_videos.csv", DUST_VIDEO_COLUMNS)


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        ((), ["1 video, and in none can", "no particle on it", "give --at-mm"]),
        (("--at-mm", 5), ["no particle on it", "is --at-mm 5 about where it sits"]),
        (("--whisker", "D1"), ["--whisker D1", "one of C2"]),
        (("--at-mm", -1), ["--at-mm -1.0", "above 0"]),
    ],
)
def test_nothing_is_written_where_no_particle_can_be_followed(tmp_path, capsys, options, expected):
    results, out = write_results(tmp_path, particle=False, n=60), tmp_path / "out"
    assert run(results, "--out", out, *options) == 2
    said = capsys.readouterr().err
    assert all(part in said for part in expected), said
    assert not out.exists()
