"""How far a whisker's tip is beyond the end of its trace, from how the line fades there.

The absorbance at each node of a line is a mean over WINDOW_NODES nodes (`detection/line_fit.py`).
So a line that ends abruptly seems to fade, and has about half of its thickness (END_SHARE) where
it really ends. The trace stops where the line drowns in noise: before that point in a noisy
picture, beyond it in a clean one. From the thickness at the end of the trace, as a share of that
farther in, follows how far on the real end is.
"""

import numpy as np

from pipeline.tables.centrelines import Centrelines

WINDOW_NODES = 15
END_SHARE = 0.57  # of the thickness, at the real end of rendered lines without noise
FITTED_NODES = 22, 70  # from the end inwards: where the taper is measured
SHARES = END_SHARE, 2.0  # limits: no trace ends beyond the tip; twice the thickness is an error


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
