"""Numbers that are whiskers', and numbers of lines that are none's."""

import numpy as np
import pandas as pd

from pipeline.tables.dictionary import data_dictionary
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


def test_the_lines_of_code_in_the_dictionary_leave_out_what_is_not_known():
    frames = pd.DataFrame(
        {
            "frame": [0, 0, 0, 1, 1, 1],
            "whisker": ["w1", "w2", "w3"] * 2,
            "tracked": [True, True, True, True, False, True],
            "confidence": [0.9, 0.4, 0.4, 0.8, np.nan, 0.4],
        }
    )
    lines = frames.loc[frames["tracked"], ["frame", "whisker"]]
    text = data_dictionary()
    code = [text[text.index(start) :].split("`")[0] for start in ("known = ", "lines = ")]
    there = {"frames": frames, "lines": lines}
    exec("\n".join(code), there)
    for table in (there["known"], there["lines"]):
        assert table[["frame", "whisker"]].to_numpy().tolist() == [[0, "w1"], [1, "w1"]]
    assert nameless_in(frames) == {"w2", "w3"}
