"""Face and body in one dark mass: whiskers that end before the body do not make it face."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from still_scene import scene_from_frames

from pipeline.scene.whisker_pad import (
    SWITCH_SHARE,
    _likeliest,
    _whiskers,
    bears_whiskers,
    face_of,
)
from pipeline.session.parameters import DEFAULTS
from pipeline.session.recording import Recording

pytestmark = pytest.mark.slow

HEIGHT, WIDTH = 240, 320
SIDES = ("top", "left", "bottom", "right")  # from one to the next by a quarter turn
CORNER = (60, 70)  # x, y [px] of the corner between body and face
SCALE = 16.0  # px/mm
SHORTEST = 20.0  # px, of a line
AT_CORNER = 12  # px, tolerance of where face and body part


def picture(phase, body=True, hidden=0.0):
    """A face along the top, a body along the left, five whiskers from one towards the other.

    Their first parts, `hidden` px from a base within the face, are not seen.
    """
    rows, columns = np.mgrid[:HEIGHT, :WIDTH]
    image = np.full((HEIGHT, WIDTH), 180.0)
    image[(rows < CORNER[1]) | (body & (columns < CORNER[0]))] = 10
    for k in range(5):
        base = 85 + 35 * k, CORNER[1] - 8
        length = 150.0
        angle = 2.2 - 0.3 * k + 0.25 * np.sin(phase + 0.2 * k)
        _draw(image, base, angle, length, hidden)
    image[columns < CORNER[0] * body] = 10  # whiskers are not seen before it
    image = cv2.GaussianBlur(image, (0, 0), 0.8)
    noise = np.random.default_rng(int(1e3 * phase)).normal(0, 1.5, image.shape)
    return np.clip(image + noise, 0, 255).astype(np.uint8)


def _draw(image, base, angle, length, hidden):
    """A whisker that gets paler towards its tip."""
    steps = np.arange(hidden, length, 10.0)
    for s in steps:
        a, b = (
            (int(16 * (base[0] + t * np.cos(angle))), int(16 * (base[1] + t * np.sin(angle))))
            for t in (s, s + 10)
        )
        line = np.zeros(image.shape, np.float32)
        cv2.line(line, a, b, 1.0, 2, cv2.LINE_AA, 4)
        image -= (0.7 - 0.55 * s / length) * np.minimum(line, 1) * image


def scene(body=True, side="top", turns=0):
    frames = np.stack([picture(phase, body) for phase in np.linspace(0, 6, 16)])
    frames = np.ascontiguousarray(np.rot90(frames, turns, axes=(1, 2)))
    return scene_from_frames(frames, Recording(1000.0, SCALE, side), None)


@pytest.mark.parametrize(("turns", "side"), list(enumerate(SIDES)))
def test_the_body_is_no_face(turns, side):
    found = scene(side=side, turns=turns)
    face, obstacle = (np.rot90(m, -turns) for m in (found.face_mask, found.obstacle_mask))
    assert face[CORNER[1] - 4, CORNER[0] + AT_CORNER : -10].all()
    assert not face[CORNER[1] + AT_CORNER :].any()
    assert obstacle[CORNER[1] + AT_CORNER :, : CORNER[0] - 4].all()


@pytest.mark.parametrize("turns", range(4))
def test_a_whisker_that_rests_on_the_body_is_not_in_the_background(turns):
    base, angle, frames = (165, CORNER[1] - 8), 2.3, []
    tip = base[0] + 180 * np.cos(angle), base[1] + 180 * np.sin(angle)
    line = np.zeros((HEIGHT, WIDTH), np.float32)
    cv2.line(line, base, tuple(map(round, tip)), 0.35, 2, cv2.LINE_AA)
    line = cv2.GaussianBlur(line, (0, 0), 0.8)
    for phase in np.linspace(0, 6, 16):
        image = picture(phase)
        image[:, CORNER[0] :] = (image * (1 - line))[:, CORNER[0] :]
        frames.append(image)
    frames = np.ascontiguousarray(np.rot90(np.stack(frames), turns, axes=(1, 2)))
    found = scene_from_frames(frames, Recording(1000.0, SCALE, SIDES[turns]), None)
    light = np.rot90(found.background, -turns)
    along = np.arange(30, 130)
    x, y = base[0] + along * np.cos(angle), base[1] + along * np.sin(angle)
    assert np.median(light[np.rint(y).astype(int), np.rint(x).astype(int)]) > 160


def test_the_side_is_where_whiskers_have_their_bases():
    assert scene(side=None).face_side == "top"  # the body darkens as much of the left border
    assert scene(side=None, turns=1).face_side == "left"


def test_one_picture_shows_the_side():
    found = scene_from_frames(picture(0.0)[None], Recording(1000.0, SCALE, None), None)
    assert found.face_side == "top"


@pytest.mark.parametrize("turns", [0, 1])
def test_whiskers_that_rest_show_the_side_and_are_no_background(turns):
    rng = np.random.default_rng(0)
    still = picture(0.0).astype(float)
    frames = np.clip(still + rng.normal(0, 1.5, (16, *still.shape)), 0, 255).astype(np.uint8)
    frames = np.ascontiguousarray(np.rot90(frames, turns, axes=(1, 2)))
    found = scene_from_frames(frames, Recording(1000.0, SCALE, None), None)
    assert found.face_side == SIDES[turns]
    background = np.rot90(found.background, -turns)
    off = np.s_[CORNER[1] + 25 : CORNER[1] + 60, CORNER[0] + 15 : 300]
    whisker = still[off] < 120
    assert whisker.sum() > 200  # px
    assert np.median(background[off][whisker]) > 170


def test_few_tips_at_the_body_show_it_beside_many_bases():
    """Most whiskers of a face never reach the body; what is seen of them makes it no face."""
    place = np.arange(130)
    score = np.where(place < 100, 60.0, -60.0)  # lengths of whiskers, along face and then body
    score[[30, 110]] *= -1  # each has one that is misjudged
    score[:100] *= 6  # and the face has many more
    assert np.array_equal(_likeliest(score, SWITCH_SHARE * np.abs(score).sum()), place < 100)
    assert np.array_equal(_likeliest(score[::-1], 60.0), place >= 30)


@pytest.mark.parametrize(("score", "is_face"), [([90.0, -30.0], True), ([-90.0, 30.0], False)])
def test_an_edge_is_of_one_kind_where_little_speaks_against_it(score, is_face):
    assert np.all(_likeliest(np.array(score), cost=60.0) == is_face)


def test_a_face_alone_stays_whole():
    found = scene(body=False)
    assert found.face_mask[: CORNER[1] - 4].all()
    assert not found.obstacle_mask.any()


def test_whiskers_whose_bases_drown_in_noise_come_out_of_the_face():
    frames = np.stack([picture(phase, False, hidden=40.0) for phase in np.linspace(0, 6, 16)])
    found = scene_from_frames(frames, Recording(1000.0, SCALE, "top"), None)
    face, beside = np.zeros((2, HEIGHT, WIDTH), bool)
    face[: CORNER[1]] = beside[CORNER[1] :, :30] = True
    assert bears_whiskers(face, frames, found, DEFAULTS.detection)
    assert not bears_whiskers(beside, frames, found, DEFAULTS.detection)


def test_lines_are_looked_for_with_the_parameters_of_session_toml():
    """Before stripes that may tremble by 5 px, few whiskers are told from them."""
    frames = np.stack([picture(phase, False) for phase in np.linspace(0, 6, 16)])
    found = scene_from_frames(frames, Recording(1000.0, SCALE, "top"), None)
    stripes = 0.6 + 0.3 * np.sin(np.arange(WIDTH))
    frames, found = frames * stripes, replace(found, background=found.background * stripes)
    seen, unseen = (
        _whiskers(frames.astype(np.uint8), found, params, SHORTEST)[:, 4].sum()
        for params in (DEFAULTS.detection, replace(DEFAULTS.detection, trembling_px=5.0))
    )
    assert unseen < 0.1 * seen


def test_apparatus_beside_the_face_is_no_face():
    frames = np.stack([picture(phase, False) for phase in np.linspace(0, 6, 16)])
    frames[:, : CORNER[1] + 10, 240:255] = 180  # light between the face and
    frames[:, : CORNER[1] + 10, 255:] = 10  # apparatus from which no whisker comes
    frames[:, CORNER[1] + 10 :, 255:] = 180
    found = scene_from_frames(frames, Recording(1000.0, SCALE, "top"), None)
    assert found.face_mask[: CORNER[1] - 4, 20:230].all()
    assert not found.face_mask[:, 250:].any()
    assert found.obstacle_mask[10 : CORNER[1], 262:].all()


def test_a_bar_from_which_no_whisker_comes_is_no_face():
    frames = np.stack([picture(phase, False) for phase in np.linspace(0, 6, 16)])
    frames = frames[:, CORNER[1] + 5 :]  # the camera sees the whiskers, not the face
    frames[:, :40, 290:310] = 10
    found = scene_from_frames(frames, Recording(1000.0, SCALE, None), None)
    assert found.face_side == "top"
    assert found.obstacle_mask[5:35, 293:307].all()
    assert not found.face_mask[10:].any()


@pytest.mark.parametrize("face", [False, True])
def test_a_rig_that_darkens_more_of_the_border_is_no_face(face):
    frames = np.stack([picture(phase, False) for phase in np.linspace(0, 6, 16)])
    frames = frames[:, CORNER[1] - 15 * face :]  # with some of the face, or without it
    frames[:, :, 285:] = 10
    frames[:, : 15 * face, 160:285] = 180
    found = scene_from_frames(frames, Recording(1000.0, SCALE, None), None)
    assert found.face_side == "top"
    assert found.obstacle_mask[30:, 290:].all()
    assert not found.face_mask[40:].any()


def test_dark_places_on_the_border_alone_have_no_edge_in_the_picture():
    mask = np.zeros((HEIGHT, WIDTH), bool)
    mask[0, :40] = mask[0, -40:] = True
    frames = np.full((16, HEIGHT, WIDTH), 180, np.uint8)
    face, side = face_of(mask, frames, None, DEFAULTS.detection)
    assert side is None
    assert np.array_equal(face, mask)
