"""Time courses as the page gets them."""

from types import SimpleNamespace

import numpy as np

from pipeline.curate.courses import COURSES, LETTER, MOST_POINTS, Courses
from pipeline.curate.results import Traces

FRAMES = 3 * MOST_POINTS + 1  # one more than is thinned by whole groups of frames


def test_a_thinned_course_reaches_the_last_frame_and_keeps_its_peak():
    values = np.zeros(FRAMES)
    values[1234] = 7.0
    video = SimpleNamespace(
        whiskers=("C2",),
        n_frames=FRAMES,
        recording=SimpleNamespace(frames_per_second=1000.0),
        tables=None,
        traces=lambda: {"C2": Traces(*[values] * 5)},
    )
    courses = Courses(lambda frame: None)
    courses.enter(video)
    courses.show_window(video, 0, FRAMES, "C2")
    for name in COURSES:
        x, y = (courses._lines[name].data[key][-1] for key in ("xs", "ys"))
        assert len(x) < FRAMES
        assert x[-1] == FRAMES - 1
        assert max(y) == 7.0


def test_long_names_widen_the_left_border_of_all_courses_alike():
    courses = Courses(lambda frame: None)
    for name in ("C2", "left_whisker_C2"):
        recording = SimpleNamespace(frames_per_second=1000.0)
        courses.enter(SimpleNamespace(whiskers=(name,), n_frames=9, recording=recording))
        (border,) = {plot.min_border_left for plot in courses.plots.values()}
    assert border > LETTER * len("left_whisker_C2")
