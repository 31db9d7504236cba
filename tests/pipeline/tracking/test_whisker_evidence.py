"""Whiskers are told from walls, edges and scratches that come out of something dark."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from still_scene import scene_from_frames
from usual_parameters import options_for

from pipeline.run import analyse
from pipeline.scene.epochs import Epoch
from pipeline.session.recording import Recording
from pipeline.session.session_file import settings_from
from pipeline.tracking.registry import find_templates
from pipeline.tracking.whisker_evidence import whisker_like
from pipeline.tracking.whiskers import find_whisker_set

SCALE, FRAMES = 20.0, 24  # px/mm
FACE_PX, LIGHT = 40, 200.0  # grey
ROWS, COLUMNS = np.mgrid[:240, :400].astype(float)
SHADOW_PX = 12  # on each side of a line; beyond, rounding alone is left of it
RECORDING = {"frames_per_second": 1000.0, "pixels_per_mm": SCALE, "face": "left"}


def picture(angle, near, far, length, seed):
    """A dark face at the left, and a line out of it.

    angle : of the line [rad]
    near, far : absorbance summed across it at the face and at its end [px]
    length : [px]
    """
    across = (ROWS - 120) * np.cos(angle) - (COLUMNS - 10) * np.sin(angle)
    beside = np.abs(across) < SHADOW_PX
    x, y, across = COLUMNS[beside], ROWS[beside], across[beside]
    along = (x - 10) * np.cos(angle) + (y - 120) * np.sin(angle)
    thickness = (near + (far - near) * along / length) * (along < length)
    dark = thickness / (1.2 * np.sqrt(2 * np.pi)) * np.exp(-(across**2) / (2 * 1.2**2))
    image = np.full(ROWS.shape, LIGHT)
    image[beside] = LIGHT * np.exp(-dark)
    image[:, :FACE_PX] = 10.0
    image += np.random.default_rng(seed).normal(0, 2, image.shape)
    return np.clip(np.rint(image), 0, 255).astype(np.uint8)


def frames_of(swing, near, far, length=250):
    """Frames in which a line turns by ±swing [rad]."""
    angles = swing * np.sin(np.linspace(0, 12, FRAMES))
    return np.stack([picture(angle, near, far, length, i) for i, angle in enumerate(angles)])


def told_apart(frames):
    recording = Recording(1000.0, SCALE, "left")
    scene = scene_from_frames(frames, recording, None)
    templates = find_templates(frames, scene, options_for(recording))
    assert templates, "no line is found at all"
    return whisker_like(templates, len(frames), frames.shape[1:])


@pytest.mark.parametrize(
    ("what", "swing", "near", "far", "length"),
    [
        ("a whisker that whisks", 0.1, 1.5, 0.2, 250),
        ("a whisker that rests", 0.0, 1.5, 0.2, 250),
        ("a whisker that whisks, trimmed to a third", 0.1, 1.5, 1.1, 120),
        ("a whisker that whisks, its end out of the picture", 0.1, 1.5, 0.8, 500),
        ("a whisker that rests, its end out of the picture", 0.0, 1.5, 0.2, 500),
    ],
)
def test_whiskers_are_kept(what, swing, near, far, length):
    kept, refused = told_apart(frames_of(swing, near, far, length))
    assert len(kept) == 1, what
    assert not refused, what


@pytest.mark.parametrize(
    ("what", "swing", "near", "far", "length"),
    [
        ("a wall that leans", 0.0, 0.4, 1.4, 300),
        ("a scratch", 0.0, 0.8, 0.8, 200),
        ("an edge from side to side", 0.0, 1.5, 1.0, 500),
        ("what turns about its far end", 0.1, 0.5, 1.5, 250),
    ],
)
def test_other_things_are_refused(what, swing, near, far, length):
    kept, refused = told_apart(frames_of(swing, near, far, length))
    assert not kept, what
    assert refused, what


def row_of(swing, near, far):
    """Frames of four lines, one below the other, that turn by ±swing [rad]."""
    angles = swing * np.sin(np.linspace(0, 12, FRAMES))
    return np.stack(
        [
            np.min(
                [
                    np.roll(picture(angle + tilt, near, far, 250, i), round(200 * tilt), axis=0)
                    for tilt in (-0.2, -0.07, 0.07, 0.2)
                ],
                axis=0,
            )
            for i, angle in enumerate(angles)
        ]
    )


@pytest.mark.parametrize(("far", "kept"), [((0.2, 0.2), 2), ((0.7, 1.2), 0)])
def test_two_still_lines_are_whiskers_only_if_both_taper_well(far, kept):
    """Streaks of fur and a car's edges taper by chance, one better than the other."""
    lines = [
        np.roll(frames_of(0.0, 1.5, each), down, axis=1)
        for each, down in zip(far, (-50, 50), strict=True)
    ]
    found, refused = told_apart(np.minimum(*lines))
    assert (len(found), len(refused)) == (kept, 2 - kept)


@pytest.mark.parametrize(("frames", "kept"), [(2, 0), (8, 1)])
def test_a_line_in_two_frames_may_be_another_one_each_time(frames, kept):
    seen = frames_of(0.0, 0.0, 0.0)
    seen[:frames] = frames_of(0.1, 1.5, 0.2)[: 3 * frames : 3]
    found, refused = told_apart(seen)
    assert (len(found), len(refused)) == (kept, 1 - kept)


def test_a_row_of_whiskers_is_kept_where_the_animal_rests():
    kept, refused = told_apart(row_of(0.0, 1.5, 0.2))
    assert len(kept) == 4
    assert not refused


@pytest.mark.parametrize("swing", [0.0, 0.03])
def test_a_row_of_lines_that_keep_their_thickness_is_none(swing):
    kept, refused = told_apart(row_of(swing, 1.5, 1.3))
    assert len(refused) == 4
    assert not kept


def test_what_is_seen_in_few_frames_and_always_in_one_place_is_no_whisker():
    frames = frames_of(0.0, 1.5, 0.2)
    frames[8:] = picture(0.0, 0.0, 0.0, 250, 99)
    kept, _ = told_apart(frames)
    assert not kept


def test_a_wall_gives_no_whisker_and_the_face_is_doubted():
    found = analyse(frames_of(0.0, 0.4, 1.4, 300), settings_from({"recording": RECORDING}))
    assert found.frames.empty
    assert 'write face = "right"' in found.messages[0]
    assert found.messages[0].startswith("no whiskers found")


def test_a_cable_that_sways_is_no_whisker():
    kept, refused = told_apart(frames_of(0.1, 1.5, 1.5, 250))
    assert not kept
    assert refused


@pytest.mark.parametrize(("slides_px", "is_whisker"), [(0, True), (25, False)])
def test_a_tail_that_is_dragged_is_no_whisker_though_it_tapers_and_moves(slides_px, is_whisker):
    frames = frames_of(0.0, 0.0, 0.0)
    for i, away in enumerate(np.linspace(-1, 1, FRAMES // 3)):
        slide = round(slides_px * away)  # of the base; the end stays, or else the base does
        angle = -slide / 250 if slides_px else 0.1 * away
        frames[i] = np.roll(picture(angle, 1.5, 0.2, 250, i), slide, axis=0)
    kept, refused = told_apart(frames)
    assert (len(kept), len(refused)) == ((1, 0) if is_whisker else (0, 1))


@pytest.mark.parametrize("whisks", [False, True])
@pytest.mark.parametrize("hair_whisks", [False, True])
def test_a_weak_line_apart_from_a_whisker_is_one_only_if_it_whisks(whisks, hair_whisks):
    lines = ((whisks, 1.5, 0.2, 250, -60), (hair_whisks, 1.0, 0.2, 120, 70))
    pictures = []
    for i, turn in enumerate(0.1 * np.sin(np.linspace(0, 12, FRAMES))):
        each = [
            np.roll(picture(turns * turn, near, far, length, i), down, axis=0)
            for turns, near, far, length, down in lines
        ]
        pictures.append(np.min(each, axis=0))
    kept, refused = told_apart(np.stack(pictures))
    assert (len(kept), len(refused)) == (1 + hair_whisks, 1 - hair_whisks)


def grain(n):
    """Frames of a still texture of streaks, bright and dark, and dark at the left."""
    rng = np.random.default_rng(5)
    streaks = cv2.GaussianBlur(rng.normal(size=(240, 400)), (0, 0), sigmaX=40, sigmaY=1.6)
    still = np.clip(150 + 25 * streaks / streaks.std(), 0, 255)
    still[:, :FACE_PX] = 10
    noisy = [still + rng.normal(0, 2, still.shape) for _ in range(n)]
    return np.clip(np.rint(noisy), 0, 255).astype(np.uint8)


def test_the_grain_of_a_table_is_no_row_of_whiskers():
    kept, refused = told_apart(grain(FRAMES))
    assert len(refused) > 2
    assert not kept


@pytest.mark.parametrize(
    ("drawn", "ground_px", "names", "found"),
    [
        (frames_of, 0, (), 1),  # it comes over the border
        (frames_of, 30, (), 1),
        (frames_of, 90, (), 0),
        (frames_of, 90, ("C2",), 1),
        (row_of, 90, (), 4),
    ],
)
def test_what_begins_far_inside_a_picture_without_a_face_is_believed_if_named_or_a_clear_row(
    drawn, ground_px, names, found
):
    frames = drawn(0.1, 1.5, 0.2)
    ground = np.random.default_rng(9).normal(LIGHT, 2, (*frames.shape[:2], ground_px))
    bright = np.concatenate([np.rint(ground).astype(np.uint8), frames[:, :, FACE_PX:]], axis=2)
    tables = [{"name": name} for name in names]
    said = analyse(bright, settings_from({"recording": RECORDING, "whisker": tables}))
    assert said.frames["whisker"].nunique() == found
    assert ("is nothing dark at the left" in said.messages[0]) == (found == 0)


@pytest.mark.parametrize("seen_from", [8, 20])
def test_a_face_that_is_seen_in_a_few_frames_only_is_an_unseen_one(seen_from):
    """As where something dark passes the border, however many epochs that makes."""
    frames = frames_of(0.1, 1.5, 0.2)
    frames[:, :, :FACE_PX] = LIGHT
    frames = np.roll(frames, 60, axis=2)
    settings = settings_from({"recording": RECORDING})
    unseen = scene_from_frames(frames, settings.recording.si(), None)
    assert unseen.unseen_face > 0.125
    dark = replace(unseen, face_seen=True)
    parts = [Epoch(0, seen_from, unseen), Epoch(seen_from, 22, dark), Epoch(22, None, dark)]
    found = find_whisker_set(np.arange(FRAMES), frames, parts, settings)
    assert len(found.templates) == (seen_from == 8)
    assert len(found.refused) == (seen_from == 20)
