"""The follicle: anchored on frames from the whole video, wherever the fur's edge is crossed."""

import numpy as np
import pytest

from pipeline.kinematics.follicle import FollicleFinder, follicles
from pipeline.session.parameters import DEFAULTS, KinematicsParams
from pipeline.tables.centrelines import Centrelines

PX_PER_M = 25e3
HIDDEN = 35.0  # px: 1.4 mm
N_NODES = 300
LENGTH_ERROR = 0.05  # px, of the hidden length
PLACE_ERROR = 0.05  # px


def lines_from(angles, first):
    """Arcs through the follicle at (0, 0), `first` px of arc hidden, of base angle `angles`."""
    s = np.arange(N_NODES)[None, :] + np.asarray(first)[:, None]
    bend = 4e-4  # 1/px
    turned = np.asarray(angles)[:, None] + bend * s
    start = np.asarray(angles)[:, None]
    x, y = (np.sin(turned) - np.sin(start)) / bend, (np.cos(turned) - np.cos(start)) / bend
    rows = len(angles)
    return Centrelines(
        names=("C2",),
        frame=np.arange(rows, dtype=np.int32),
        whisker=np.zeros(rows, np.int32),
        offsets=np.arange(rows + 1, dtype=np.int64) * N_NODES,
        x_px=x.ravel().astype(np.float32),
        y_px=y.ravel().astype(np.float32),
        se_px=np.full(x.size, 0.05, np.float32),
        confidence=np.ones(rows, np.float32),
        offset_px=np.zeros(x.size, np.float32),
        information=np.full(x.size, 400.0, np.float32),
        thickness_px=np.full(x.size, 2.0, np.float32),
    )


@pytest.fixture
def finder():
    """Anchored on whiskers at all angles that are hidden as session.toml says."""
    angles = np.linspace(-0.4, 0.4, 15)
    return FollicleFinder(
        lines_from(angles, np.full(15, HIDDEN)), [HIDDEN], PX_PER_M, DEFAULTS.kinematics
    )


def test_the_fur_s_edge_may_be_crossed_elsewhere_in_every_frame(finder):
    hidden = HIDDEN + np.array([-8.0, -3.0, 0.0, 5.0, 12.0])
    found = finder.place(lines_from(np.linspace(-0.3, 0.3, 5), hidden))
    np.testing.assert_allclose(found.hidden_px, hidden, atol=LENGTH_ERROR)
    places = follicles(found, found.hidden_px, PX_PER_M, DEFAULTS.kinematics)[:, :2]
    np.testing.assert_allclose(places, 0.0, atol=PLACE_ERROR)


def test_the_follicle_is_not_deeper_than_the_thickest_fur(finder):
    finder.params = KinematicsParams(hidden_most_mm=1.0)
    found = finder.place(lines_from([0.1], [HIDDEN]))
    assert found.hidden_px[0] == pytest.approx(25.0)


def test_a_row_too_short_to_decide_keeps_the_session_s_length(finder):
    line = lines_from([0.1], [HIDDEN])
    short = Centrelines(
        **{
            name: value[:8] if name.endswith("_px") or name == "information" else value
            for name, value in vars(line).items()
            if name not in ("offsets", "end_px", "hidden_px")
        },
        offsets=np.array([0, 8]),
    )
    assert finder.place(short).hidden_px[0] == HIDDEN
