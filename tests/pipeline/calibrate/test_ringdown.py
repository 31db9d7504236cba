"""Ring-downs in results folders made by hand: the model's decays, and what cannot be fitted."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from pipeline.app import calibrate_ringdown, cli
from pipeline.calibrate.ringdown import fit_slip, pool, pooled_estimate
from pipeline.calibrate.slips import find_slips, named_slips
from pipeline.session.session_file import read_session, settings_from, write_session
from pipeline.tables import centrelines, files
from pipeline.tables.calibration_columns import RINGDOWN_COLUMNS
from pipeline.tables.centrelines import Centrelines
from pipeline.tables.columns import CONTACT_COLUMNS, FRAME_COLUMNS, VIDEO_COLUMNS, as_table
from whiskermodel.modes import modes
from whiskermodel.ringdown import Estimate
from whiskermodel.whisker import Whisker

TRUE = Whisker(18e-3, 18e-3 / 0.95, 37e-6, youngs_modulus=3.4e9, damping_rate=190.0)
DIMENSIONS = {
    "name": "C2", "length_mm": 18.0, "cone_length_mm": 18 / 0.95, "base_radius_um": 37.0,
}  # fmt: skip
SLIPS, SPACING = 8, 60  # slips in a video, frames from one to the next
NOISE = 0.5  # 1/m
MODULUS = 0.02  # relative error of eight slips


def curvature(time, boundary, rng):
    """Curvature change [1/m] of three modes after a slip, with shares as a release has them."""
    shapes = modes(TRUE.taper, boundary, 4)
    p = shapes.angular_frequency(TRUE)
    p = np.sqrt(p[p > 0][:3] ** 2 - TRUE.damping_rate**2)
    late = rng.uniform(0, 1e-3)  # from the release to the first frame
    parts = np.array([60.0, 15.0, 12.0]) * rng.uniform(0.7, 1.3, 3)
    swing = np.cos(p[:, None] * (time + late)) * parts[:, None]
    return swing.sum(axis=0) * np.exp(-TRUE.damping_rate * (time + late))


def frame_table(rate, boundary, seed):
    rng = np.random.default_rng(seed)
    n = SLIPS * SPACING
    change = rng.normal(scale=NOISE, size=n)
    for k in range(SLIPS):
        rows = slice(k * SPACING + 10, (k + 1) * SPACING)
        change[rows] += curvature(np.arange(SPACING - 10) / rate, boundary, rng)
    table = pd.DataFrame(
        {
            "frame": np.arange(n),
            "time_s": np.arange(n) / rate,
            "whisker": "C2",
            "tracked": True,
            "curvature_per_m": change,
            "curvature_change_per_m": change,
            "curvature_change_per_m_se": NOISE,
        }
    )
    return as_table(table, FRAME_COLUMNS)


def contact_rows(slip=True):
    rows = [
        {
            "video": "one", "whisker": "C2", "contact": k + 1, "onset_frame": k * SPACING + 1,
            "offset_frame": k * SPACING + 10, "slip": slip,
        }
        for k in range(SLIPS)
    ]  # fmt: skip
    return as_table(pd.DataFrame(rows), CONTACT_COLUMNS)


def lines():
    n = SLIPS * SPACING
    x = np.tile(np.arange(50, 90, dtype=np.float32), n)
    return Centrelines(
        ("C2",), np.arange(n, dtype=np.int32), np.zeros(n, np.int32),
        np.arange(n + 1, dtype=np.int64) * 40, x, x, x, np.ones(n, np.float32),
    )  # fmt: skip


def make_results(folder, rate=1000.0, boundary="fixed", seed=0, slip=True, whisker=None):
    """A results folder of one video with eight slips; its session knows another E and damping."""
    (folder / "one").mkdir(parents=True)
    settings = settings_from(
        {
            "recording": {"frames_per_second": rate, "pixels_per_mm": 25, "face": "left"},
            "whisker": [DIMENSIONS if whisker is None else whisker],
        }
    )
    write_session(folder / "one" / "session.toml", settings)
    files.write_frames(folder / "one" / "frames.parquet", frame_table(rate, boundary, seed))
    centrelines.write_centrelines(folder / "one" / "centrelines.parquet", lines())
    files.write_csv(folder / "contacts.csv", contact_rows(slip), CONTACT_COLUMNS)
    video = {"video": "one", "status": "done", "frames": SLIPS * SPACING}
    videos = as_table(pd.DataFrame([video]), VIDEO_COLUMNS)
    files.write_csv(folder / "videos.csv", videos, VIDEO_COLUMNS)
    return folder


def run(*arguments) -> int:
    with pytest.raises(SystemExit) as caught:
        cli.main(["calibrate", "ringdown", *(str(a) for a in arguments)])
    return caught.value.code or 0


@pytest.mark.slow
@pytest.mark.parametrize("boundary", ["fixed", "pinned", 5.0])
def test_youngs_modulus_and_damping_of_eight_slips(tmp_path, boundary):
    results = make_results(tmp_path / "results", boundary=boundary)
    fits = [fit_slip(slip, boundary) for slip in find_slips(results)]
    together = pool(fits, TRUE, boundary)
    assert together.n == SLIPS
    assert together.youngs_modulus.value == pytest.approx(TRUE.youngs_modulus, rel=MODULUS)
    assert together.damping.value == pytest.approx(TRUE.damping_rate, rel=0.03)
    first = modes(TRUE.taper, boundary, 2).angular_frequency(TRUE)
    undamped = first[first > 0][0]
    damped = np.sqrt(undamped**2 - TRUE.damping_rate**2)
    assert together.angular_frequency.value == pytest.approx(damped, rel=MODULUS / 2)


@pytest.mark.slow
def test_intervals_of_single_slips_cover(tmp_path):
    """Of 40 slips, 95 % intervals of E hold the truth in at least 90 %."""
    inside = []
    for seed in range(5):
        results = make_results(tmp_path / str(seed), seed=seed)
        for slip in find_slips(results):
            e = fit_slip(slip).youngs_modulus(TRUE, "fixed")
            inside.append(e.low < TRUE.youngs_modulus < e.high)
    assert np.mean(inside) >= 0.9


def test_pooling_adds_what_slips_differ_beyond_their_errors():
    same = [Estimate(100.0, 98.0, 102.0)] * 4
    apart = [Estimate(v, v - 0.02, v + 0.02) for v in (90.0, 110.0, 95.0, 105.0)]
    assert pooled_estimate(same).value == pytest.approx(100)
    pooled = pooled_estimate(apart)
    assert pooled.value == pytest.approx(100, abs=0.1)
    assert 10 < pooled.high - pooled.value < 20  # Student's interval of four numbers
    assert pooled_estimate(same[:1]) is same[0]


@pytest.mark.slow
def test_command_writes_tables_figure_and_session(tmp_path, capsys):
    results, out, session = make_results(tmp_path / "r"), tmp_path / "out", tmp_path / "s.toml"
    write_session(session, read_session(results / "one" / "session.toml"))
    before = session.read_text("utf-8")
    assert run(results, "--out", out, "--into", session, "--whisker", "C2") == 0
    table = files.read_csv(out / "ringdown.csv", RINGDOWN_COLUMNS)
    assert list(table["frame"]) == [*range(10, SLIPS * SPACING, SPACING), SLIPS]
    assert list(table["video"]) == ["one"] * SLIPS + ["pooled"]
    pooled = table.iloc[-1]
    assert pooled["youngs_modulus_GPa"] == pytest.approx(3.4, rel=MODULUS)
    assert pooled["youngs_modulus_GPa_low"] < 3.4 < pooled["youngs_modulus_GPa_high"]
    assert (out / "ringdown.png").stat().st_size > 10_000
    follicle = pd.read_csv(out / "follicle.csv")
    fixed = follicle.set_index("follicle_stiffness")["youngs_modulus_GPa"]
    assert fixed[np.inf] == pytest.approx(pooled["youngs_modulus_GPa"], rel=1e-5)
    assert fixed[10.0] > fixed[np.inf] > fixed[0.0]
    (whisker,) = read_session(session).whisker
    assert whisker.youngs_modulus_GPa == pytest.approx(pooled["youngs_modulus_GPa"], rel=1e-4)
    assert whisker.damping_per_s == pytest.approx(pooled["damping_per_s"], rel=1e-4)
    changed = zip(before.splitlines(), session.read_text("utf-8").splitlines(), strict=True)
    assert sum(a != b for a, b in changed) == 2
    assert "8 slips, fixed follicle" in capsys.readouterr().out


def test_slips_of_whiskers_of_unlike_dimensions_are_not_pooled(monkeypatch):
    def slip(video, **other):
        recording = {"frames_per_second": 1000.0, "pixels_per_mm": 25, "face": "left"}
        settings = settings_from({"recording": recording, "whisker": [DIMENSIONS | other]})
        return SimpleNamespace(video=SimpleNamespace(name=video, settings=settings), whisker="C2")

    monkeypatch.setattr(calibrate_ringdown, "fit_slip", lambda slip, boundary: slip.video.name)
    first, later = slip("monday"), slip("tuesday", youngs_modulus_GPa=3.4)
    assert calibrate_ringdown._fit(later, first, "fixed") == "tuesday"
    with pytest.raises(ValueError, match="other dimensions in friday than in monday"):
        calibrate_ringdown._fit(slip("friday", length_mm=17.0), first, "fixed")


def test_frames_may_be_named(tmp_path):
    results = make_results(tmp_path / "r", slip=False)
    for place in ("70", "one:70", "one:C2:70"):
        (slip,) = named_slips(results, [place])
        assert str(slip) == "one, whisker C2, frame 70"
        assert list(slip.frames["frame"]) == list(range(70, SPACING * 2 + 1))
        assert "frames" not in vars(slip.video)  # all of the video's, which would stay in memory
    for place, word in (
        ("two:70", "expected a video of one"),
        ("one:D1:70", "expected a whisker of C2"),
        ("one:C2:x", "VIDEO:WHISKER:FRAME"),
        ("one:C2:²", "VIDEO:WHISKER:FRAME"),
        ("other:one:C2:70", "expected a video of one"),
    ):
        with pytest.raises(ValueError, match=word):
            named_slips(results, [place])
    (results / "one").rename(results / "at:one")
    for name in ("videos.csv", "contacts.csv"):
        table = results / name
        table.write_text(table.read_text().replace("\none,", "\nat:one,"))
    (slip,) = named_slips(results, ["at:one:C2:70"])
    assert str(slip) == "at:one, whisker C2, frame 70"


@pytest.mark.slow
def test_a_slip_that_cannot_be_fitted_is_left_out_and_makes_the_exit_status_1(tmp_path, capsys):
    results, out = make_results(tmp_path / "r"), tmp_path / "out"
    assert run(results, "--out", out, "--frames", "70", "--frames", "55") == 1
    assert list(files.read_csv(out / "ringdown.csv", RINGDOWN_COLUMNS)["frame"]) == [70, 1]
    assert "left out: one, whisker C2, frame 55: free for 6 ms only" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("make", "options", "expected"),
    [
        ({"slip": False}, [], ["none of its 8 contacts ends with a slip", "--frames"]),
        ({"rate": 300.0}, [], ["300 frames/s cannot carry", "124 Hz", "higher frame rate"]),
        (
            {"whisker": {"name": "C2", "length_mm": 18.0}},
            [],
            ["C2", "cone_length_mm, base_radius_um missing", "calibrate geometry"],
        ),
        ({}, ["--frames", "one:C2:55"], ["1 slip, and none", "free for 6 ms only", "12 ms"]),
        ({}, ["--frames", "one:C2:40"], ["1 slip, and none", "frame 40"]),
        ({}, ["--whisker", "D1"], ["--whisker D1: no slip of it"]),
        ({}, ["--follicle", "loose"], ["--follicle loose", "fixed, pinned"]),
    ],
)
def test_what_cannot_be_fitted_is_said_and_nothing_written(
    tmp_path, capsys, make, options, expected
):
    results, out = make_results(tmp_path / "r", **make), tmp_path / "out"
    assert run(results, "--out", out, *options) == 2
    said = capsys.readouterr().err
    assert all(part in said for part in expected), said
    assert not out.exists()


def test_a_folder_without_results_is_refused(tmp_path, capsys):
    assert run(tmp_path, "--out", tmp_path / "out") == 2
    assert "is an empty folder: expected results" in capsys.readouterr().err
