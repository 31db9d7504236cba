"""Which whiskers of session.toml were found, by their order and their lengths."""

from itertools import permutations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.run import analyse
from pipeline.session.session_file import read_session
from pipeline.tracking.given_lengths import (
    EXCHANGED,
    FADED,
    FADING,
    FARTHEST,
    MISSED,
    USUAL,
    numbers_in_order,
    posterior_first,
    probabilities,
    runs_backwards,
)
from synthetic.session import render_session

ROW = np.array([265, 251, 238, 230, 210, 203, 175, 150, 158, 124, 105, 93.0])  # px, as of a mouse


@pytest.mark.parametrize("missing", [(), (0,), (4,), (10, 11), (2, 7), (0, 1, 2)])
def test_lengths_tell_which_whiskers_are_missing(missing):
    there = np.setdiff1d(np.arange(len(ROW)), missing)
    assert numbers_in_order(0.88 * ROW[there], ROW).tolist() == there.tolist()


def test_a_line_cut_short_shifts_none():
    seen = 0.9 * ROW[1:]
    seen[[2, 5]] = 80.0, np.nan
    assert numbers_in_order(seen, ROW).tolist() == list(range(1, len(ROW)))


@pytest.mark.parametrize("given_px", [(), (np.inf,) * 5, (100.0,) * 5])
def test_where_lengths_tell_nothing_the_first_ones_are_there(given_px):
    assert numbers_in_order([90.0, 80.0, 85.0], given_px).tolist() == [0, 1, 2]
    assert runs_backwards([90.0, 80.0, 85.0], given_px) is None


@pytest.mark.parametrize("missing", [(), (5,), (0, 11)])
def test_the_reverse_order_is_seen(missing):
    there = np.setdiff1d(np.arange(len(ROW)), missing)
    assert runs_backwards(0.9 * ROW[there], ROW) is False
    assert runs_backwards(0.9 * ROW[there][::-1], ROW) is True


@pytest.mark.parametrize("scale", [0.4, 0.7, 1.5, 2.2])
def test_the_order_is_seen_whatever_the_scale(scale):
    assert runs_backwards(scale * ROW[:-2], ROW) is False
    assert runs_backwards(scale * ROW[:-2][::-1], ROW) is True


@settings(max_examples=60, deadline=None)
@given(st.data())
def test_the_choice_is_the_cheapest_of_all(data):
    length = st.floats(40.0, 400.0)
    given_px = np.array(data.draw(st.lists(length, min_size=1, max_size=6)))
    seen_px = np.array(data.draw(st.lists(length, max_size=len(given_px))))

    def exchanges(chosen):
        """How many neighbours are exchanged; None where the order is none of neighbours."""
        chosen, n, k = list(chosen), 0, 0
        while k < len(chosen) - 1:
            if chosen[k] == chosen[k + 1] + 1:
                chosen[k], chosen[k + 1] = chosen[k + 1], chosen[k]
                n, k = n + 1, k + 2
            else:
                k += 1
        return n if chosen == sorted(chosen) else None

    def cost(chosen):
        off = np.log(seen_px) - np.log(given_px[list(chosen)])
        near = np.minimum(np.abs(off[:, None] - FADED), FARTHEST).sum(axis=0)
        missed = np.delete(given_px, list(chosen)).sum() / given_px.mean()
        return near + MISSED * missed + EXCHANGED * exchanges(chosen) + FADING * np.abs(FADED)

    every = permutations(range(len(given_px)), len(seen_px))
    every = [chosen for chosen in every if exchanges(chosen) is not None]
    found = numbers_in_order(seen_px, given_px)
    assert tuple(found) in every
    assert cost(found).min() == pytest.approx(min(cost(each).min() for each in every), abs=1e-9)
    likelihood = np.array([np.exp(-cost(each) / USUAL).sum() for each in every])
    same = np.array(every).reshape(len(every), -1) == found
    expected = likelihood @ same / likelihood.sum()
    assert probabilities(seen_px, given_px, found) == pytest.approx(expected, abs=1e-9)


def test_neighbours_one_behind_the_other_are_told_by_their_lengths():
    seen = 0.9 * np.array([265.0, 150.0, 230.0, 105.0])
    assert numbers_in_order(seen, [265.0, 230.0, 150.0, 105.0]).tolist() == [0, 2, 1, 3]


def test_a_whole_whisker_is_not_taken_for_a_longer_one_that_faded():
    assert numbers_in_order([18.0], [18.0, 25.0]).tolist() == [0]
    assert 0.6 < probabilities([18.0], [18.0, 25.0], [0])[0] < 0.95
    assert numbers_in_order([23.0], [18.0, 25.0]).tolist() == [1]


@pytest.mark.parametrize(
    ("names", "posterior"),
    [
        (("C1", "C2", "C3"), True),
        (("C3", "C2", "C1"), False),
        (("B1", "C1", "D1", "B2", "C2"), True),
        (("left_C1", "left_C2"), True),
        (("w1", "w2", "w3"), False),
        (("C1", "D1"), False),
        ((), False),
    ],
)
def test_arcs_are_counted_from_behind(names, posterior):
    assert posterior_first(names) is posterior


def test_a_choice_between_whiskers_of_one_length_is_open():
    given_px = [200.0, 150.0, 100.0, 100.0]
    found = numbers_in_order([180.0, 135.0, 90.0], given_px)
    sure = probabilities([180.0, 135.0, 90.0], given_px, found)
    assert sure[:2].min() > 0.99
    assert sure[2] == pytest.approx(0.5, abs=0.01)
    assert probabilities([180.0, 135.0, 90.0, 90.0], given_px, np.arange(4)).min() > 0.97


@pytest.mark.parametrize("given_px", [(), (np.inf,) * 5])
def test_nothing_is_doubted_where_lengths_are_not_known(given_px):
    assert probabilities([90.0, 80.0, 85.0], given_px, np.arange(3)).tolist() == [1, 1, 1]


@pytest.mark.usefixtures("lossless_is_quick")
def test_one_seen_whisker_of_two_tables_is_the_one_of_its_length_and_not_quite_certain(tmp_path):
    (path,) = render_session(tmp_path, "single", 5, 1, frames=40)
    own = read_session(tmp_path / "session.toml")
    (true,) = own.whisker
    longer = true.model_copy(update={"name": "D2", "length_mm": 25.0, "cone_length_mm": 26.0})
    both = own.model_copy(update={"whisker": (true, longer)})
    alone, found = (analyse(path, settings).frames for settings in (own, both))
    name = found.loc[found["tracked"], "whisker"]
    assert set(name) == {true.name}
    share = found["confidence"].max() / alone["confidence"].max()
    assert 0.6 < share < 0.95
