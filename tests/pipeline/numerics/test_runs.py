"""Stretches of frames beside a walk from frame to frame."""

from hypothesis import given
from hypothesis import strategies as st

from pipeline.numerics.runs import stretches


@given(st.lists(st.booleans()))
def test_stretches_are_those_of_a_walk(mask):
    found, begun = [], None
    for frame, holds in enumerate([*mask, False]):
        if holds and begun is None:
            begun = frame
        elif not holds and begun is not None:
            found.append((begun, frame))
            begun = None
    assert stretches(mask) == found
