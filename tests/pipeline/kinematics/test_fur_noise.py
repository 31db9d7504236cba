"""Fur on the first visible part: found where it is, not invented, and kept from the base."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.kinematics.follicle import follicles
from pipeline.kinematics.fur_noise import FurNoise
from pipeline.session.parameters import DEFAULTS
from pipeline.tables.centrelines import Centrelines

PX_PER_M = 25e3
SD = 0.03  # px, of a point
ROWS = 24
FUR_PX = 15.0  # of the first visible part
DRAWN = 0.5  # px at the first point
base_angle_tolerance = 0.3  # degrees, SD


def whiskers(rng, drawn=0.0, red=0):
    """Lines of linear curvature; their first points are drawn aside anew in every frame.

    `red` (px) is the length over which noise runs along the line.
    """
    n = 400
    s = np.arange(n)
    offsets, x, y = [0], [], []
    offset = []
    for _ in range(ROWS):
        theta = rng.uniform(-0.2, 0.2) + s * (2e-3 + 1e-6 * s)
        x.append(50 + np.concatenate([[0], np.cumsum(np.cos(theta[:-1]))]))
        y.append(200 - np.concatenate([[0], np.cumsum(np.sin(theta[:-1]))]))
        noise = rng.normal(0, SD, n + red)
        noise = np.convolve(noise, np.ones(red + 1) / np.sqrt(red + 1), "valid")
        offset.append(noise + drawn * rng.normal() * np.exp(-0.5 * (2 * s / FUR_PX) ** 2))
        offsets.append(offsets[-1] + n)
    total = offsets[-1]
    return Centrelines(
        names=("C2",),
        frame=np.arange(ROWS, dtype=np.int32),
        whisker=np.zeros(ROWS, np.int32),
        offsets=np.array(offsets),
        x_px=np.concatenate(x),
        y_px=np.concatenate(y),
        se_px=np.full(total, SD),
        confidence=np.ones(ROWS),
        offset_px=np.concatenate(offset),
        information=np.full(total, SD**-2),
    )


def base_angle_sd(lines, hidden=0.5e-3):
    """SD of the base angle [degrees] about that of the same whiskers without noise and fur."""
    plain = replace(lines, offset_px=np.zeros_like(lines.offset_px))
    hidden_px = np.full(ROWS, hidden * PX_PER_M)
    angles = [
        follicles(each, hidden_px, PX_PER_M, DEFAULTS.kinematics)[:, 2] for each in (lines, plain)
    ]
    return np.degrees(np.std(angles[0] - angles[1]))


@pytest.mark.parametrize("red", [0, 20])
def test_noise_is_not_taken_for_fur(red):
    """Of white noise, and of noise that runs along the line, in nine videos of ten at least."""
    found = [
        (
            FurNoise(
                whiskers(np.random.default_rng(seed), red=red), PX_PER_M, DEFAULTS.kinematics
            ).excess
            > 1
        ).any()
        for seed in range(40)
    ]
    assert np.mean(found) <= 0.1


def test_fur_is_found_where_it_is():
    lines = whiskers(np.random.default_rng(1), DRAWN)
    noise = FurNoise(lines, PX_PER_M, DEFAULTS.kinematics)
    assert noise.excess[0, 3] > 50  # 0.5 px of fur are 17 SD of a point
    assert (noise.excess[0, 25:] == 1).all()
    weighed = noise.weigh(lines).information
    np.testing.assert_allclose(weighed[400:410] * noise.excess[0, :10], SD**-2)
    np.testing.assert_allclose(weighed[440:800], SD**-2)


def test_fur_does_not_turn_the_base():
    lines = whiskers(np.random.default_rng(2), DRAWN)
    believed = base_angle_sd(lines)
    weighed = base_angle_sd(FurNoise(lines, PX_PER_M, DEFAULTS.kinematics).weigh(lines))
    assert weighed < base_angle_tolerance
    assert weighed < believed / 2


def test_short_lines_are_left_alone():
    lines = whiskers(np.random.default_rng(3), DRAWN)
    few = FurNoise(replace(lines, offsets=lines.offsets[:6], frame=lines.frame[:5],
                           whisker=lines.whisker[:5]), PX_PER_M, DEFAULTS.kinematics)  # fmt: skip
    assert (few.excess == 1).all()
    assert few.weigh(lines) is lines
