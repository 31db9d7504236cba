"""Figures of crowded faces: names, exchanges, false lines, errors of the base angle."""

import accuracy_crowds
import numpy as np
import pandas as pd
import pytest
from accuracy_crowds import ALONE, GIVEN, Crowd, bare_settings, crowds_text, samples_of
from measuring import line_table

from pipeline.session.session_file import settings_from
from pipeline.tables.centrelines import Centrelines
from synthetic.presets import PRESETS
from synthetic.scoring.line_scoring import LineScores


def lines(*rows):
    """A crowd's lines of (frame, whisker, nearest, confidence, angle error), SE 1 degree."""
    columns = ["frame", "whisker", "nearest", "confidence", "angle_error_deg"]
    return pd.DataFrame(rows, columns=columns).assign(base_angle_se_deg=1.0)


def crowd(table, covered=(1.0,), frames=4):
    whiskers = pd.DataFrame({"visible_px": 50.0, "covered": covered})
    return Crowd(table, whiskers, np.array([0.3, -0.4]), frames)


def test_an_exchange_is_counted_twice_back_and_forth_and_wrong_once():
    names = [(k, "w1", "C1" if k != 2 else "C2", 0.9, 1.0) for k in range(4)]
    names += [(k, "w2", "C2" if k != 2 else "C1", 0.9, -3.0) for k in range(4)]
    found = samples_of(crowd(lines(*names)))
    assert found["wrong"].sum() == 2  # both names in frame 2
    assert len(found["exchanges"]) == 6
    assert found["exchanges"].sum() == 4  # there and back, both
    assert sorted(set(found["angle"])) == [1.0, 3.0]
    assert found["angle_covered"].mean() == 0.5  # 3 degrees are more than 1.96 standard errors


def test_a_name_stands_for_one_whisker_alone():
    # two names on one whisker: the second stands for none that it was seen on
    names = [(k, "w1", "C1", 0.9, 0.0) for k in range(3)] + [(3, "w2", "C1", 0.9, 0.0)]
    assert samples_of(crowd(lines(*names)))["wrong"].tolist() == [0, 0, 0, 1]


def test_doubtful_and_false_lines_are_told_apart():
    table = lines(
        (0, "w1", "C1", 0.9, 0.0),
        (1, "w1", "C1", 0.2, 50.0),
        (1, "w3", "", 0.9, np.nan),
        (2, "w3", "", 0.1, np.nan),
    )
    found = samples_of(crowd(table, (1.0, 0.59, 0.6)))
    assert found["found"].tolist() == [1, 0, 1]
    assert found["false"].tolist() == [0, 1, 1, 0]
    assert found["false_known"].tolist() == [0, 1, 0, 0]
    assert found["known"].tolist() == [1, 0]
    assert found["angle"].tolist() == [0.0]


def test_a_video_without_a_known_line_has_figures_too():
    text = crowds_text(
        {
            "rat_both_sides": [
                {GIVEN: samples_of(crowd(lines())), ALONE: samples_of(crowd(lines()))}
            ]
        }
    )
    assert "| rat_both_sides | face and scale | 1 " in text
    assert "0.354" in text  # px, RMS of 0.3 and 0.4
    assert crowds_text({"noisy": [{}]}) == ""


def test_angle_errors_are_of_the_whisker_that_a_line_lies_on():
    angles = {"frame": [0, 0], "base_angle_deg": [179.0, 10.0], "base_angle_se_deg": [0.5, 0.6]}
    frames = pd.DataFrame(angles | {"whisker": ["w1", "w2"]})
    true = pd.DataFrame({"frame": [0], "whisker": ["C1"], "base_angle_deg": [-179.0]})
    rows = pd.DataFrame({"frame": [0, 0], "whisker": ["w1", "w2"], "nearest": ["C1", ""]})
    scores = LineScores(rows, pd.DataFrame(), np.empty(0), np.empty(0))
    one = np.zeros(2, np.float32)
    traced = Centrelines(
        ("w1", "w2"), one.astype(int), np.array([0, 1]), np.arange(3), one, one, one, one + 0.5
    )
    table = line_table(scores, traced, frames, true)
    assert table["angle_error_deg"].iloc[0] == pytest.approx(-2.0)
    assert np.isnan(table["angle_error_deg"].iloc[1])
    assert table["confidence"].tolist() == [0.5, 0.5]
    assert table["base_angle_se_deg"].tolist() == [0.5, 0.6]


def test_bare_settings_keep_camera_and_face_alone():
    recording = {"frames_per_second": 500, "pixels_per_mm": 12, "face": "top"}
    whisker = {"name": "C1", "length_mm": 20, "base_radius_um": 40}
    bare = bare_settings(settings_from({"recording": recording, "whisker": [whisker]}))
    assert bare.recording.face == "top"
    assert bare.recording.pixels_per_mm == 12
    assert bare.whisker == ()


def test_crowds_are_presets():
    assert set(accuracy_crowds.CROWDS) <= set(PRESETS)
