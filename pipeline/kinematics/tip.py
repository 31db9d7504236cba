"""How far a whisker's tip is beyond the end of its trace, from how the line fades there.

A node of a line is seen by the absorbance of the nodes around it (`detection/line_fit.py`
averages it over WINDOW_NODES). So a line that ends abruptly seems to fade, to some half where it
ends. Its trace ends where what is seen drowns in noise: earlier in a noisy picture, later in a
clean one. The thickness there, as a part of what the line has farther in, says how far on the
half lies.
"""

import numpy as np

from pipeline.tables.centrelines import Centrelines

WINDOW_NODES = 15
END_SHARE = 0.57  # of the thickness, left where a line ends: of rendered ones without noise
FITTED_NODES = 22, 70  # from the end inwards: where the taper is measured
SHARES = END_SHARE, 2.0  # of what the line has farther in: no end is beyond the tip; or wild


def nodes_to_tip(lines: Centrelines) -> np.ndarray:
    """Nodes from the end of each row's trace to its tip, (rows,); NaN where it is not known."""
    out = np.full(len(lines), np.nan)
    first, last = FITTED_NODES
    if lines.thickness_px is None:
        return out
    rows = np.flatnonzero(np.diff(lines.offsets) > 2 * last)
    inwards = np.arange(first, last)
    thick = lines.thickness_px[lines.offsets[rows + 1][:, None] - 1 - inwards].astype(float)
    # a straight line's value at the end, by least squares
    weight = np.linalg.pinv(np.vander(inwards, 2, increasing=True).astype(float))[0]
    share = lines.thickness_px[lines.offsets[rows + 1] - 1] / (thick @ weight)
    out[rows] = WINDOW_NODES * (np.clip(share, *SHARES) - END_SHARE)
    return out
