"""The table of tips: how far the true tip is beyond a trace, and where it is found."""

import numpy as np
import pandas as pd
import pytest
import tips


def test_a_tip_is_beyond_the_end_along_the_line_and_not_beside_it():
    true = np.column_stack([np.arange(50.0), np.zeros(50)])
    assert tips.beyond_px(np.array([46.0, 0.5]), true) == pytest.approx(3.0)
    assert tips.beyond_px(np.array([51.0, 0.0]), true) == pytest.approx(-2.0)
    turned = true[:, ::-1]
    assert tips.beyond_px(np.array([0.5, 46.0]), turned) == pytest.approx(3.0)


@pytest.mark.e2e
@pytest.mark.usefixtures("lossless_is_quick")
def test_a_rendered_whisker_has_a_row(tmp_path, capsys):
    table = tmp_path / "tips.csv"
    seen = ["--preset", "noisy", "--videos", "1", "--frames", "100", "--seed", "3"]
    assert tips.main([*seen, "--write", str(table)]) == 0
    (tip,) = pd.read_csv(table).itertuples()
    assert tip.whisker == "C2"
    assert 90 < tip.frames <= 100
    assert 0.3 < tip.tip_px < 5
    assert abs(tip.found_px - tip.tip_px) < 3 * tip.se_px < 3  # px
    assert "seed 3" in capsys.readouterr().out
