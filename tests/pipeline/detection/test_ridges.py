"""Ridge points, linking and joining on drawn lines."""

import numpy as np

from pipeline.detection import ridges
from pipeline.detection.curves import Curves, join


def absorbance_of(curve, shape=(120, 160), sigma=1.1, amplitude=0.4):
    """Image of a Gaussian line along densely sampled points (x, y)."""
    rows, columns = np.mgrid[: shape[0], : shape[1]]
    d2 = np.full(shape, 1e9)
    for x, y in curve:
        d2 = np.minimum(d2, (columns - x) ** 2 + (rows - y) ** 2)
    return (amplitude * np.exp(-d2 / (2 * sigma**2))).astype(np.float32)


def arc(n=400):
    t = np.linspace(0, 1, n)
    return np.column_stack([10 + 130 * t, 90 - 60 * t + 25 * t**2])


def find(image, noise=0.02):
    index, points = ridges.ridge_points(image, np.full(image.shape, noise, np.float32))
    return ridges.link(index, points).each()


def joined(curves, **gaps):
    return join(Curves.of(curves), **gaps).each()


def test_curve_is_found_once_and_on_the_spot():
    curves = find(absorbance_of(arc()))
    assert len(curves) == 1
    truth = arc(20000)
    distance = np.sqrt(((curves[0][:, None] - truth[None, ::10]) ** 2).sum(-1).min(1))
    assert np.sqrt((distance[5:-5] ** 2).mean()) < 0.05  # px
    assert len(curves[0]) > 110


def test_a_curve_in_a_part_of_the_picture_lies_where_it_is_in_the_whole():
    image, noise = absorbance_of(arc()), np.full((120, 160), 0.02, np.float32)
    (found,) = ridges.curves_in(np.s_[55:200, 30:100], image, noise, ridges.SCALE_PX).each()
    assert np.ptp(found[:, 0]) > 60  # px, of the 69 in that part
    distance = np.sqrt(((found[:, None] - arc(20000)[::10]) ** 2).sum(-1).min(1))
    assert np.sqrt((distance[5:-5] ** 2).mean()) < 0.05  # px


def test_nothing_is_found_in_noise():
    rng = np.random.default_rng(1)
    image = rng.normal(0, 0.02, (120, 160)).astype(np.float32)
    assert all(len(c) < 20 for c in find(image))


def test_crossing_lines_stay_two():
    t = np.linspace(0, 1, 400)
    a = np.column_stack([10 + 140 * t, 20 + 80 * t])
    b = np.column_stack([10 + 140 * t, 100 - 80 * t])
    image = np.maximum(absorbance_of(a), absorbance_of(b))
    curves = sorted(joined(find(image)), key=len)[-2:]
    for curve in curves:
        end_to_end = curve[-1] - curve[0]
        assert abs(end_to_end[0]) > 110  # px: right across
        slope = end_to_end[1] / end_to_end[0]
        assert abs(abs(slope) - 80 / 140) < 0.05


def test_gap_is_joined_but_not_to_a_line_beside():
    curve = arc()
    image = absorbance_of(curve)
    image[:, 70:90] = 0
    pieces = find(image)
    assert len(pieces) == 2
    assert len(joined(pieces)) == 1
    shifted = [pieces[0], pieces[1] + [0, 25]]
    assert len(joined(shifted)) == 2
