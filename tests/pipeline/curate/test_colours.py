"""Colours of contacts, for people of any colour vision."""

import itertools

import pytest
from colour_vision import SIGHTS, difference

from pipeline.curate.colours import HATCHED, STATES

TOLD_APART = 14.0  # ΔE 2000
FILLED = ("detected", "doubtful", "confirmed", "curated", "dismissed")  # "possible" is dashed


@pytest.mark.parametrize("sight", SIGHTS)
def test_states_differ_in_colour_or_hatching(sight):
    for one, other in itertools.combinations(FILLED, 2):
        if HATCHED not in (one, other):
            assert difference(STATES[one], STATES[other], sight) > TOLD_APART, (one, other)


def test_only_what_is_added_or_moved_is_hatched():
    from pipeline.curate.courses import _strip_data
    from pipeline.curate.items import Item
    from pipeline.curate.review import Span

    items = [Item(Span("C2", 10 * k, 10 * k + 5), state) for k, state in enumerate(FILLED[2:4])]
    assert _strip_data(items, ("C2",))["hatch"] == ["blank", "right_diagonal_line"]
