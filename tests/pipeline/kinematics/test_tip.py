"""Where a line's tip is beyond the end of its trace, of lines whose thickness is known."""

import numpy as np
import pytest
from scipy.ndimage import uniform_filter1d

from pipeline.kinematics.tip import SHARES, WINDOW_NODES, nodes_to_tip
from pipeline.tables.centrelines import Centrelines

tolerance = 1.5  # nodes: the thickness left at a rendered tip is no exact half


def traced(nodes, short, thickness=None):
    """One line of `nodes`, whose thickness tapers, and whose trace ends `short` nodes early."""
    true = np.where(np.arange(nodes + 40) < nodes, 2 - 1.8 * np.arange(nodes + 40) / nodes, 0.0)
    seen = uniform_filter1d(true, WINDOW_NODES)[: nodes - short]
    n, f32 = len(seen), np.float32
    return Centrelines(
        names=("C2",), frame=np.zeros(1, np.int32), whisker=np.zeros(1, np.int32),
        offsets=np.array([0, n]), x_px=np.arange(n, dtype=f32), y_px=np.zeros(n, f32),
        se_px=np.ones(n, f32), confidence=np.ones(1, f32),
        thickness_px=seen.astype(f32) if thickness is None else thickness,
    )  # fmt: skip


@pytest.mark.parametrize("short", [0, 2, 5])
def test_the_tip_is_found_beyond_the_trace(short):
    assert nodes_to_tip(traced(400, short))[0] == pytest.approx(short, abs=tolerance)


def test_short_lines_and_lines_of_unknown_thickness_show_no_tip():
    assert np.isnan(nodes_to_tip(traced(120, 3)))
    unknown = traced(400, 3)
    unknown.thickness_px = None
    assert np.isnan(nodes_to_tip(unknown))


def test_a_wild_thickness_moves_the_tip_by_a_window_at_most():
    line = traced(400, 3)
    line.thickness_px[-1] = 90.0
    assert nodes_to_tip(line)[0] < SHARES[1] * WINDOW_NODES
