"""Which whisker of some videos is meant."""

from types import SimpleNamespace

import pytest

from pipeline.app.calibrate_each import one_whisker

VIDEOS = [SimpleNamespace(whiskers=["C2", "D1"]), SimpleNamespace(whiskers=["C2"])]


def test_the_only_whisker_needs_no_name():
    assert one_whisker(VIDEOS[1:], None) == "C2"
    assert one_whisker(VIDEOS, "D1") == "D1"


@pytest.mark.parametrize(
    ("wanted", "message"),
    [(None, "--whisker: expected one of C2, D1"), ("E1", "--whisker E1: expected one of C2, D1")],
)
def test_a_whisker_that_is_not_clear_is_asked_for(wanted, message):
    with pytest.raises(ValueError) as caught:
        one_whisker(VIDEOS, wanted)
    assert str(caught.value) == message


def test_numbered_whiskers_are_named_in_their_order():
    many = [SimpleNamespace(whiskers=[f"w{k}" for k in range(1, 13)])]
    with pytest.raises(ValueError, match=r"one of w1 to w12$"):
        one_whisker(many, None)
