"""What is found under noise that no eye sees, where the truth of a rendered video is known."""

import json

import numpy as np
import pytest
import real_draws

from pipeline.tables.centrelines import read_centrelines
from synthetic.session import render_session

pytestmark = pytest.mark.e2e


def test_noise_is_drawn_anew_each_time_and_is_unseen():
    frames = np.full((2, 30, 40), 100, np.uint8)
    one, other = real_draws.unseen_noise(frames, 2, seed=3)
    assert not np.array_equal(one, other)
    for noisy in (one, other):
        assert np.std(noisy.astype(float)) == pytest.approx(0.58, abs=0.05)  # with rounding
        assert noisy.mean() == pytest.approx(100, abs=0.1)


def test_figures_of_draws_are_their_mean_least_and_most():
    draws = np.array([[1.0, 0.5, 0.0, 0.6, np.nan], [0.8, 0.5, 1.0, 0.8, np.nan]])
    assert real_draws.cells(draws) == [
        "90.0% (80.0% to 100.0%)", "50.0% (50.0% to 50.0%)", "0.50 (0.00 to 1.00)",
        "70.0% (60.0% to 80.0%)", "–",
    ]  # fmt: skip


@pytest.mark.slow
@pytest.mark.usefixtures("lossless_is_quick")
def test_a_row_of_rendered_whiskers_is_found_in_both_directions(tmp_path, capsys):
    (path,) = render_session(tmp_path, "row", seed=0, trials=1, frames=24)
    truth = read_centrelines(tmp_path / "truth" / path.stem / "centrelines.parquet")
    whiskers = [
        {"kind": "clear", "xy": np.asarray(truth.row(row), float)[20::10].tolist()}
        for row in np.flatnonzero(truth.frame == 12)
    ]
    labels = tmp_path / "labels.json"
    labels.write_text(json.dumps([{"video": path.stem, "frame": 12, "whiskers": whiskers}]))
    said = ["--labels", str(labels), "--draws", "2", "--scale", "25"]
    assert real_draws.main([f"{path}:left", *said]) == 0
    rows = [line for line in capsys.readouterr().out.splitlines() if path.stem in line]
    assert len(rows) == 2
    for row in rows:
        assert "100.0% (100.0% to 100.0%)" in row  # of the clear ones
