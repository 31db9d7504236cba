"""The drawn figures: letters everywhere, no word cut or upon another, legends that explain."""

import pytest
from figure_text import faults

FIGURES = ("fig2", "fig5", "fig6", "fig7", "fig8", "fig9", "fig10", "fig11", "supported")
DARK = 0.3  # lightness of a ground on which white words can be read


def panels_of(figure):
    """Axes that show something, without colour bars and legends of their own."""
    return [a for a in figure.axes if a.axison and a.get_label() != "<colorbar>"]


def letters_of(panel):
    return [t.get_text() for t in panel.texts if t.get_fontweight() == "bold"]


@pytest.mark.parametrize("name", FIGURES)
def test_words_are_whole_and_apart(drawn, name):
    assert faults(drawn[name]) == []


@pytest.mark.parametrize("name", FIGURES)
def test_every_panel_has_a_letter_of_its_own(drawn, name):
    letters = [letters_of(panel) for panel in panels_of(drawn[name])]
    assert all(len(each) == 1 for each in letters)
    assert len({each[0] for each in letters}) == len(letters)


@pytest.mark.parametrize("name", FIGURES)
def test_every_panel_says_what_is_along_its_axes(drawn, name):
    for panel in panels_of(drawn[name]):
        first_column = panel.get_subplotspec().is_first_col()
        if len(panel.get_yticks()) and (first_column or name == "fig10"):
            assert panel.get_ylabel(), letters_of(panel)


@pytest.mark.parametrize(
    ("name", "letter", "words"),
    [
        ("fig7", "b1", {"vibrational", "steady"}),
        ("fig8", "a1", {"vibrational", "steady"}),
        ("fig7", "c", {"positive peak", "negative peak", "chord frame (the paper's)"}),
        ("fig8", "b", {"positive peak", "negative peak", "chord frame (the paper's)"}),
    ],
)
def test_lines_and_colours_are_explained(drawn, name, letter, words):
    (panel,) = [p for p in panels_of(drawn[name]) if letters_of(p) == [letter]]
    legend = {t.get_text(): line for t, line in zip(
        panel.get_legend().get_texts(), panel.get_legend().get_lines(), strict=True)}  # fmt: skip
    assert words <= set(legend)
    looks = {(line.get_color(), line.get_linestyle(), line.get_marker()) for line in panel.lines}
    for word in words & {"vibrational", "steady"}:
        line = legend[word]
        assert (line.get_color(), line.get_linestyle(), line.get_marker()) in looks
    colours = {line.get_color() for line in panel.lines}
    assert {legend[w].get_color() for w in words & {"positive peak", "negative peak"}} <= colours


def test_light_words_of_the_map_have_a_dark_ground_or_rim(drawn):
    for panel in panels_of(drawn["fig11"]):
        for text in [t for t in panel.texts if t.get_fontweight() != "bold"]:
            box, rims = text.get_bbox_patch(), text.get_path_effects()
            grounds = [box.get_facecolor()[:3]] if box else []
            assert all(max(colour) < DARK for colour in grounds)
            assert grounds or [type(rim).__name__ for rim in rims] == ["withStroke"]


def test_the_map_names_every_level_it_crosses(drawn):
    for panel in panels_of(drawn["fig11"]):
        labels = {t.get_text() for t in panel.texts}
        assert {"0.1", "0.3", "1", "3"} <= labels
