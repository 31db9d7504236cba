"""Contacts that the report shows: of many videos, of every flag, and soon behind key frames."""

import av
import numpy as np
import pandas as pd
import pytest

from pipeline.reports.examples import (
    FEWEST,
    MOST_DECODED,
    SURELY,
    Effort,
    choose_examples,
    choose_flagged,
)
from pipeline.video.open import open_video

KEYS = 20  # frames from key frame to key frame


@pytest.fixture(scope="module")
def video(tmp_path_factory):
    """Path of 200 frames with a key frame every KEYS."""
    path = tmp_path_factory.mktemp("video") / "a.mp4"
    options = {"g": str(KEYS), "sc_threshold": "0"}
    with av.open(str(path), "w") as file:
        stream = file.add_stream("libx264", rate=25, options=options)
        stream.height, stream.width, stream.pix_fmt = 48, 64, "yuv420p"
        for i in range(200):
            image = np.full((48, 64), i, np.uint8)
            file.mux(stream.encode(av.VideoFrame.from_ndarray(image, format="gray")))
        file.mux(stream.encode())
    return path


def contacts_at(*peaks, video="a"):
    return pd.DataFrame({"video": video, "peak_frame": peaks})


def test_effort_is_what_must_be_decoded(video):
    contacts = contacts_at(10, 45, 55, 60)
    effort = Effort(contacts, {"a": {"path": str(video)}})
    effort.weigh(contacts.index)
    assert [effort.of(k) for k in contacts.index] == [11, 6, 16, 1]
    effort.take(2)  # 45 is read on the way
    assert [effort.of(k) for k in contacts.index] == [11, 0, 0, 1]


def test_examples_are_soon_behind_key_frames(video):
    contacts = contacts_at(19, 38, 61, 79, 95, 122, 140, 159)
    effort = Effort(contacts, {"a": {"path": str(video)}})
    assert choose_examples(contacts, 3, effort) == [2, 5, 6]
    assert choose_examples(contacts, 3, effort, shown=[6]) == [2, 4, 5]
    assert choose_examples(contacts, 20, effort) == list(contacts.index)


def test_examples_are_of_as_many_videos_as_possible(video):
    contacts = pd.concat(
        [contacts_at(19, 1, 5, 22, video=name) for name in ("a", "gone", "unknown")],
        ignore_index=True,
    )
    effort = Effort(contacts, {"a": {"path": str(video)}, "gone": {"path": "gone.mp4"}})
    assert choose_examples(contacts, 2, effort) == [1, 4]
    # nothing is known of the others: their first ones, in turn
    assert choose_examples(contacts, 5, effort) == [1, 4, 8, 3, 5]


def test_contacts_shown_anyway_stand_in_where_there_are_no_others(video):
    contacts = contacts_at(1, 21, 41)
    effort = Effort(contacts, {"a": {"path": str(video)}})
    assert choose_examples(contacts, 2, effort, shown=[0, 2]) == [0, 1]
    assert choose_examples(contacts.iloc[:0], 2, effort) == []


def test_some_of_every_flag(video):
    contacts = contacts_at(*range(19, 200, 20), 21)
    effort = Effort(contacts, {"a": {"path": str(video)}})
    flagged = [list(range(6)), [6, 7, 8], [9, 10]]
    chosen = choose_flagged(flagged, 12, 5, effort)
    for own in flagged:
        assert len(set(own) & set(chosen)) >= SURELY
    assert len(chosen) == MOST_DECODED / KEYS + 1  # each 20 frames behind its key frame, one 2
    effort = Effort(contacts, {"a": {"path": str(video)}})
    assert choose_flagged(flagged, 4, 5, effort)[2] == 10  # a frame behind a key frame


def test_more_examples_than_a_few_must_be_read_soon(video):
    contacts = contacts_at(*range(19, 200, 20))
    inputs = {"a": {"path": str(video)}}
    assert len(choose_examples(contacts, 9, Effort(contacts, inputs))) == MOST_DECODED / KEYS
    effort = Effort(contacts, inputs)
    effort.weigh(contacts.index)
    for label in contacts.index[4:]:
        effort.take(label)
    chosen = choose_examples(contacts.iloc[:4], 4, effort)
    assert len(chosen) == FEWEST
    inputs["a"]["frames"] = 100 * MOST_DECODED  # of a long session, more are worth it
    assert len(choose_examples(contacts, 9, Effort(contacts, inputs))) == 9


def test_one_contact_may_stand_for_two_flags(video):
    contacts = contacts_at(1, 30, 50)
    effort = Effort(contacts, {"a": {"path": str(video)}})
    assert choose_flagged([[0, 1], [0, 2]], 9, 1, effort) == [0]


def test_only_few_of_many_contacts_are_weighed(video, monkeypatch):
    asked = []
    starts = type(open_video(video)).starts
    monkeypatch.setattr(
        type(open_video(video)), "starts", lambda self, n: asked.extend(n) or starts(self, n)
    )
    contacts = contacts_at(*range(199))
    effort = Effort(contacts, {"a": {"path": str(video)}})
    assert len(choose_examples(contacts, 6, effort)) == 6
    assert len(asked) <= 50
