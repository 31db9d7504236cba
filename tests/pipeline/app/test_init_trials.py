"""What `init` makes of trials that differ as a session's do: it finds what `run` finds in them."""

from contextlib import ExitStack

import numpy as np
import pytest
import tifffile
from row_trials import CAMERA, NAMES, SCALE, frames_of, pole_px, row_motion, whisker_under

from pipeline import analyse
from pipeline.app.init import init_folder, look_at
from pipeline.app.preview import preview_of
from pipeline.session.session_file import read_session

pytestmark = [pytest.mark.slow, pytest.mark.e2e]

SCALE_ERROR = 0.02  # relative
POLE_PX = 0.3
WIDTH = CAMERA.width
LENGTHS_MM = {"C3": (15.0, 32.0), "C2": (18.0, 37.0), "C1": (20.5, 41.0)}  # and base radii [µm]
TRIALS = {"trial_2": 8e-3, "trial_3": None, "trial_4": 10e-3}  # where C2 touches the pole [m]


@pytest.fixture(scope="module")
def motions():
    """Trials in which the pole is in two places, or out of the picture, by name."""
    return {name: row_motion(at, seed=k) for k, (name, at) in enumerate(TRIALS.items())}


@pytest.fixture(scope="module")
def session(motions, tmp_path_factory):
    """A folder of these, and the lines that `init` prints about it.

    The face is at the right; the first trial is black, and the last one shows no whiskers.
    """
    folder = tmp_path_factory.mktemp("session")
    for name, motion in motions.items():
        tifffile.imwrite(folder / f"{name}.tif", frames_of(motion, mirrored=True))
    frames = frames_of(motions["trial_3"], mirrored=True)
    tifffile.imwrite(folder / "trial_1.tif", np.full_like(frames, 4))
    tifffile.imwrite(folder / "trial_5.tif", np.repeat(frames.max(axis=0)[None], 30, axis=0))
    return folder, init_folder(folder)


def test_trials_without_whiskers_tell_nothing_of_the_face(session):
    folder, said = session
    settings = read_session(folder / "session.toml")
    assert settings.recording.face == "right"
    assert len(settings.whisker) == len(NAMES)
    assert not [line for line in said if "not alike" in line]


def test_the_scale_is_from_trials_with_a_pole(session):
    settings = read_session(session[0] / "session.toml")
    assert settings.recording.pixels_per_mm == pytest.approx(SCALE, rel=SCALE_ERROR)
    assert settings.pole.position_px is None  # it is elsewhere in other trials


def test_a_trial_with_a_pole_is_in_the_picture_and_what_others_show_is_said(session, motions):
    looked, found, others, *_ = session[1]
    assert looked.endswith("; trial_2.tif is in the picture")
    places = {name: pole_px(motions[name]) for name in ("trial_2", "trial_4")}
    shown, other = (f"a pole at ({WIDTH - 1 - x:.0f}, {y:.0f})" for x, y in places.values())
    assert f"face at the right, {shown}, 3 whiskers" in found
    assert "trial_1.tif: no pole, 0 whiskers; trial_3.tif: no pole, 3 whiskers" in others
    assert f"trial_4.tif: {other}, 3 whiskers" in others


@pytest.mark.parametrize("name", TRIALS)
def test_whiskers_have_the_names_in_the_picture_that_they_have_in_the_results(
    session, motions, name
):
    folder, motion = session[0], motions[name]
    found = read_session(folder / "session.toml")
    measured = []
    for each, (whisker, (length, radius)) in zip(found.whisker, LENGTHS_MM.items(), strict=True):
        own = {"name": whisker, "length_mm": length, "base_radius_um": radius}
        measured.append(each.model_copy(update={**own, "cone_length_mm": length / 0.95}))
    settings = found.model_copy(update={"whisker": tuple(measured)})
    frames = tifffile.imread(folder / f"{name}.tif")
    preview = preview_of(folder / f"{name}.tif", settings)
    (k,) = np.flatnonzero((frames == preview.frame).all(axis=(1, 2)))
    seen = analyse(folder / f"{name}.tif", settings)
    lines = {w: xy for each in seen.lines for frame, w, xy in each.each() if frame == k}
    assert {*preview.lines} == {*lines} == {*NAMES}
    for drawn in (preview.lines, lines):
        mirrored = {
            w: np.column_stack([WIDTH - 1 - xy[:, 0], xy[:, 1]]) for w, xy in drawn.items()
        }
        assert {w: whisker_under(motion, k, xy) for w, xy in mirrored.items()} == {
            w: w for w in NAMES
        }
    assert (preview.scene.pole is None) == (seen.pole is None) == (TRIALS[name] is None)


def test_a_pole_that_stands_there_for_part_of_a_trial_is_found_and_drawn(tmp_path):
    away, there = (row_motion(at, frames=200) for at in (None, 8e-3))
    frames = np.concatenate([frames_of(away)[:120], frames_of(there)[120:]])
    tifffile.imwrite(tmp_path / "trial.tif", frames)
    with ExitStack() as opened:
        look = look_at(tmp_path / "trial.tif", opened)
    assert look.pixels_per_mm == pytest.approx(SCALE, rel=SCALE_ERROR)
    said = init_folder(tmp_path)
    x, y = pole_px(there)
    np.testing.assert_allclose(look.pole[:2], (x, y), atol=POLE_PX)
    assert f"a pole at ({x:.0f}, {y:.0f}), 3 whiskers" in said[1]
