"""MATLAB files by WhiskerTrialLite's names: units and signs of that code."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.io import loadmat

from pipeline.convert.matlab import PROTRACTIONS, write_matlab
from pipeline.convert.results import VideoResults, lines_of_rows
from pipeline.errors import InputError
from pipeline.session.session_file import settings_from
from pipeline.tables.columns import CONTACT_COLUMNS, empty_table


def read(path):
    return loadmat(path, squeeze_me=False)["w"][0, 0]


def test_courses_in_its_units(videos, tmp_path):
    (path,) = write_matlab(tmp_path, videos[0])
    w, frames = read(path), videos[0].frames
    assert path.name == "one_WL.mat"
    assert w["whiskerNames"][0, 0][0] == "C2"
    assert w["framePeriodInSec"][0, 0] == pytest.approx(1e-3)
    assert w["pxPerMm"][0, 0] == 25
    assert w["time"].shape == (1, 1)
    assert w["time"][0, 0].shape == (1, 120)
    np.testing.assert_allclose(w["time"][0, 0][0], frames["time_s"])
    np.testing.assert_allclose(w["Fnorm"][0, 0][0], 1e-6 * frames["contact_force_uN"])
    np.testing.assert_allclose(w["Faxial"][0, 0][0], 1e-6 * frames["axial_force_uN"])
    touching = np.flatnonzero(frames["in_contact"]) + 1
    np.testing.assert_array_equal(w["contactInds"][0, 0][0], touching)
    np.testing.assert_array_equal(w["barPos"][3], [3, 230, 240])
    assert w["barRadius"][0, 0] == 6.25
    lines = w["centrelines"][0, 0]
    np.testing.assert_array_equal(lines["x"][0, 7][0], videos[0].lines().row(7)[:, 0])
    assert lines["frame"][0, 7] == 7
    contacts = w["contacts"][0, 0]
    np.testing.assert_allclose(contacts["peak_force_uN"][0], videos[0].contacts["peak_force_uN"])
    assert contacts["whisker"][0, 0][0] == "C2"


@pytest.mark.parametrize(("name", "number"), [("AH0407x160609-0012", 12), ("one", np.nan)])
def test_trials_have_the_number_of_their_video(videos, tmp_path, name, number):
    (path,) = write_matlab(tmp_path, replace(videos[0], name=name))
    w = read(path)
    np.testing.assert_array_equal(w["trialNum"], [[number]])
    assert w["trackerFileName"][0] == name


@pytest.mark.parametrize("face", ["left", "right", "top", "bottom"])
@pytest.mark.parametrize("turned", [1, -1])
def test_the_angle_grows_with_protraction(tmp_path, face, turned):
    """A whisker at 10° from the perpendicular, towards where it protracts to."""
    outwards = {"left": (1, 0), "right": (-1, 0), "top": (0, 1), "bottom": (0, -1)}[face]
    towards = {"upward": (0, -1), "downward": (0, 1), "rightward": (1, 0), "leftward": (-1, 0)}
    protraction = PROTRACTIONS[face][0 if turned > 0 else 1]
    x, y = np.cos(np.radians(10)) * np.array(outwards) + np.sin(np.radians(10)) * np.array(
        towards[protraction]
    )
    video = by_hand(face, angle=np.degrees(np.arctan2(-y, x)), curvature=40.0)
    w = read(*write_matlab(tmp_path, video, protraction))
    assert w["thetaAtBase"][0, 0][0, 0] == pytest.approx(10)
    assert w["kappa"][0, 0][0, 0] == pytest.approx(turned * 0.040)
    assert w["protractionDirection"][0] == protraction
    default = read(*write_matlab(tmp_path, video))
    assert default["kappa"][0, 0][0, 0] == pytest.approx(0.040)


def by_hand(face, angle, curvature):
    """Results of one frame."""
    recording = {"frames_per_second": 1000.0, "pixels_per_mm": 25.0, "face": face}
    frames = pd.DataFrame({"frame": [0], "whisker": ["C2"], "tracked": [True]})
    columns = "time_s follicle_x_px follicle_y_px curvature_change_per_m base_moment_nN_m "
    columns += "contact_force_uN axial_force_uN lateral_force_uN pole_distance_mm"
    frames = frames.assign(**dict.fromkeys(columns.split(), 0.0), in_contact=False)
    frames = frames.assign(base_angle_deg=angle, curvature_per_m=curvature)
    video = VideoResults("a", Path("nowhere"), "a.avi")
    video.__dict__["frames"] = frames
    video.__dict__["settings"] = settings_from({"recording": recording})
    video.__dict__["lines"] = lambda: lines_of_rows(("C2",), [], [])
    video.__dict__["contacts"] = empty_table(CONTACT_COLUMNS)
    return video


def test_another_protraction_is_reported(videos, tmp_path):
    with pytest.raises(InputError, match="face at the left protract upward or downward"):
        write_matlab(tmp_path, videos[0], "leftward")
