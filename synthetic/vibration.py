"""True vibration: what the dynamic model makes of the true force of a contact.

The force between frames is the smooth curve through its true values, zero half a frame before
the first and after the last, as touches are made (touches.Touch). The model is the one of
`pipeline.contacts.base_moments` (fixed end, chord frame), which sees tracked forces and fitted
pulses.
"""

import numpy as np
from scipy.interpolate import CubicSpline, PchipInterpolator

from pipeline.contacts.base_moments import LARGEST_PART
from whiskermodel.response import Response

_FINE_STEPS = 20  # per frame
_SUBSTEPS = 2  # results per fine step
COLUMNS = ("steady_peak_nN_m", "vibration_max_nN_m", "vibration_min_nN_m", "vibration_ratio")


def true_moments(response: Response, place, force, frame_s, upwards, slip=False) -> dict:
    """Steady peak and extremes of the vibrational base moment, COLUMNS of contacts.csv.

    Parameters
    ----------
    response : Response of the whisker
    place : arc length of the contact at its peak [m]
    force : (frames,) true contact force [N]
    frame_s : time between frames [s]
    upwards : the load bends the whisker counter-clockwise: moments are positive
    slip : the contact ends by slipping; no smooth curve passes through the force's fall

    Returns
    -------
    dict of COLUMNS; NaN beyond the part of the whisker that the model takes
    """
    if not 0 < place < LARGEST_PART * response.whisker.length:
        return dict.fromkeys(COLUMNS, np.nan)
    fine = _between_frames(force, response.longest_period / frame_s, slip)
    loads = response.base_loads(place, fine, frame_s / _FINE_STEPS, substeps=_SUBSTEPS)
    sign = -1e9 if upwards else 1e9  # the model's moment is −c F
    steady = sign * loads.steady_moment
    vibration = sign * loads.vibrational_moment
    peak = steady[np.argmax(np.abs(steady))]
    largest = np.abs(vibration).max() / abs(peak)
    return dict(zip(COLUMNS, (peak, vibration.max(), vibration.min(), largest), strict=True))


def _between_frames(force, quiet, slip):
    """Force [N] in steps of 1/_FINE_STEPS frame, with `quiet` frames after the contact."""
    n = len(force)
    nodes = np.concatenate([[-0.5], np.arange(n), [n - 0.5]])
    curve = (PchipInterpolator if slip else CubicSpline)(nodes, np.pad(force, 1))
    time = np.arange(-1, n + quiet, 1 / _FINE_STEPS)
    inside = (time > -0.5) & (time < n - 0.5)
    return np.where(inside, np.maximum(curve(np.clip(time, -0.5, n - 0.5)), 0.0), 0.0)
