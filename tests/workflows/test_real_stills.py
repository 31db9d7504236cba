"""Whiskers are drawn into a photograph, and what is found there is compared with the truth."""

import json

import cv2
import numpy as np
import pytest
import real_stills

from synthetic.scene import Codec

POLE = 180.3, 166.6, 9.2  # x, y, radius [px]
ROW = [[[500, 150], [330, 158], [180, 190], [70, 226]], [[500, 240], [340, 272], [180, 336]]]


@pytest.fixture(scope="module")
def photograph(tmp_path_factory):
    """A picture of a face at the right, a pole on a rod and two whiskers, and its labels."""
    fine, shape = 8, (400, 560)
    picture = np.full((shape[0] * fine, shape[1] * fine), 150, np.uint8)
    picture[:, 505 * fine :] = 0
    place = [round((v + 0.5) * fine - 0.5) for v in POLE[:2]]
    cv2.line(picture, place, (place[0] - 60 * fine, 0), 70, 12 * fine)
    picture = cv2.GaussianBlur(picture, (0, 0), 4 * fine)
    cv2.circle(picture, place, round(POLE[2] * fine), 5, -1)
    for points in ROW:
        cv2.polylines(picture, [np.array(points) * fine], False, 60, 2 * fine, cv2.LINE_AA)
    seen = cv2.resize(
        cv2.GaussianBlur(picture, (0, 0), fine), shape[::-1], None, 0, 0, cv2.INTER_AREA
    )
    noise = np.random.default_rng(1).normal(0, 1.5, shape)
    path = tmp_path_factory.mktemp("still") / "rig.png"
    cv2.imwrite(str(path), np.clip(np.rint(seen + noise), 0, 255).astype(np.uint8))
    whiskers = [{"kind": "clear", "xy": points} for points in ROW]
    about = [round(v) for v in POLE]
    return path, {
        "video": "rig", "frame": 0, "face": "right", "pole": about, "touches": 0,
        "whiskers": whiskers,
    }  # fmt: skip


def test_the_pole_is_where_it_was_drawn_and_no_whisker_is_left(photograph):
    path, label = photograph
    still = real_stills.read_still(path, [label])
    assert still.pole == pytest.approx(POLE, abs=0.3)  # px
    assert still.noise == pytest.approx(1.5, rel=0.2)  # grey levels
    for points in ROW:
        x, y = np.mean(points[:2], axis=0).astype(int)
        beside = np.median(still.light[y - 20 : y + 20, x])
        assert still.light[y - 3 : y + 4, x].min() > beside - 5


def test_contacts_and_forces_are_those_of_the_whisker_that_was_drawn(photograph, monkeypatch):
    path, label = photograph
    monkeypatch.setattr(real_stills, "FRAMES", 200)
    monkeypatch.setattr(real_stills, "TOUCHES", 4)
    still = real_stills.read_still(path, [label])
    (match,) = real_stills.matches_in(still, 3, 1, Codec())
    assert len(match.pairs) == 4
    assert len(match.missed) + len(match.invented) + len(match.surplus) == 0
    assert np.abs(match.pairs["onset_frame"] - match.pairs["true_onset_frame"]).max() <= 1
    relative, small, _ = real_stills.peak_errors(match)
    assert small.all(), relative
    row = real_stills.row_of(still, "lossless", [match, match])
    assert row[:7] == ["rig", "lossless", "2", "2", "8", "0", "0"]


def test_what_cannot_be_used_is_named(photograph, tmp_path):
    path, label = photograph
    with pytest.raises(ValueError, match=r"none\.png: no picture that can be read"):
        real_stills.read_still(tmp_path / "none.png", [label])
    with pytest.raises(ValueError, match="rig: not among the labels"):
        real_stills.read_still(path, json.loads("[]"))
