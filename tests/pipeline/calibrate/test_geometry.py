"""Dimensions of rendered whiskers: truth recovered, intervals that cover, bad pictures refused."""

import cv2
import numpy as np
import pytest
import tifffile

from pipeline.calibrate import geometry_picture
from pipeline.calibrate.find_whisker import NoWhiskerError
from pipeline.calibrate.geometry import measure_geometry
from pipeline.calibrate.geometry_files import profile, remarks
from pipeline.errors import VideoError
from synthetic.micrograph import Micrograph, random_micrograph
from whiskermodel.whisker import Whisker

WHISKER = Whisker(6e-3, 6.4e-3, 40e-6)
LENGTH, BASE_RADIUS = 2e-3, 5e-3  # relative errors: 0.2 % and 0.5 %
TIP_UM = 0.15


def small(**changes):
    return Micrograph(**{"whisker": WHISKER, "pixels_per_mm": 130.0, **changes})


def measure(tmp_path, micrograph, picture=None):
    path = tmp_path / "whisker.png"
    cv2.imwrite(str(path), micrograph.picture() if picture is None else picture)
    return measure_geometry(path, micrograph.pixels_per_mm)


@pytest.mark.slow
def test_the_picture_shows_diameter_and_deviation_above_each_other(tmp_path, monkeypatch):
    found, figures = measure(tmp_path, small()), []
    monkeypatch.setattr(geometry_picture, "save", lambda path, figure: figures.append(figure))
    geometry_picture.draw_whisker(tmp_path / "a.png", found, profile(found))
    diameter, deviation = figures[0].axes[-2:]
    assert diameter.get_xlim() == deviation.get_xlim()


@pytest.mark.slow
@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"curvature": (350.0, 30e3), "direction": 2.0},  # curled by more than half a turn
        {"tiles": 4, "unevenness": 0.5, "dust_on": 3, "direction": -0.4},
        {"bright": True},
        {"root": 0.3e-3},
        {"whisker": Whisker(6e-3, 12e-3, 40e-6)},  # broken in the middle
        {"direction": np.pi / 2, "scale_bar_mm": 1.0, "dust_beside": 40},
    ],
)
def test_dimensions_of_rendered_whiskers(tmp_path, changes):
    micrograph = small(**changes)
    found = measure(tmp_path, micrograph)
    whisker = micrograph.whisker
    assert found.length.value == pytest.approx(1e3 * whisker.length, rel=LENGTH)
    assert found.base_radius.value == pytest.approx(1e6 * whisker.base_radius, rel=BASE_RADIUS)
    tip = 1e6 * whisker.radius(whisker.length)
    assert found.tip_radius.value == pytest.approx(tip, abs=TIP_UM)
    assert found.cone_length.value == pytest.approx(1e3 * whisker.cone_length, rel=5e-3)
    volume = np.pi * np.mean(whisker.radius(np.linspace(0, whisker.length, 2001)) ** 2)
    assert found.volume.value == pytest.approx(1e9 * volume * whisker.length, rel=0.01)


@pytest.mark.slow
def test_a_bright_core_leaves_the_base_radius_as_it_is(tmp_path):
    micrograph = small(core=0.3, opacity=0.7, pixels_per_mm=300.0)
    found = measure(tmp_path, micrograph)
    assert found.base_radius.value == pytest.approx(40, rel=BASE_RADIUS)
    assert found.length.value == pytest.approx(6, rel=LENGTH)


@pytest.mark.slow
@pytest.mark.parametrize("bright", [False, True])
def test_scale_by_a_scale_bar(tmp_path, bright):
    path = tmp_path / "whisker.png"
    cv2.imwrite(str(path), small(scale_bar_mm=1.0, bright=bright, curvature=(60.0,)).picture())
    found = measure_geometry(path, scale_bar_mm=1.0)
    assert found.pixels_per_mm == pytest.approx(130)
    assert found.length.value == pytest.approx(6, rel=LENGTH)
    assert found.length.se > 6 * 0.3 / 130  # the bar's ends are known to a part of a pixel


@pytest.mark.parametrize("scale", [(), (130, 1.0), (-130,), (np.nan,), (None, 0.0)])
def test_a_scale_is_needed_and_one_only(tmp_path, scale):
    with pytest.raises(ValueError, match=r"^\w+_mm.*expected (one of them|a number above 0)"):
        measure_geometry(tmp_path / "not_looked_at.png", *scale)


def test_a_picture_without_a_scale_bar_is_refused(tmp_path):
    path = tmp_path / "whisker.png"
    cv2.imwrite(str(path), small().picture())
    with pytest.raises(NoWhiskerError, match=r"no scale bar.*--pixels-per-mm"):
        measure_geometry(path, scale_bar_mm=1.0)


@pytest.mark.slow
def test_intervals_cover(tmp_path):
    """Of 12 small micrographs drawn at random, 95 % intervals hold at least 85 % of the truths."""
    inside = []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        length = rng.uniform(4e-3, 6e-3)
        whisker = Whisker(length, length / rng.uniform(0.85, 0.97), rng.uniform(30e-6, 45e-6))
        micrograph = random_micrograph(seed, whisker=whisker, dust_on=1)
        found = measure(tmp_path, micrograph)
        for measured, true in (
            (found.length, 1e3 * length),
            (found.base_radius, 1e6 * whisker.base_radius),
            (found.tip_radius, 1e6 * whisker.radius(length)),
            (found.cone_length, 1e3 * whisker.cone_length),
        ):
            inside.append(abs(measured.value - true) < 1.96 * measured.se)
    assert np.mean(inside) > 0.85


@pytest.mark.slow
@pytest.mark.parametrize("seed", [18, 21])
def test_tiles_of_a_bright_whisker_are_right_or_uncertain(tmp_path, seed):
    """Ground and whisker do not brighten alike there, and the tip's contrast is not seen."""
    micrograph = random_micrograph(seed, bright=True, tiles=5)
    found = measure(tmp_path, micrograph).cone_length
    off = found.value - 1e3 * micrograph.whisker.cone_length
    assert abs(off) < 3 * found.se
    assert found.se < 0.02 * found.value


@pytest.mark.slow
def test_edges_lie_half_a_diameter_off_the_true_centreline(tmp_path):
    micrograph = small(curvature=(200.0, 0.0))
    found = measure(tmp_path, micrograph)
    table = profile(found)
    x, y, angle, _, s = micrograph.centreline()
    for side, sign in (("left", 1), ("right", -1)):
        at = 1e-3 * table["arc_length_mm"]
        radius = WHISKER.radius(at) * 1e3 * micrograph.pixels_per_mm
        true_x = np.interp(at, s, x) - sign * radius * np.sin(np.interp(at, s, angle))
        true_y = np.interp(at, s, y) - sign * radius * np.cos(np.interp(at, s, angle))
        off = np.hypot(table[f"{side}_x_px"] - true_x, table[f"{side}_y_px"] - true_y)
        assert np.median(off) < 0.3  # px, most of it along the whisker


@pytest.mark.slow
def test_a_cut_tip_and_a_root_are_remarked_upon(tmp_path):
    cut = measure(tmp_path, small(whisker=Whisker(6e-3, 9e-3, 40e-6)))
    assert any("cut or broken" in remark for remark in remarks(cut))
    assert remarks(measure(tmp_path, small(dust_beside=0))) == []


def test_density(tmp_path):
    found = measure(tmp_path, small())
    s = np.linspace(0, WHISKER.length, 2001)
    volume = np.pi * np.mean(WHISKER.radius(s) ** 2) * WHISKER.length
    density = found.density(1e9 * 1150 * volume)  # kg → µg
    assert density.value == pytest.approx(1150, rel=0.01)
    assert 0 < density.se < 20


def ground(rng):
    return np.clip(180 + rng.normal(scale=3, size=(300, 500)), 0, 255).astype(np.uint8)


def test_pictures_that_show_no_whisker_are_refused(tmp_path):
    rng = np.random.default_rng(0)
    empty, dusty, fibre = ground(rng), ground(rng), ground(rng)
    for x, y in rng.uniform(30, 270, (12, 2)):
        cv2.circle(dusty, (int(x), int(y)), 8, 20, -1)
    cv2.line(fibre, (60, 60), (440, 200), 30, 14, cv2.LINE_AA)
    for picture, word in ((empty, "no whisker"), (dusty, "no whisker"), (fibre, "taper")):
        with pytest.raises(NoWhiskerError, match=word) as caught:
            measure(tmp_path, small(), picture)
        assert "whisker.png" in str(caught.value)


@pytest.mark.slow
def test_a_whisker_that_is_cut_off_or_too_small_is_refused(tmp_path):
    picture = small().picture()
    with pytest.raises(NoWhiskerError, match="cuts the whisker off at its base"):
        measure(tmp_path, small(), picture[:, 150:])
    with pytest.raises(NoWhiskerError, match="cuts the whisker off at its tip"):
        measure(tmp_path, small(), picture[:, :-200])
    with pytest.raises(NoWhiskerError, match="higher magnification"):
        measure(tmp_path, small(pixels_per_mm=35.0))


def test_a_thin_whisker_out_of_focus_is_refused(tmp_path):
    """Its contrast would be that of the thin part, and its cone a seventh too long."""
    blurred = random_micrograph(1)
    with pytest.raises(NoWhiskerError, match=r"edges blurred by 1\.7 px"):
        measure(tmp_path, blurred, blurred.picture())
    sharp = random_micrograph(1, blur_px=0.9)
    found = measure(tmp_path, sharp, sharp.picture())
    assert found.cone_length.value == pytest.approx(1e3 * sharp.whisker.cone_length, rel=0.005)


@pytest.mark.parametrize(("bright", "shift", "end"), [(False, 90, "white"), (True, -40, "black")])
def test_a_ground_beyond_the_grey_scale_is_refused(tmp_path, bright, shift, end):
    """Overexposed, a base came out a sixth too thin and its cone a fifth too long."""
    micrograph = small(bright=bright)
    shifted = np.clip(micrograph.picture() + float(shift), 0, 255).astype(np.uint8)
    with pytest.raises(NoWhiskerError, match=rf"9\d % of its pixels purely {end}"):
        measure(tmp_path, micrograph, shifted)


@pytest.mark.slow
def test_all_kinds_of_pixels_mean_the_same(tmp_path):
    grey = small().picture()
    for pixels in (grey, np.uint16(257) * grey, grey / np.float32(255)):
        tifffile.imwrite(tmp_path / "a.tif", pixels)
        found = measure_geometry(tmp_path / "a.tif", 130).base_radius
        assert found.value == pytest.approx(40, rel=1e-3)
        assert found.se < 0.06  # µm
    pixels[5, 5] = np.nan
    tifffile.imwrite(tmp_path / "a.tif", pixels)
    with pytest.raises(VideoError, match=r"a\.tif: has pixels without a value"):
        measure_geometry(tmp_path / "a.tif", 130)


def test_what_is_no_picture_is_refused(tmp_path):
    (tmp_path / "huge.pgm").write_bytes(b"P5\n2097152 2097152\n255\n")  # beyond what OpenCV reads
    with pytest.raises(VideoError, match=r"huge\.pgm.*cannot be read as a picture"):
        measure_geometry(tmp_path / "huge.pgm", 130)
    (tmp_path / "note.png").write_text("no picture")
    with pytest.raises(VideoError, match=r"note\.png.*cannot be read as a picture"):
        measure_geometry(tmp_path / "note.png", 130)
    with pytest.raises(VideoError, match=r"gone\.png.*cannot be opened"):
        measure_geometry(tmp_path / "gone.png", 130)
    (tmp_path / "empty.png").write_bytes(b"")
    with pytest.raises(VideoError, match=r"empty\.png.*the file is empty"):
        measure_geometry(tmp_path / "empty.png", 130)


def test_of_several_pages_none_is_measured_in_silence(tmp_path):
    tifffile.imwrite(tmp_path / "a.tif", np.full((2, 200, 200), 200, np.uint8))
    with pytest.raises(VideoError, match=r"a\.tif: has more than one page: expected one"):
        measure_geometry(tmp_path / "a.tif", 130)


@pytest.mark.parametrize(
    "pixels", [np.zeros((3, 200, 200, 7), np.uint8), np.full((200, 200), np.nan, np.float32)]
)
def test_a_picture_that_must_be_exported_again_says_so(tmp_path, pixels):
    tifffile.imwrite(tmp_path / "a.tif", pixels, photometric="minisblack")
    with pytest.raises(VideoError, match=r"a\.tif: has .*: expected .*grey.*; export it"):
        measure_geometry(tmp_path / "a.tif", 130)
