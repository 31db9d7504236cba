"""Words in the report's plots and in Fig. 3: none cut, none upon another, none upon points."""

import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest
from figure_text import faults
from matplotlib.figure import Figure
from results_folder import CONTACTS, SETTINGS, contact, make_results

from pipeline.reports import fig3_panels, fig3_tables, plot_style, trials, vibration_map
from pipeline.reports.session_numbers import fig3_numbers, read_contacts
from pipeline.reports.time_courses import read_courses
from pipeline.tables import files
from pipeline.tables.columns import CONTACT_COLUMNS

LONG_NAME = "mouse_0123456789_2024-11-22_session_3_trial_0042"


def content(results):
    contacts = read_contacts(results)
    typical = fig3_tables.typical_contact(results, contacts)
    panels = fig3_tables.panel_tables(results, contacts, typical)
    return fig3_panels.Content(panels, fig3_numbers(contacts), typical)


def many(n=400):
    rng = np.random.default_rng(2)
    return [
        contact("one", k, 2 + k % 100, 2 + int(d), f, vibration_ratio=0.1)
        for k, (d, f) in enumerate(zip(rng.gamma(1, 30, n), rng.gamma(2, 10, n), strict=True), 1)
    ]


@pytest.mark.slow
@pytest.mark.parametrize(
    "contacts",
    [CONTACTS, [{**CONTACTS[0], "video": LONG_NAME}], many(), ()],
    ids=["few", "one with a long name", "many", "none"],
)
def test_fig3(tmp_path, contacts):
    names = list(dict.fromkeys(c["video"] for c in contacts)) or ["one"]
    drawn = content(make_results(tmp_path / "r", contacts, names))
    assert faults(fig3_panels.draw(drawn)) == []
    for letter in "abcdef":
        assert faults(fig3_panels.draw_one(drawn, letter)) == [], letter


def test_every_panel_of_contacts_says_that_there_are_none(tmp_path):
    figure = fig3_panels.draw(content(make_results(tmp_path / "r", (), ["one"])))
    said = [{text.get_text() for text in axes.texts} for axes in figure.axes]
    assert all(any(each.startswith("no contact") for each in said[k]) for k in (0, 1, 3, 4, 5))


def test_no_words_lie_among_the_points_of_fig3(tmp_path):
    figure = fig3_panels.draw(content(make_results(tmp_path / "r", many())))
    for axes in figure.axes[1:]:
        inside = axes.get_window_extent()
        words = [t for t in axes.texts if t.get_text()]
        assert words
        assert all(text.get_window_extent().y0 >= inside.y1 for text in words)


def table(rows):
    return files.as_table(pd.DataFrame(rows), CONTACT_COLUMNS)


def test_raster(tmp_path):
    rows = [{**c, "whisker": w} for c in many(60) for w in ("C1", "C2", "C3", "C4")]
    assert faults(trials.draw_raster(["one", "two"], table(rows))) == []
    assert faults(trials.draw_raster([str(k) for k in range(900)], table(CONTACTS))) == []


def test_mean_force(tmp_path):
    results = make_results(tmp_path / "r")
    average = trials.OnsetAverage()
    frames = pd.concat(
        [read_courses(results, "one").assign(whisker=name) for name in ("C1", "C2", "C3", "D1")]
    )
    contacts = pd.concat(
        [table(CONTACTS[:2]).assign(whisker=name) for name in ("C1", "C2", "C3", "D1")]
    )
    average.add(frames, contacts)
    assert faults(average.draw()) == []


@pytest.mark.parametrize("known", [True, False])
def test_map_of_ringing(known):
    rows = [contact("one", k, 10, d, 4.0, vibration_ratio=0.1) for k, d in enumerate((3, 50, 800))]
    whisker = SETTINGS.whisker[0].si() if known else None
    figure = vibration_map.draw_map(table(rows), whisker)
    assert faults(figure) == []
    place, duration = figure.axes[0].collections[-1].get_offsets().T
    np.testing.assert_allclose(place, 8.0)  # along x as in Fig. 11
    np.testing.assert_allclose(duration, [3, 50, 800])
    assert "vibrational / steady" in figure.axes[1].get_ylabel()


def test_faults_are_found():
    figure = Figure(figsize=(2, 2))
    figure.text(0.9, 0.5, "too long a text")
    figure.text(0.1, 0.2, "one")
    figure.text(0.1, 0.22, "other")
    assert faults(figure) == ["'too long a text' is cut", "'one' is upon 'other'"]


def test_style_of_plots_is_their_own():
    before = dict(mpl.rcParams)
    plot_style.axes(2.0)
    assert dict(mpl.rcParams) == before
