"""Findings in a picture: where lines, arrows and words lie, and colours that stay apart."""

import itertools

import numpy as np
import pandas as pd
import pytest
from colour_vision import difference
from results_folder import SETTINGS, make_results

from pipeline.reports import drawing, lettering, overlay
from pipeline.tables import files

BLEND = 60  # grey levels: lines are smoothed into the picture
APART = 20.0  # ΔE 2000 of lines that must differ in colour
POLE = (230, 240, 6.25)


def rows(results, frame):
    inside = [("frame", "==", frame)]
    return files.read_frames(results / "one" / "frames.parquet", drawing.COLUMNS, inside)


def picture(height=480, width=640):
    return np.full((height, width), 200, np.uint8)


def test_line_pole_and_force_lie_where_they_are(tmp_path):
    results = make_results(tmp_path / "results")
    line = {"C2": np.column_stack([np.arange(75.0, 475), np.full(400, 250.0)])}

    def drawn(frame):
        return drawing.draw(picture(), line, rows(results, frame), POLE, SETTINGS)

    free, touching = drawn(10), drawn(70)
    assert free.shape == touching.shape
    assert free.shape[1] == 640
    np.testing.assert_allclose(free[250, 300], drawing.FREE, atol=BLEND)
    np.testing.assert_allclose(touching[250, 300], drawing.TOUCHING, atol=BLEND)
    np.testing.assert_allclose(free[240, 236], drawing.POLE, atol=BLEND)  # its rim
    changed = np.argwhere((free[:480] != touching[:480]).any(axis=2))
    arrow = changed[(changed[:, 0] > 252) & (changed[:, 1] > 100)]
    # 8 mm from the follicle at x = 40 px is x = 240; lateral force points up, its tail is below
    assert abs(np.median(arrow[:, 1]) - 240) < 8
    length = drawing.MM_PER_UN * 10 * 25
    assert np.ptp(arrow[:, 0]) == pytest.approx(length, abs=8)


def test_words_lie_below_the_picture_and_not_in_it(tmp_path):
    results = make_results(tmp_path / "results")
    image = picture()
    canvas = drawing.draw(image, {}, rows(results, 10), None, SETTINGS)
    assert np.array_equal(canvas[:480], np.repeat(image[..., None], 3, axis=2))
    assert (canvas[480:] > 240).any()


def test_small_pictures_are_enlarged():
    lines = {"w1": np.array([[20.0, 60], [140, 60]])}
    canvas = drawing.draw(picture(120, 160), lines, pd.DataFrame(), None, SETTINGS)
    assert canvas.shape[1] == 480
    column = np.flatnonzero((canvas[150:300, 240] != 200).any(axis=1)) + 150
    assert column.mean() == pytest.approx(181, abs=0.6)  # centre of row 60, three times as large


def test_a_part_of_a_picture_keeps_places_right():
    view = drawing.View.around(picture(), (600, 240), (200, 150), 400)
    assert (view.left, view.top, view.width, view.height) == (440, 165, 200, 150)
    assert view.canvas(picture()).shape == (300, 400, 3)
    np.testing.assert_allclose(view.places([[440 - 0.5, 165 - 0.5]]), [[-0.5, -0.5]])
    np.testing.assert_allclose(view.places([[639.5, 314.5]]), [[399.5, 299.5]])


@pytest.mark.parametrize("end", [(638, 100), (638, 2), (300, 478), (2, 2), (700, 240)])
def test_names_are_in_the_picture_and_not_upon_each_other(end):
    view = drawing.View.whole(picture())
    tips = np.array(end) + np.array([[0, 0], [3, 4], [-5, 9], [1, -6]])
    lines = {
        f"whisker{k}": np.linspace((320, 240), tip, 100)
        for k, tip in enumerate(tips.astype(float))
    }
    boxes = drawing.name_boxes(lines, view)
    assert set(boxes) == set(lines)
    for x, y, width, height in boxes.values():
        assert x >= 0
        assert y >= 0
        assert x + width <= 640
        assert y + height <= 480
    for (ax, ay, aw, ah), (bx, by, bw, bh) in itertools.combinations(boxes.values(), 2):
        assert ax + aw <= bx or bx + bw <= ax or ay + ah <= by or by + bh <= ay


def test_a_line_in_doubt_is_dashed(tmp_path):
    results = make_results(tmp_path / "results")
    line = {"C2": np.column_stack([np.arange(75.0, 475), np.full(400, 250.0)])}
    gaps = []
    for confidence in (0.9, 0.2):
        table = rows(results, 10).assign(confidence=confidence)
        canvas = drawing.draw(picture(), line, table, None, SETTINGS)
        gaps.append((canvas[250, 80:470] == 200).all(axis=1).sum())
    assert gaps[0] == 0
    assert gaps[1] > 100


def test_a_line_that_is_no_whiskers_has_a_question_mark_and_no_state(tmp_path, monkeypatch):
    results, written = make_results(tmp_path / "results"), []
    path = results / "one" / "frames.parquet"
    frames = files.read_frames(path)
    tables = [frames.assign(whisker="w1"), frames.assign(whisker="w2", confidence=0.4)]
    for table in tables:
        table["in_contact"] = False
    files.write_frames(path, pd.concat(tables).sort_values("frame", kind="stable"))
    monkeypatch.setattr(drawing, "put_text", lambda canvas, text, *_: written.append(text))
    lines = {name: np.column_stack([np.arange(75.0, 475), np.full(400, y)])
             for name, y in (("w1", 250.0), ("w2", 150.0))}  # fmt: skip
    unnamed = overlay._unnamed(results / "one")
    drawing.draw(picture(), lines, rows(results, 10), None, SETTINGS, unnamed=unnamed)
    assert {"w1", "?", "w1 free"} <= set(written)
    assert not any("w2" in text for text in written)


@pytest.mark.parametrize("sight", ["normal", "protan", "deutan"])
def test_colours_differ_for_people_who_cannot_distinguish_red_from_green(sight):
    colours = {"free": drawing.FREE, "touching": drawing.TOUCHING, "pole": drawing.POLE}
    for (a, one), (b, other) in itertools.combinations(colours.items(), 2):
        assert difference(one[::-1], other[::-1], sight) > APART, (a, b)


@pytest.mark.parametrize("value", [0.031, 0.7, 3.0, 49.9, 50.0])
def test_scales_are_round_and_fit(value):
    found = drawing._round_below(value)
    assert value / 2.5 < found <= value
    assert f"{found:.0e}"[0] in "125"


def test_words_are_as_wide_as_said_and_cut_at_the_edge_only():
    canvas = np.zeros((40, 200, 3), np.uint8)
    lettering.put_text(canvas, "C2 12.3 µN", (10, 5), (255, 255, 255), 16)
    columns = np.flatnonzero(canvas.any(axis=(0, 2)))
    assert columns[0] >= 10
    assert columns[-1] <= 10 + lettering.text_width("C2 12.3 µN", 16)
    lettering.put_text(canvas, "edge", (190, 35), (255, 255, 255), 16, (9, 9, 9))
    lettering.put_text(canvas, "edge", (-20, -10), (255, 255, 255), 16)
    assert canvas.shape == (40, 200, 3)
