"""Figures of traced lines beside the true ones."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.tables.centrelines import Centrelines
from synthetic.scoring.line_scoring import Truth, line_figures, project, score_lines, visible_truth

projection_tolerance = 1e-4  # px, for arcs of 50 px radius and more with nodes 1 px apart
float32_tolerance = 1e-4  # px, centrelines are float32
cover_tolerance = 2.1 / 191  # a node on either side of a gap, of 191 visible ones


def centrelines(lines, names=None):
    """Centrelines from a list of (frame, name, points)."""
    names = names or tuple(dict.fromkeys(name for _, name, _ in lines))
    sizes = [len(points) for *_, points in lines]
    points = np.concatenate([p for *_, p in lines]) if lines else np.empty((0, 2))
    return Centrelines(
        names=names,
        frame=np.array([f for f, *_ in lines], np.int32),
        whisker=np.array([names.index(n) for _, n, _ in lines], np.int32),
        offsets=np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64),
        x_px=points[:, 0].astype(np.float32),
        y_px=points[:, 1].astype(np.float32),
        se_px=np.zeros(len(points), np.float32),
        confidence=np.ones(len(lines), np.float32),
    )


def straight(y, first=0.0, last=200.0, slope=0.0):
    x = np.arange(first, last + 0.5)
    return np.column_stack([x, y + slope * x])


def two_whiskers(frames=3):
    """Truth: A at y = 20, B at y = 60, both visible from x = 10 on."""
    lines = [(f, n, straight(y)) for f in range(frames) for n, y in (("A", 20), ("B", 60))]
    truth = centrelines(lines)
    return Truth(truth, truth.x_px >= 10)


@settings(deadline=None, max_examples=50)
@given(
    radius=st.floats(50, 2000),
    side=st.sampled_from([-1, 1]),
    start=st.floats(-np.pi, np.pi),
    offset=st.floats(-5, 5),
    place=st.floats(2, 37),
)
def test_projection_recovers_the_distance_from_an_arc(radius, side, start, offset, place):
    def on_arc(s, left):
        angle = start + side * s / radius
        x = side * radius * (np.sin(angle) - np.sin(start)) - left * np.sin(angle)
        y_up = side * radius * (np.cos(start) - np.cos(angle)) + left * np.cos(angle)
        return x, -y_up

    x, y = on_arc(np.arange(40.0), 0.0)
    px, py = (np.array([v]) for v in on_arc(place, offset))
    distance, node, along = np.empty(1), np.empty(1, np.int64), np.empty(1)
    project(px, py, x, y, distance, node, along)
    # the circle that replaces the line errs by a term in (offset / radius)²
    assert distance[0] == pytest.approx(offset, abs=projection_tolerance + 0.2 / radius)


def test_constant_offset_is_bias_and_rms():
    truth = two_whiskers()
    result = centrelines(
        [(f, "A", straight(19.7)) for f in range(3)]
    )  # y down: 0.3 px to the left
    figures = line_figures(score_lines(result, truth), 3)
    for name in ("bias_px", "rms_px", "median_px", "p95_px"):
        assert figures[name] == pytest.approx(0.3, abs=float32_tolerance)
    assert figures["identity_errors"] == 0
    assert figures["false_per_frame"] == 0
    assert figures["covered"] == pytest.approx(0.5)  # all of A, nothing of B
    assert figures["covered_80"] == pytest.approx(0.5)


def test_points_at_hidden_parts_count_for_nothing():
    line = straight(20)
    line[:10, 1] += 1.5  # wrong where the fur hides the whisker
    scores = score_lines(centrelines([(0, "A", line)]), two_whiskers())
    assert np.abs(scores.distance_px).max() < float32_tolerance
    assert len(scores.distance_px) == 191


def test_swapped_names_are_identity_errors():
    result = centrelines(
        [(0, "A", straight(60)), (0, "B", straight(60.1)), (1, "B", straight(60))]
    )
    figures = line_figures(score_lines(result, two_whiskers()), 3)
    assert figures["identity_errors"] == 1


def test_a_line_that_takes_the_wrong_branch_has_strayed():
    line = straight(20)
    line[150:, 1] += 0.5 * np.arange(51)
    scores = score_lines(centrelines([(0, "A", line)]), two_whiskers())
    assert line_figures(scores, 1)["strayed"] == 1
    assert scores.rows["nearest"].tolist() == ["A"]
    assert scores.rows["worst_px"][0] == pytest.approx(25, abs=0.01)


def test_hairs_and_long_false_lines_are_distinguished():
    hairs = [(f, "A", straight(100, 0, 20)) for f in range(3)]
    result = centrelines([*hairs, (1, "B", straight(120))])
    figures = line_figures(score_lines(result, two_whiskers()), 3, 100)
    assert figures["false_per_frame"] == pytest.approx(4 / 3)
    assert figures["long_false_per_frame"] == pytest.approx(1 / 3)
    assert np.isnan(figures["rms_px"])


def test_pieces_cover_together():
    parts = [(0, "A", straight(20, 0, 60)), (0, "A", straight(20, 110, 200))]
    scores = score_lines(centrelines(parts), two_whiskers(1))
    a = scores.whiskers.set_index("whisker").loc["A"]
    assert a["pieces"] == 2
    assert a["covered"] == pytest.approx((51 + 91) / 191, abs=cover_tolerance)


def test_running_beyond_the_tip_is_overrun_not_error():
    scores = score_lines(centrelines([(0, "A", straight(20, 0, 230))]), two_whiskers(1))
    assert scores.rows["overrun_px"][0] == pytest.approx(29.5, abs=0.6)
    assert scores.rows["rms_px"][0] < float32_tolerance


def test_no_lines_at_all():
    scores = score_lines(centrelines([], ("A", "B")), two_whiskers())
    figures = line_figures(scores, 3)
    assert figures["covered"] == 0
    assert figures["identity_errors"] == 0


def test_visible_is_out_of_the_fur_and_darker_than_the_noise():
    lines = centrelines([(0, "A", straight(20))])
    visibility = pd.DataFrame(
        {
            "frame": [0],
            "whisker": ["A"],
            "first_visible_mm": [2.0],
            "contrast": [np.linspace(50, 0, 201).astype(np.float32)],
        }
    )
    seen = visible_truth(lines, visibility, 10.0, 2.5).seen
    assert np.flatnonzero(seen)[[0, -1]].tolist() == [20, 189]
    with pytest.raises(ValueError, match="visibility"):
        visible_truth(lines, visibility.assign(frame=1), 10.0, 2.5)
