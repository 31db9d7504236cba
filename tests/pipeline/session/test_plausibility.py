"""Values that are possible but hardly true are doubted; those of real whiskers are not."""

import pytest

from pipeline.session.plausibility import doubtful_values
from pipeline.session.session_file import settings_from

MOUSE = {"name": "C2", "length_mm": 18.0, "cone_length_mm": 18.947, "base_radius_um": 37.0}
# name, mm, µm: Belli et al. 2017, as in WHISKiT (SeNSE-lab/whiskitphysics)
RAT = (("A1", 37.2, 61.2), ("E1", 44.4, 90.4), ("E6", 6.4, 42.7), ("A4", 14.4, 32.6))


def doubts(*whiskers, rate=1000.0):
    recording = {"frames_per_second": rate, "pixels_per_mm": 25, "face": "left"}
    return list(doubtful_values(settings_from({"recording": recording, "whisker": whiskers})))


def test_the_papers_whisker_and_rats_are_not_doubted():
    rats = [
        {"name": name, "length_mm": mm, "cone_length_mm": 1.05 * mm, "base_radius_um": um}
        for name, mm, um in RAT
    ]
    assert doubts(MOUSE, *rats) == []


@pytest.mark.parametrize("whisker", [
    MOUSE | {"length_mm": 3.0, "hidden_length_mm": 0.5},  # cut short: the cone's length counts
    MOUSE | {"cone_length_mm": 10_000.0},  # all but a cylinder: the whisker's length counts
    {"name": "C2", "base_radius_um": 370.0},  # no forces are computed
])  # fmt: skip
def test_neither_cut_whiskers_nor_wires_are_doubted(whisker):
    assert doubts(whisker) == []


@pytest.mark.parametrize("changes", [
    {"base_radius_um": 370.0},
    {"base_radius_um": 3.7},
    {"length_mm": 1.8, "cone_length_mm": 1.8947, "hidden_length_mm": 0.1},
    {"length_mm": 180.0, "cone_length_mm": 189.47},
])  # fmt: skip
def test_tenfold_and_a_tenth_are_doubted(changes):
    (doubt,) = doubts(MOUSE, MOUSE | changes | {"name": "C1"})
    given = changes.get("base_radius_um", 37.0)
    assert doubt.startswith(f"[[whisker]] base_radius_um = {given:g} (C1): whiskers of mice")


def test_a_whisker_measured_at_another_scale_is_doubted():
    """A micrograph's length and radius, eight times too large, are in proportion."""
    large = {"length_mm": 144.0, "cone_length_mm": 151.6, "base_radius_um": 296.0}
    (doubt,) = doubts(MOUSE | large)
    assert doubt.startswith(
        "[[whisker]] length_mm = 144 (C2): those of mice and rats are 6 to 44 mm"
    )
    assert "pixels per mm" in doubt


def test_what_whiskers_of_that_length_have_is_said():
    (doubt,) = doubts(MOUSE | {"base_radius_um": 370.0})
    assert "that are 18 mm long have 30 to 120 µm" in doubt


def test_of_many_whiskers_three_are_named():
    (doubt,) = doubts(*(MOUSE | {"base_radius_um": 370.0, "name": f"C{k}"} for k in range(5)))
    assert "= 370 (C0), 370 (C1), 370 (C2) and 2 more: " in doubt


@pytest.mark.parametrize("rate", [24, 29.97, 50, 60])
def test_rates_of_playback_are_doubted(rate):
    (doubt,) = doubts(rate=rate)
    assert doubt.startswith(
        f"[recording] frames_per_second = {rate:g}: a contact usually lasts 16 ms"
    )


@pytest.mark.parametrize("rate", [100, 500])
def test_rates_of_cameras_in_use_are_not(rate):
    assert doubts(rate=rate) == []
