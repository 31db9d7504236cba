"""Results for MATLAB, by the names of the Hires lab's WhiskerTrialLite.

As there, time courses are cell arrays with a row vector per whisker, of the frames in which it was
tracked. thetaAtBase is 0° where the whisker stands perpendicular to the picture's side with the
face and grows with protraction; curvatures (1/mm), moment (N m) and lateral force (N) have the
sign that goes with it.
"""

from pathlib import Path

import numpy as np
from scipy.io import savemat

from pipeline.convert.results import trial_number
from pipeline.errors import InputError
from pipeline.tables.columns import CONTACT_COLUMNS
from pipeline.tables.whole_files import whole_file

# name there: column here, its factor, signed as the angle is
COURSES = {
    "time": ("time_s", 1.0, False),
    "follicleCoordsX": ("follicle_x_px", 1.0, False),
    "follicleCoordsY": ("follicle_y_px", 1.0, False),
    "kappa": ("curvature_per_m", 1e-3, True),
    "deltaKappa": ("curvature_change_per_m", 1e-3, True),
    "M0": ("base_moment_nN_m", 1e-9, True),
    "Fnorm": ("contact_force_uN", 1e-6, False),
    "Faxial": ("axial_force_uN", 1e-6, False),
    "Flateral": ("lateral_force_uN", 1e-6, True),
}
# protraction that turns the whisker counter-clockwise on the screen, and the other one; and the
# direction of a whisker that stands perpendicular to the face [°]
PROTRACTIONS = {
    "left": ("upward", "downward", 0.0),
    "right": ("downward", "upward", 180.0),
    "top": ("rightward", "leftward", -90.0),
    "bottom": ("leftward", "rightward", 90.0),
}


def write_matlab(folder, video, protraction: str = "") -> list[Path]:
    """Write NAME_WL.mat with a struct `w`; return its path in a list.

    Parameters
    ----------
    folder : where to
    video : `VideoResults`
    protraction : "upward", "downward", "leftward" or "rightward"; empty: counter-clockwise

    Raises
    ------
    InputError
        Where whiskers at that side of the face cannot protract so.
    """
    path = Path(folder) / f"{video.name}_WL.mat"
    sign, protraction, perpendicular = _direction(video.settings.recording.face, protraction)
    tracked = [table[table["tracked"]] for table in map(video.of, video.whiskers)]
    courses = {
        name: _cells(factor * (sign if signed else 1) * t[column].to_numpy(float) for t in tracked)
        for name, (column, factor, signed) in COURSES.items()
    }
    angles = (t["base_angle_deg"].to_numpy(float) - perpendicular for t in tracked)
    struct = {
        **_about(video),
        **courses,
        "protractionDirection": protraction,
        "thetaAtBase": _cells(sign * ((a + 180) % 360 - 180) for a in angles),
        "distanceToPoleCenter": _cells(_to_centre(t, video) for t in tracked),
        "contactInds": _cells(1.0 + np.flatnonzero(t["in_contact"]) for t in tracked),
        "contacts": {c.name: _column(video.contacts, c) for c in CONTACT_COLUMNS},
        "centrelines": _centrelines(video.lines()),
        **_bar(video),
    }
    with whole_file(path) as temporary, open(temporary, "wb") as file:
        savemat(file, {"w": struct}, oned_as="row")
    return [path]


def _direction(face, protraction):
    """Sign of protraction in our angles, its name, and the angle that is 0 there."""
    turning, other, perpendicular = PROTRACTIONS[face]
    if protraction not in ("", turning, other):
        raise InputError(
            f"--protraction {protraction}: whiskers of a face at the {face} protract {turning} or "
            f"{other} in the picture; give one of these"
        )
    return (-1 if protraction == other else 1), protraction or turning, perpendicular


def _about(video):
    """What does not change in time."""
    recording, number = video.settings.recording, trial_number(video.name)
    return {
        "trialNum": np.nan if number is None else float(number),
        "trialType": np.nan,
        "useFlag": 1.0,
        "mouseName": "",
        "sessionName": "",
        "trackerFileName": video.name,
        "whiskerNames": _cells(video.whiskers),
        "trajectoryIDs": np.arange(len(video.whiskers), dtype=float),
        "framePeriodInSec": 1 / recording.frames_per_second,
        "pxPerMm": recording.pixels_per_mm,
        "faceSideInImage": recording.face,
        "rInMm": video.settings.analysis.curvature_at_mm,
    }


def _to_centre(table, video):
    """Distance of the whisker's surface to the pole's centre [mm]."""
    return table["pole_distance_mm"].to_numpy(float) + video.settings.pole.diameter_mm / 2


def _bar(video):
    """The pole: rows of frame (from 0), x, y [px], and its radius [px]."""
    pole = video.pole()
    if pole is None:
        return {"barPos": np.empty((0, 3)), "barRadius": np.empty((0, 0))}
    rows = np.column_stack([np.arange(len(pole.x_px)), pole.x_px, pole.y_px])
    return {"barPos": rows[np.isfinite(rows).all(axis=1)], "barRadius": pole.radius_px}


def _centrelines(lines):
    """A row per whisker and frame (from 0): its name, and x and y of its points [px]."""
    rows = [lines.row(i) for i in range(len(lines))]
    return {
        "frame": lines.frame.astype(float),
        "whisker": _cells(np.asarray(lines.names, object)[lines.whisker]),
        "x": _cells(row[:, 0] for row in rows),
        "y": _cells(row[:, 1] for row in rows),
    }


def _column(contacts, column):
    """A column of contacts.csv as MATLAB takes it."""
    values = contacts[column.name]
    return _cells(values.astype(str)) if column.dtype == "string" else values.to_numpy(float)


def _cells(values):
    """A cell array, 1 × n."""
    values = list(values)
    cells = np.empty((1, len(values)), object)
    for i, value in enumerate(values):
        cells[0, i] = value
    return cells
