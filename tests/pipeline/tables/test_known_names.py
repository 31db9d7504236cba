"""Numbers that are whiskers', and numbers of lines that are none's."""

import numpy as np
import pandas as pd

from pipeline.tables.known_names import nameless, nameless_in


def test_numbers_behind_the_last_that_is_ever_known_are_no_whiskers():
    names = ["w1", "w10", "w2", "w3", "w10", "w11", "w12"]
    assert nameless(names, [0.9, 0.4, 0.4, 0.6, 0.6, 0.4, np.nan]) == set()
    assert nameless(names, [0.9, 0.4, 0.4, 0.6, 0.4, 0.4, 0.4]) == {"w10", "w11", "w12"}


def test_sides_are_numbered_by_themselves():
    names = ["left_w1", "left_w2", "left_w3", "right_w1", "right_w2"]
    assert nameless(names, [0.9, 0.9, 0.4, 0.9, 0.4]) == {"left_w3", "right_w2"}


def test_names_that_were_given_are_whiskers():
    assert nameless(["C1", "C2", "w1"], [0.4, 0.9, 0.9]) == set()


def test_where_nothing_is_known_all_count():
    assert nameless(["w1", "w2"], [0.4, 0.3]) == set()
    assert nameless([], []) == set()


def test_frames_in_which_it_is_not_tracked_do_not_count():
    frames = pd.DataFrame(
        {
            "whisker": ["w1", "w2", "w2"],
            "tracked": [True, False, True],
            "confidence": [0.9, 0.9, 0.4],
        }
    )
    assert nameless_in(frames) == {"w2"}
