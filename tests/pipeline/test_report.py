"""report.html: one file, nothing from outside, everything that was promised on it."""

import html
import re

import numpy as np
import pytest
from results_folder import CONTACTS, make_results

from pipeline import figures, overlay, report, tables


@pytest.fixture
def page(tmp_path):
    results = make_results(tmp_path / "results")
    figures.write_fig3(results)
    return report.write_report(results).read_text("utf-8")


def test_nothing_comes_from_outside(page):
    assert not re.search(r"(src|href)=[\"'](?!data:|#)", page)
    assert "http" not in re.sub(r"data:[^\"]*", "", page)
    assert "<script" not in page


def test_videos_with_their_messages(page):
    assert ">one<" in page
    assert ">two<" in page
    assert html.escape("<b> & broken") in page
    assert "<b> & broken" not in page
    assert "2</b>videos, 1 failed" in page
    assert "100.0 %" in page


def test_numbers_figure_flags_settings_and_version(page):
    assert "data:image/svg+xml;base64," in page
    assert "12417" in page
    assert "large_deflection" in page
    assert "not_half_gaussian" in page
    assert "two frame 50" in page  # at its peak
    assert "base_radius_um = 37.0" in page
    assert "9.9" in page
    assert "Which contacts ring?" in page


def test_without_contacts_and_figures(tmp_path):
    results = make_results(tmp_path / "results", ())
    page = report.write_report(results).read_text("utf-8")
    assert ">one<" in page
    assert "Which contacts ring?" not in page
    assert "Touches" not in page


def test_pictures_are_of_the_contacts(tmp_path, monkeypatch):
    asked = []

    def picture_of(folder, path, frame, settings):
        asked.append((folder.name, frame))
        return np.zeros((20, 30, 3), np.uint8)

    monkeypatch.setattr(overlay, "picture_of", picture_of)
    page = report.write_report(make_results(tmp_path / "results")).read_text("utf-8")
    assert asked == [("one", 35), ("two", 50), ("one", 70)]  # a contact of each video first
    assert page.count("data:image/jpeg") == len(CONTACTS)
    assert "peak 30.0 µN, 40 ms" in page


def test_videos_that_are_gone_leave_no_gap(page):
    assert "data:image/jpeg" not in page  # the inputs of these results do not exist
    assert "What was found" not in page


# --- overlays --------------------------------------------------------------------------------


BLEND = 60  # grey levels: lines are smoothed into the picture


def rows(results, frame):
    inside = [("frame", "==", frame)]
    return tables.read_frames(results / "one" / "frames.parquet", overlay.COLUMNS, inside)


def test_overlay_draws_line_pole_and_force(tmp_path):
    results = make_results(tmp_path / "results")
    settings = report.read_session(results / "one" / "session.toml")
    image = np.full((480, 640), 200, np.uint8)
    line = {"C2": np.column_stack([np.arange(75.0, 475), np.full(400, 250.0)])}

    def drawn(frame):
        return overlay.draw(image, line, rows(results, frame), (230, 240, 6.25), settings)

    free, touching = drawn(10), drawn(70)
    assert free.shape == touching.shape == (480, 640, 3)
    np.testing.assert_allclose(free[250, 300], overlay.FREE, atol=BLEND)
    np.testing.assert_allclose(touching[250, 300], overlay.TOUCHING, atol=BLEND)
    assert np.all(free[233:248, 230].std(axis=0) > 0)  # the pole's rim
    changed = np.argwhere((free != touching).any(axis=2))
    arrow = changed[(changed[:, 0] > 252) & (changed[:, 1] > 100)]
    # 8 mm from the follicle at x = 40 px is x = 240; lateral force points up, its tail is below
    assert abs(np.median(arrow[:, 1]) - 240) < 8
    length = overlay.MM_PER_UN * 10 * 25
    assert np.ptp(arrow[:, 0]) == pytest.approx(length, abs=8)


def test_small_pictures_are_enlarged(tmp_path):
    settings = report.read_session(make_results(tmp_path / "r") / "session.toml")
    image = np.full((120, 160), 200, np.uint8)
    canvas = overlay.draw(image, {"w1": np.array([[20.0, 60], [140, 60]])}, None, None, settings)
    assert canvas.shape == (240, 320, 3)
    column = np.flatnonzero((canvas[100:, 160] != 200).any(axis=1)) + 100
    assert column.mean() == pytest.approx(120.5, abs=0.6)  # centre of row 60, twice as large
