"""Where the tip is, from what the mean of many frames shows beyond the ends of traces."""

from dataclasses import replace

import numpy as np
import pytest
import rod_scenes
from hypothesis import given
from hypothesis import strategies as st
from line_ends import with_tip

from pipeline.kinematics.tip import tip_beyond
from whiskermodel.whisker import mouse_c2

tolerance = 0.6  # px


@pytest.fixture(scope="module")
def places():
    """Traces of 300 frames, whose ends scatter by 3 px."""
    rng = np.random.default_rng(1)
    _, places = rod_scenes.touching(np.full(300, 0.05))
    return replace(places, last=places.last + 3 * places.pixel * rng.standard_normal(300))


def tip_px(places):
    """How far the tip is found beyond the mean end, and the standard error [px]."""
    tip = tip_beyond(places, mouse_c2())
    return tip.beyond / places.pixel, tip.se / places.pixel


@pytest.mark.parametrize("noise_px", [0.01, 0.1, 0.3])
@pytest.mark.parametrize("beyond_px", [1.0, 8.0, 20.0])
def test_the_tip_is_found_beyond_ends_that_scatter(places, beyond_px, noise_px):
    """A frame's noise may be larger than the 0.2 px of the tip itself."""
    found, se = tip_px(with_tip(places, mouse_c2(), beyond_px * places.pixel, noise_px=noise_px))
    assert abs(found - beyond_px) < max(tolerance, 3 * se)
    assert se < 0.3 + 15 * noise_px


@pytest.mark.parametrize("least_px", [0.02, 0.05, 0.1, 0.2])
def test_a_tip_is_found_that_a_codec_erases_here_and_there(places, least_px):
    ends = with_tip(places, mouse_c2(), 12 * places.pixel, least_px, noise_px=0.01)
    found, se = tip_px(ends)
    assert abs(found - 12) < tolerance
    assert abs(found - 12) < 3 * se


def test_the_more_a_codec_erases_of_a_tip_the_less_it_says(places):
    """Of a tip 0.2 px thick."""
    found = [
        tip_px(with_tip(places, mouse_c2(), 12 * places.pixel, least_px, noise_px=0.01))[1]
        for least_px in (0.0, 0.02, 0.05, 0.1, 0.2)
    ]
    assert found == sorted(found)
    assert found[1] < tolerance
    assert found[-1] > 2.0


@pytest.mark.parametrize("seed", range(4))
def test_a_tip_that_a_codec_shows_in_no_frame_is_as_uncertain_as_it_is_wrong(places, seed):
    """All that is thinner than 0.25 px, 8 px before the tip, is erased."""
    ends = with_tip(places, mouse_c2(), 12 * places.pixel, noise_px=0.01, seed=seed)
    shown = np.where(ends.end_px > 0.25, ends.end_px, 0.0)
    found, se = tip_px(replace(ends, end_px=shown))
    assert found < 12 - tolerance
    assert abs(found - 12) < 3 * se


def test_another_whisker_across_the_end_in_some_frames_moves_the_tip_little(places):
    ends = with_tip(places, mouse_c2(), 8 * places.pixel)
    crossed = ends.end_px.copy()
    crossed[::12, 30:38] += 2.0
    found = tip_px(replace(ends, end_px=crossed))[0]
    assert found == pytest.approx(tip_px(ends)[0], abs=tolerance)


@pytest.mark.parametrize("first", [15, 24, 34])
def test_another_whisker_across_the_end_in_all_frames_is_left_out(places, first):
    ends = with_tip(places, mouse_c2(), 8 * places.pixel)
    crossed = ends.end_px.copy()
    crossed[:, first : first + 3] += 1.0
    found, se = tip_px(replace(ends, end_px=crossed))
    assert abs(found - 8) < max(tolerance, 3 * se)
    assert se < tolerance


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("cut_mm", [0.2, 4.0])
def test_the_tip_of_a_whisker_that_is_cut_is_found_without_a_warning(places, cut_mm):
    cut = replace(mouse_c2(), length=mouse_c2().length - 1e-3 * cut_mm)
    tip = tip_beyond(with_tip(places, cut, 8 * places.pixel), cut)
    assert tip.beyond / places.pixel == pytest.approx(8, abs=tolerance)


def test_ends_that_are_not_seen_show_no_tip(places):
    ends = with_tip(places, mouse_c2(), 8 * places.pixel)
    hidden = ends.end_px.copy()
    hidden[:, 20:] = np.nan  # the picture ends there
    assert tip_beyond(replace(ends, end_px=hidden), mouse_c2()) is None
    covered = ends.end_px.copy()
    covered[:, 10:] += 1.0  # by the animal's body
    assert tip_beyond(replace(ends, end_px=covered), mouse_c2()) is None
    unknown = np.full_like(ends.end_px, np.nan)
    assert tip_beyond(replace(ends, end_px=unknown), mouse_c2()) is None


def test_frames_that_are_all_the_same_show_the_tip():
    _, still = rod_scenes.touching(np.full(20, 0.05))
    still = replace(still, last=np.full_like(still.last, still.last.mean()))
    found, se = tip_px(with_tip(still, mouse_c2(), 8 * still.pixel, noise_px=0.0))
    assert abs(found - 8) < tolerance
    assert np.isfinite(se)


@given(seed=st.integers(0, 2**32 - 1))
def test_whatever_lies_beyond_the_ends_a_tip_that_is_found_has_a_place(seed):
    rng = np.random.default_rng(seed)
    _, some = rod_scenes.touching(np.full(rng.integers(1, 12), 0.05))
    scatter = rng.choice([0, 1, 30]) * some.pixel * rng.standard_normal(len(some))
    some = replace(some, last=some.last + scatter)
    beyond = rng.uniform(-20, 40) * some.pixel
    ends = with_tip(some, mouse_c2(), beyond, noise_px=rng.choice([0, 0.01, 3]), seed=seed)
    odd = ends.end_px.copy()
    odd[:, rng.integers(odd.shape[1]) :] += rng.choice([-1, 0, 1])
    odd[rng.random(odd.shape) < rng.choice([0, 0.5, 0.95])] = np.nan
    tip = tip_beyond(replace(ends, end_px=odd), mouse_c2())
    assert tip is None or np.all(np.isfinite(tip))
