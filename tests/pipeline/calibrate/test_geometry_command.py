"""`calibrate geometry` as a user runs it: files, pooled whiskers, session.toml, refusals."""

import re

import cv2
import numpy as np
import pytest

from pipeline.app import calibrate_geometry, cli
from pipeline.session.session_file import read_session
from pipeline.tables.calibration_columns import DENSITY_COLUMNS, GEOMETRY_COLUMNS
from pipeline.tables.files import read_csv
from synthetic.micrograph import Micrograph
from whiskermodel.whisker import Whisker

LENGTHS = 4.0, 4.4  # mm
SESSION = """[recording]
frames_per_second = 1000.0   # camera
pixels_per_mm = 25.0
face = "left"

[[whisker]]
name = "C2"
# cone_length_mm =   # to be measured
hidden_length_mm = 0.5
[analysis]
curvature_at_mm = 2.0
"""


@pytest.fixture(scope="module")
def pictures(tmp_path_factory):
    folder = tmp_path_factory.mktemp("micrographs")
    for k, length in enumerate(LENGTHS):
        whisker = Whisker(1e-3 * length, 1.1e-3 * length, 35e-6)
        picture = Micrograph(whisker, pixels_per_mm=140.0, seed=k).picture()
        cv2.imwrite(str(folder / f"w{k}.png"), picture)
    cv2.imwrite(str(folder / "empty.png"), np.full((200, 300), 180, np.uint8))
    (folder / "broken.png").write_bytes((folder / "w0.png").read_bytes()[:100])
    return folder


@pytest.fixture
def session(tmp_path):
    (tmp_path / "session.toml").write_text(SESSION, encoding="utf-8")
    return tmp_path / "session.toml"


def run(*arguments) -> int:
    with pytest.raises(SystemExit) as caught:
        cli.main(["calibrate", "geometry", *(str(a) for a in arguments)])
    return caught.value.code or 0


@pytest.mark.slow
def test_two_whiskers_into_a_session(pictures, session, tmp_path, capsys):
    images, out = [pictures / "w0.png", pictures / "w1.png"], tmp_path / "out"
    code = run(
        *images, "--pixels-per-mm", 140, "--out", out, "--into", session, "--whisker", "C2",
        "--mass-ug", 7, "--mass-ug", 7.7,
    )  # fmt: skip
    assert code == 0
    table = read_csv(out / "geometry.csv", GEOMETRY_COLUMNS + DENSITY_COLUMNS)
    assert list(table["image"]) == ["w0.png", "w1.png"]
    np.testing.assert_allclose(table["length_mm"], LENGTHS, rtol=2e-3)
    np.testing.assert_allclose(table["base_radius_um"], 35, rtol=5e-3)
    assert (table.filter(like="_se") > 0).all(axis=None)
    assert (table["length_mm_se"] < 1e-3 * table["length_mm"]).all()
    (whisker,) = read_session(session).whisker
    assert whisker.length_mm == pytest.approx(np.mean(LENGTHS), rel=2e-3)
    assert whisker.cone_length_mm == pytest.approx(1.1 * np.mean(LENGTHS), rel=5e-3)
    assert whisker.density_kg_per_m3 == pytest.approx(table["density_kg_per_m3"].mean(), rel=1e-4)
    text = session.read_text(encoding="utf-8")
    assert "# camera" in text
    assert "# to be measured" in text
    said = capsys.readouterr().out
    assert re.search("2 whiskers, mean ± SD: length 4.(199|2|201) ± 0.28 mm", said)
    assert "unlike" not in said
    names = {path.name for path in out.glob("[!.]*")}
    assert names == {
        "geometry.csv", "geometry.png", "pooled.csv", "w0.png", "w0_profile.csv", "w1.png",
        "w1_profile.csv",
    }  # fmt: skip


@pytest.mark.slow
def test_pictures_that_cannot_be_measured_are_left_out(pictures, session, tmp_path, capsys):
    images = [pictures / name for name in ("empty.png", "w0.png", "broken.png")]
    masses = ["--mass-ug", 1, "--mass-ug", 7, "--mass-ug", 2]
    into = "--into", session, "--whisker", "C2"
    out = tmp_path / "out"
    assert run(*images, "--pixels-per-mm", 140, "--out", out, *into, *masses) == 1
    table = read_csv(out / "geometry.csv", GEOMETRY_COLUMNS + DENSITY_COLUMNS)
    assert list(table["image"]) == ["w0.png"]
    (whisker,) = read_session(session).whisker
    assert whisker.density_kg_per_m3 == pytest.approx(1241, rel=2e-2)  # of 7 µg in 4 mm
    said = capsys.readouterr().out
    assert f"left out: {images[0]}: shows no whisker" in said
    assert f"left out: {images[2]}: cannot be read as a picture" in said


@pytest.mark.slow
def test_the_mean_of_whiskers_that_are_not_alike_is_doubted(pictures, session, tmp_path, capsys):
    thick = Micrograph(Whisker(4e-3, 4.4e-3, 40e-6), pixels_per_mm=140.0, seed=2).picture()
    cv2.imwrite(str(tmp_path / "thick.png"), thick)
    images = pictures / "w0.png", tmp_path / "thick.png"
    into = "--into", session, "--whisker", "C2"
    assert run(*images, "--pixels-per-mm", 140, "--out", tmp_path / "out", *into) == 0
    said = capsys.readouterr().out
    assert "base radius varies by 9 % (SD)" in said
    assert "under its own name" in said


@pytest.mark.slow
def test_dimensions_that_are_hardly_true_are_doubted_where_they_are_written(
    pictures, session, tmp_path, capsys
):
    """As those of a micrograph that was measured at the video's scale."""
    wrong = "length_mm = 144.0\ncone_length_mm = 151.0\nbase_radius_um = 296.0\n"
    with open(session, "a", encoding="utf-8") as file:
        file.write(f'\n[[whisker]]\nname = "C1"\n{wrong}')
    into = "--into", session, "--whisker", "C2"
    out = tmp_path / "out"
    assert run(pictures / "w0.png", "--pixels-per-mm", 140, "--out", out, *into) == 0
    assert "[[whisker]] length_mm = 144 (C1): those of mice" in capsys.readouterr().out


@pytest.mark.slow
def test_a_session_that_has_the_tips_radius_keeps_it(pictures, session, tmp_path):
    text = session.read_text(encoding="utf-8").replace(
        "# cone_length_mm = ", "tip_radius_um = 9.0"
    )
    session.write_text(text.replace("hidden", "base_radius_um = 30.0\nhidden"), encoding="utf-8")
    image, out = pictures / "w0.png", tmp_path / "out"
    into = "--into", session, "--whisker", "C2"
    assert run(image, "--pixels-per-mm", 140, "--out", out, *into) == 0
    (whisker,) = read_session(session).whisker
    assert whisker.cone_length_mm is None
    assert whisker.tip_radius_um == pytest.approx(35 * (1 - 1 / 1.1), abs=0.15)
    names = {path.name for path in out.glob("[!.]*")}
    assert names == {"geometry.csv", "w0.png", "w0_profile.csv"}
    assert list(read_csv(out / "geometry.csv", GEOMETRY_COLUMNS)["image"]) == ["w0.png"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("images", "options", "expected"),
    [
        (["w0.png"], {"--pixels-per-mm": 140e3}, ["pixels per m?", "--pixels-per-mm 140"]),
        (["w0.png"], {"--pixels-per-mm": 0.14}, ["pixels per µm?", "--pixels-per-mm 140"]),
        (["w0.png"], {"--pixels-per-mm": -1}, ["--pixels-per-mm -1.0", "above 0"]),
        (["empty.png"], {}, ["empty.png", "shows no whisker"]),
        (["empty.png", "broken.png"], {}, ["2 pictures", "none can", "empty.png"]),
        (["w0.png"], {"--scale-bar-mm": 1}, ["--scale-bar-mm", "expected one of them"]),
        (["w0.png"], {"--whisker": "D4"}, ["session.toml", '"D4"', "found: C2"]),
        (["w0.png", "w1.png"], {"--mass-ug": 3}, ["--mass-ug", "one per image (2), got 1"]),
    ],
)
def test_what_cannot_be_measured_leaves_all_as_it_was(
    pictures, session, tmp_path, capsys, images, options, expected
):
    given = {"--pixels-per-mm": 140, "--into": session, "--whisker": "C2", **options}
    out = tmp_path / "out"
    words = [word for pair in given.items() for word in pair]
    assert run(*(pictures / image for image in images), "--out", out, *words) == 2
    said = capsys.readouterr().err
    assert all(part in said for part in expected), said
    assert session.read_text(encoding="utf-8") == SESSION
    assert not out.exists()


def test_a_picture_that_is_named_twice_is_no_second_whisker(pictures, tmp_path, capsys):
    images = pictures / "w0.png", pictures / "." / "w1.png", pictures / "w1.png"
    assert run(*images, "--pixels-per-mm", 140, "--out", tmp_path / "out") == 2
    assert f"{images[1]}: is named twice" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_name_too_long_is_refused_before_measuring(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(calibrate_geometry, "measure_geometry", None)
    image = tmp_path / f"{'w' * 250}.png"
    assert run(image, "--pixels-per-mm", 140, "--out", tmp_path / "a" / "out") == 2
    said = capsys.readouterr().err
    assert f"{tmp_path / 'a' / 'out' / image.stem}_profile.csv: File name too long; " in said
    assert not (tmp_path / "a").exists()


def test_into_needs_a_whisker(pictures, session, tmp_path, capsys):
    image = pictures / "w0.png"
    assert run(image, "--pixels-per-mm", 140, "--out", tmp_path / "o", "--into", session) == 2
    assert "--into and --whisker: expected both or neither" in capsys.readouterr().err
