"""The tracker's lengths: from the whiskers, the picture, and the parameters in session.toml."""

import numpy as np
import pytest

from pipeline.session.plausibility import doubtful_values
from pipeline.session.quantities import pixels_in
from pipeline.session.session_file import settings_from
from pipeline.tracking import seen_lengths
from pipeline.tracking.matching import Ruler
from pipeline.tracking.registry import WhiskerTemplate
from pipeline.tracking.whiskers import seen_at_a_time, tracing_options, whisker_set_of

RECORDING = {"frames_per_second": 2000, "pixels_per_mm": 25, "face": "left"}
SHAPE = (480, 640)
WHISKER = {"name": "C2", "length_mm": 18, "hidden_length_mm": 1.4}


def options_of(whisker=(), **advanced):
    document = {"recording": RECORDING, "whisker": list(whisker), "advanced": advanced}
    return tracing_options(settings_from(document), SHAPE)


@pytest.mark.parametrize("whisker", [(), (WHISKER,)])
def test_parameters_of_session_toml_reach_the_tracker(whisker):
    usual = options_of(whisker)
    options = options_of(
        whisker, tracking={"bridge_mm": 2.4, "base_chord_mm": 8}, detection={"broad": 2}
    )
    assert options.bridge_px == pytest.approx(2 * usual.bridge_px, abs=1)
    assert Ruler.of("left", options).base_px == pytest.approx(
        2 * Ruler.of("left", usual).base_px, abs=1
    )
    assert options.params.detection.broad == 2
    assert options.frames_per_second == 2000


def test_without_lengths_the_picture_gives_the_scale():
    assert options_of().shortest_px == pytest.approx(3.5 * (480 * 640) ** 0.5 / 35)
    shown = options_of(tracking={"field_mm": 20}).shortest_px
    assert shown == pytest.approx(3.5 * (480 * 640) ** 0.5 / 20)


def test_ends_of_lines_are_measured_where_forces_of_a_whisker_follow():
    known = {"name": "C3", "length_mm": 12, "cone_length_mm": 13, "base_radius_um": 25}
    assert options_of((known,)).ends
    assert options_of((WHISKER, known)).ends
    assert not options_of((WHISKER,)).ends
    assert not options_of().ends


def test_lengths_between_lines_are_at_least_as_many_pixels_as_at_25_per_mm():
    assert pixels_in(0.72, 50e3) == pytest.approx(36)
    assert pixels_in(0.72, 8e3) == pytest.approx(18)


def whisker_set_with(names, whiskers=()):
    settings = settings_from({"recording": RECORDING, "whisker": list(whiskers)})
    return whisker_set_of([WhiskerTemplate(name, np.zeros(2), 300.0) for name in names], settings)


def test_a_whisker_that_only_the_whole_video_shows_keeps_its_own_dimensions():
    other = {"name": "C3", "length_mm": 12, "cone_length_mm": 13, "base_radius_um": 25}
    whisker_set = whisker_set_with(["C2"], [WHISKER, other]).only(["C3"]).of(["C3"])
    assert whisker_set.found == ("C3",)
    assert whisker_set.nominal[0].base_radius == pytest.approx(25e-6)
    whisker_set = whisker_set_with(["C2"], [WHISKER, other]).of(["C2", "C3"])
    assert (whisker_set.names, whisker_set.found) == (("C2", "C3"), ("C2", "C3"))
    assert whisker_set.hidden_lengths[0] == pytest.approx(1.4e-3)


def test_without_tables_the_names_are_those_of_the_whole_video():
    whisker_set = whisker_set_with(["w1", "w2", "w3"]).of(["w1", "w2"])
    assert whisker_set.names == whisker_set.found == ("w1", "w2")
    assert set(whisker_set.whiskers.values()) == {None}


def test_pieces_of_one_whisker_are_not_counted_as_two():
    """What is seen in other frames than the rest is the same whisker, found twice."""
    frames = tuple(range(10)), tuple(range(5)), tuple(range(5, 10))
    templates = [WhiskerTemplate("", np.zeros(2), 300.0, frames=each) for each in frames]
    assert seen_at_a_time(templates) == 2
    assert seen_at_a_time([]) == 0


def test_where_no_whisker_is_found_none_needs_dimensions():
    whisker_set = whisker_set_with([], [{"name": "C2", "hidden_length_mm": 0}])
    assert (whisker_set.names, whisker_set.found, whisker_set.nominal) == (("C2",), (), ())


def test_lengths_are_looked_at_again_with_the_parameters_of_session_toml(monkeypatch):
    used, advanced = [], {"tracking": {"shortest_line_mm": 9.0}}
    monkeypatch.setattr(
        seen_lengths, "find_templates", lambda frames, epochs, options, **at: used.append(options)
    )
    monkeypatch.setattr(seen_lengths, "_too_short", lambda *at: None)
    settings = settings_from({"recording": RECORDING, "advanced": advanced})
    assert seen_lengths.odd_length([0, 1], np.zeros((2, *SHAPE)), (), [], settings) is None
    assert [each.params for each in used] == [settings.advanced]


@pytest.mark.parametrize(("mm", "doubted"), [(70, False), (87, False), (89, True)])
def test_a_whisker_is_as_long_at_most_where_it_is_seen_as_where_it_is_given(mm, doubted):
    """Longer by far than any rat's: 44 mm by the equations of Belli et al. (2017)."""
    settings = settings_from(
        {"recording": RECORDING, "whisker": [{"name": "C2", "length_mm": mm}]}
    )
    px = mm * settings.recording.pixels_per_mm
    seen = [WhiskerTemplate("", np.zeros(2), px, longest_px=2 * px)]
    odd = seen_lengths.odd_length([0], np.zeros((1, *SHAPE)), (), seen, settings)
    assert (odd is not None) == doubted
    assert bool(list(doubtful_values(settings))) == doubted
