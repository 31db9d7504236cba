"""Lines that went onto another whisker's far part where the two cross."""

import numpy as np

from pipeline.detection.tails import LEAST, regrow, shared_tail


def straight(angle, n, start=(0.0, 0.0)):
    s = np.arange(float(n))
    return start[0] + s * np.cos(angle), start[1] + s * np.sin(angle)


OTHER = straight(0.3, 300, (100.0, -15.0))  # crosses the x axis at x = 148


def hijacked():
    """Along the x axis, then along the other whisker from where they cross."""
    x, y = straight(0.0, 149)
    far = OTHER[0] > 149
    return np.concatenate([x, OTHER[0][far][:60]]), np.concatenate([y, OTHER[1][far][:60]])


def test_a_tail_on_another_line_is_found():
    x, y = hijacked()
    start = shared_tail(x, y, len(x), *OTHER, len(OTHER[0]))
    assert 140 <= start <= 149


def test_a_mere_crossing_is_none():
    x, y = straight(0.0, 220)
    assert shared_tail(x, y, len(x), *OTHER, len(OTHER[0])) == len(x)


def test_a_strayed_tail_grows_again_as_it_was():
    x, y = hijacked()
    known_x, known_y = straight(-0.05, 200)  # the frame before: turned by 0.05 rad
    start = shared_tail(x, y, len(x), *OTHER, len(OTHER[0]))
    n = regrow(x, y, len(x), start, known_x, known_y, len(known_x))
    assert n == 200
    assert np.abs(y[:n]).max() < 1.0  # px


def test_a_tail_that_is_where_it_should_be_is_left_there():
    x, y = straight(0.0, 200)
    before = x.copy(), y.copy()
    known_x, known_y = straight(0.02, 200)
    assert regrow(x, y, 200, 200 - LEAST, known_x, known_y, 200) == -1
    np.testing.assert_array_equal((x, y), before)
