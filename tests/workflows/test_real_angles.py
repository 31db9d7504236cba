"""What is said of base angles on real recordings, on tables whose answer is known."""

import numpy as np
import pandas as pd
import pytest
import real_angles

from pipeline.tables import Centrelines

FRAMES = 4000
ANGLES = "base_angle_deg", "visible_angle_deg", "slope_deg"


def frames_table(rng, sd, se, whisker="C1"):
    """A resting whisker of which base angles err by `sd` degrees, with standard error `se`."""
    angle = 175 + rng.normal(0, sd, FRAMES)
    return pd.DataFrame(
        {
            "frame": np.arange(FRAMES),
            "whisker": whisker,
            "tracked": True,
            "confidence": 1.0,
            "base_angle_deg": angle,
            "base_angle_se_deg": se,
            "visible_angle_deg": 175 + rng.normal(0, 0.1, FRAMES),
            "slope_deg": (175 + rng.normal(0, 3, FRAMES) + 180) % 360 - 180,
        }
    )


def test_jitter_and_coverage_of_a_resting_whisker():
    figures = real_angles.angle_figures(frames_table(np.random.default_rng(0), 0.5, 0.5))
    assert figures["one_frame"] == pytest.approx(0.5, rel=0.05)
    assert figures["base"] == pytest.approx(0.5 * np.sqrt(6) / 1.4826, rel=0.05)
    assert figures["slope"] == pytest.approx(3 * np.sqrt(6) / 1.4826, rel=0.05)  # no wraps
    assert figures["resting"] == pytest.approx(0.95, abs=0.015)
    too_small = real_angles.angle_figures(frames_table(np.random.default_rng(0), 0.5, 0.2))
    assert too_small["resting"] < 0.7


def test_a_whisk_is_jitter_but_no_error_of_one_frame():
    """10 Hz by 20° in 500 frames/s: second differences of 0.3°, fourth ones of 0.005°."""
    frames = frames_table(np.random.default_rng(3), 0.05, 0.05)
    whisk = 20 * np.sin(2 * np.pi * 10 / 500 * frames["frame"])
    moving = frames.assign(**{name: frames[name] + whisk for name in ANGLES})
    figures = real_angles.angle_figures(moving)
    assert figures["base"] > 0.15
    assert figures["one_frame"] == pytest.approx(0.05, rel=0.05)
    gaps = moving[moving["frame"] % 5 > 0]  # no five frames follow each other
    assert np.isnan(real_angles.angle_figures(gaps)["one_frame"])


def test_steps_are_counted_and_those_of_the_centreline_apart():
    frames = frames_table(np.random.default_rng(1), 0.1, 0.1).assign(slope_deg=0.0)
    frames.loc[1000:, "base_angle_deg"] += 30.0
    frames.loc[2000:, ["base_angle_deg", "slope_deg"]] += 30.0
    figures = real_angles.angle_figures(frames)
    assert figures["steps"] == pytest.approx(2e3 / (FRAMES - 1))
    assert figures["smooth"] == pytest.approx(1e3 / (FRAMES - 1))


def test_steps_of_the_base_alone_are_those_with_which_the_visible_part_does_not_turn():
    frames = frames_table(np.random.default_rng(4), 0.1, 0.1).assign(slope_deg=0.0)
    for first, visible in (1000, 0.0), (2000, 12.0), (3000, -30.0):
        frames.loc[first:, "base_angle_deg"] += 20.0
        frames.loc[first:, "visible_angle_deg"] += visible
    unseen = frames.assign(visible_angle_deg=np.nan)
    assert real_angles.angle_figures(frames)["alone"] == pytest.approx(2e3 / (FRAMES - 1))
    assert real_angles.angle_figures(unseen)["alone"] == pytest.approx(3e3 / (FRAMES - 1))


def test_unknown_names_do_not_count():
    rng = np.random.default_rng(2)
    unknown = frames_table(rng, 20.0, 0.1, "C2").assign(confidence=0.3)
    both = pd.concat([frames_table(rng, 0.5, 0.5), unknown])
    assert real_angles.angle_figures(both)["one_frame"] == pytest.approx(0.5, rel=0.05)


def test_slopes_are_those_of_the_first_points():
    along = np.arange(60.0)
    x = np.where(along < real_angles.SLOPE_PX, along, 100.0)  # what comes after does not count
    tilted = np.array([0, 100])
    lines = Centrelines(
        names=("w1", "w2"),
        frame=np.array([3, 4]),
        whisker=np.array([1, 0]),
        offsets=np.array([0, 60, 80]),
        x_px=np.concatenate([x, np.linspace(*tilted, 20)]),
        y_px=np.concatenate([-x * np.tan(np.radians(30)), np.linspace(*tilted, 20)]),
        se_px=np.zeros(80),
        confidence=np.ones(2),
    )
    slopes = real_angles.first_slopes(lines)
    assert slopes["whisker"].tolist() == ["w2", "w1"]
    assert slopes["slope_deg"][0] == pytest.approx(30.0)  # up on the screen
    assert np.isnan(slopes["slope_deg"][1])  # of 20 points only


def test_a_video_without_a_known_line_has_no_figures():
    frames = frames_table(np.random.default_rng(0), 0.2, 0.2).assign(confidence=0.1)
    figures = real_angles.angle_figures(frames)
    assert figures.pop("frames") == 0
    assert all(np.isnan(value) for value in figures.values())
