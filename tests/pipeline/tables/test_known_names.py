"""Names that are whiskers', and names of lines that are none's."""

import numpy as np
import pandas as pd

from pipeline.tables.known_names import nameless, nameless_in


def test_a_name_that_is_known_in_one_frame_is_a_whiskers():
    names = ["w1", "w2", "w1", "w2", "w3"]
    assert nameless(names, [0.3, 0.4, 0.6, 0.1, np.nan]) == {"w2"}


def test_frames_in_which_it_is_not_tracked_do_not_count():
    frames = pd.DataFrame(
        {"whisker": ["w1", "w1"], "tracked": [True, False], "confidence": [0.4, 0.9]}
    )
    assert nameless_in(frames) == {"w1"}


def test_nothing_has_no_names():
    assert nameless([], []) == set()
