"""What the paper says of its model figures, and the files that `whiskerforce paper` writes."""

import csv
from pathlib import Path

import numpy as np
import pytest
from figure_text import faults

from whiskermodel import Response, mouse_c2, rat_c2
from whiskermodel.paper import drawing, figure_data, published
from whiskermodel.paper.files import write_paper
from whiskermodel.pulse_response import half_gaussian_extremes

DOCS = Path(__file__).parents[3] / "docs" / "paper.md"
FIGURES = ("fig2", "fig5", "fig6", "fig7", "fig8", "fig9", "fig10", "fig11", "supported")
DARK = 0.3  # lightness of a ground on which white words can be read


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """What `write_paper` wrote (folder, paths, lines said), and the figures by name."""
    out, said, drawn = tmp_path_factory.mktemp("paper") / "new" / "folder", [], {}
    save = drawing.save

    def keep(path, figure, kind):
        drawn[path.name.split(".")[1]] = figure
        save(path, figure, kind)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(drawing, "save", keep)
        paths = write_paper(out, progress=said.append, grid=(7, 6))
    return (out, paths, said), drawn


@pytest.fixture
def written(made):
    return made[0]


@pytest.fixture
def drawn(made):
    return made[1]


def read(path):
    with open(path, newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def chord(table):
    pick = table["frame"] == "chord"
    return {name: table[name][pick] for name in table.columns}


def larger_peak(table):
    return np.maximum(table["vibration_max_ratio"], -table["vibration_min_ratio"])


# Figs 2 and 5 --------------------------------------------------------------------------------


def test_fig2_cones_vibrate_more_at_the_tip_and_less_at_the_follicle_than_cylinders():
    table = figure_data.figure_2()

    def shape(boundary, taper, basis, mode):
        pick = (table["boundary"] == boundary) & (table["taper"] == taper)
        pick &= (table["basis"] == basis) & (table["mode"] == mode)
        return table["x_over_length"][pick], np.abs(table["displacement"][pick])

    for boundary in ("fixed", "pinned"):
        for mode in (1, 2, 3):
            x, cylinder = shape(boundary, 0.0, "exact", mode)
            _, cone = shape(boundary, 1.0, "complete", mode)
            assert cone[-1] > 1.2 * cylinder[-1]
            assert cone[x < 0.3].max() < 0.7 * cylinder[x < 0.3].max()


def test_fig5_the_fits_give_back_what_the_slips_were_made_with():
    _, fits = figure_data.figure_5()
    assert fits["damping_per_s"].mean() == pytest.approx(215, abs=15)  # 1/s
    assert fits["angular_frequency_rad_per_s"].mean() == pytest.approx(938, abs=10)  # rad/s
    truth = figure_data.slipping_whisker().youngs_modulus / 1e9
    assert fits["youngs_modulus_GPa"].mean() == pytest.approx(truth, abs=0.1)  # GPa


# Fig. 6 --------------------------------------------------------------------------------------


@pytest.mark.parametrize("boundary", ["fixed", "pinned"])
def test_fig6_vibration_is_small_between_face_and_pole(boundary):
    assert published.vibration_between(boundary, 16e-3) < 0.11  # about 10 %, at the median
    assert published.vibration_between(boundary, 20e-3) < 0.10


@pytest.mark.parametrize("boundary", ["fixed", "pinned"])
def test_fig6_vibration_grows_substantially_towards_the_tip(boundary):
    motion = figure_data.figure_6(boundary)
    envelope = np.abs(motion.vibrational).max(axis=1)
    assert envelope[-1] > 10 * envelope[motion.arc_length <= 9e-3].max()


def test_fig6_ten_modes_put_a_node_within_a_fiftieth_of_the_length_and_more_come_closer():
    offsets = [published.node_offset(n) for n in (10, 20, 40)]
    assert offsets[0] < 0.02
    assert offsets[0] > offsets[1] > offsets[2]


# Figs 7 and 8 --------------------------------------------------------------------------------


def test_fig7_negligible_below_9_mm_and_comparable_near_the_tip():
    table = chord(figure_data.figure_7())
    peak, c = larger_peak(table), table["contact_mm"]
    assert peak[c <= 9].max() < 0.1
    assert 0.5 < peak[np.argmin(np.abs(c - 15))] < 2
    assert (np.diff(peak) > 0).all()


def test_fig8_only_the_shortest_exceeds_the_steady_moment():
    table = chord(figure_data.figure_8())
    at = [np.argmin(np.abs(table["duration_ms"] - t)) for t in (2.5, 5, 10, 20)]
    peak = larger_peak(table)[at]
    assert (peak > 1).tolist() == [True, False, False, False]
    assert peak[3] < 0.15


def test_fig8_shorter_contacts_excite_higher_modes_more_relative_to_the_steady_moment():
    over_steady = [published.higher_modes(t)[0] for t in (20e-3, 10e-3, 5e-3, 2.5e-3)]
    assert (np.diff(np.log(over_steady)) > np.log(1.9)).all()


def test_fig8_without_kinks_the_share_of_higher_modes_grows_too():
    """Raised-cosine contacts; the half-Gaussian's kinks excite all modes alike at any duration."""
    response, shares = Response(mouse_c2()), []
    for duration in (20e-3, 10e-3, 5e-3, 2.5e-3):
        time = np.arange(0, 60e-3, figure_data.DT)
        force = figure_data.ramp_and_hold(time, duration / 2, 1e-6, hold_duration=0.0)
        eta = np.abs(response.amplitudes(12e-3, force, figure_data.DT)).max(axis=1)
        moment = eta * np.abs(response.modes.at_base(2))
        shares.append(moment[1:].sum() / moment.sum())
    assert (np.diff(shares) > 0).all()


# Fig. 9 --------------------------------------------------------------------------------------


def test_fig9_vibration_dramatically_exceeds_the_steady_moment_most_for_the_fastest_slips():
    peak = larger_peak(chord(figure_data.figure_9()))  # slips from fast to slow
    assert (peak > 4).all()
    assert (np.diff(peak) < 0).all()
    assert peak[0] > 20


def test_fig9_a_second_stick_has_little_effect_on_the_transient():
    for slip in figure_data.FIGURE_9_SLIPS:
        assert published.second_stick_factor(slip) == pytest.approx(1, abs=0.1)


def test_fig9_slips_excite_higher_modes():
    """Without modes 3 to 10 the fastest slip's peak would be less than half."""
    time = np.arange(0, 40e-3, figure_data.DT)
    force = figure_data.stick_slip(time, 0.25e-3)
    peaks = []
    for n in (2, 10):
        loads = Response(rat_c2(), n_modes=n).base_loads(32e-3, force, figure_data.DT)
        peaks.append(np.abs(loads.vibrational_moment).max())
    assert peaks[0] < 0.5 * peaks[1]


def test_fig9_the_clamped_frame_is_an_order_of_magnitude_lower():
    table = figure_data.figure_9()
    clamped = larger_peak({n: table[n][table["frame"] == "clamped"] for n in table.columns})
    assert larger_peak(chord(table))[0] > 10 * clamped[0]


# Fig. 10 -------------------------------------------------------------------------------------


def test_fig10_vibration_is_negligible_for_every_ramp():
    table = chord(figure_data.figure_10())
    peak = larger_peak(table)  # ramps from slow to fast
    assert (peak < 0.06).all()
    assert (peak[:3] < 0.005).all()
    assert (np.diff(peak) > 0).all()


def test_fig10_holds_twelve_degrees():
    loads = figure_data.ramp_loads(12e-3)
    assert np.rad2deg(loads.steady_angle[-1]) == pytest.approx(12)


# Fig. 11 -------------------------------------------------------------------------------------


def ratio(whisker, contact_share, duration):
    peak, high, low = half_gaussian_extremes(
        Response(whisker), contact_share * whisker.length, 1e-6, duration
    )
    return np.maximum(high, -low) / np.abs(peak)


def test_fig11_steady_forces_dominate_in_pole_localization():
    shares = np.linspace(0.1, 0.65, 12)
    for duration in (5e-3, 16e-3, 113e-3):  # 5 %, median and 95 % of the contacts
        assert ratio(mouse_c2(), shares, duration).max() < 0.6
    assert ratio(mouse_c2(), 0.75, 16e-3).max() < 0.3


def test_fig11_vibration_is_significant_only_in_brief_contacts():
    assert ratio(mouse_c2(), np.linspace(0.1, 0.75, 14), 10e-3).max() < 0.5
    assert ratio(mouse_c2(), 0.65, 2.5e-3) > 1


@pytest.mark.parametrize("species", ["mouse", "rat"])
def test_fig11_vibration_grows_with_distance_and_briefness(species):
    table = figure_data.figure_11(n_contacts=9, n_durations=7)
    pick = table["species"] == species
    grid = table["vibration_ratio"][pick].reshape(9, 7)
    assert (np.diff(grid, axis=0) > 0).all()
    assert (np.diff(grid, axis=1) < 0).all()


def test_fig11_slips_on_textures_ring_louder_than_they_bend():
    durations = np.array([0.25, 0.5, 1, 2, 4]) * 1e-3
    assert (ratio(rat_c2(), 30.15e-3 / rat_c2().length, durations) > 1).all()


# Files ---------------------------------------------------------------------------------------


@pytest.mark.slow
def test_every_figure_is_written_as_picture_and_numbers(written):
    out, paths, said = written
    names = {p.name for p in paths}
    for figure in ("fig2", "fig5", "fig6", "fig7", "fig8", "fig9", "fig10", "fig11", "supported"):
        assert {f"{figure}.png", f"{figure}.svg", f"{figure}.csv"} <= names
        assert figure in said
        assert (out / f"{figure}.png").stat().st_size > 10_000
    assert {"modes.csv", "published.csv"} <= names
    assert {p.name for p in out.iterdir()} == names


@pytest.mark.slow
@pytest.mark.parametrize("figure", ["fig7", "fig8", "fig9", "fig10"])
def test_ratio_tables_have_their_columns(written, figure):
    rows = read(written[0] / f"{figure}.csv")
    assert tuple(rows[0]) == (
        "contact_mm", "duration_ms", "peak_force_uN", "frame", "modes",
        "vibration_max_ratio", "vibration_min_ratio",
    )  # fmt: skip
    assert {row["frame"] for row in rows} == {"chord", "clamped"}
    assert all(float(row["vibration_min_ratio"]) <= 0 for row in rows)


@pytest.mark.slow
def test_the_papers_cases_are_rows(written):
    def cases(figure):
        rows = read(written[0] / f"{figure}.csv")
        return {(float(r["contact_mm"]), float(r["duration_ms"]), float(r["peak_force_uN"]))
                for r in rows if r["frame"] == "chord"}  # fmt: skip

    assert {(6, 12, 10), (9, 12, 10), (12, 12, 2.5), (15, 12, 0.5)} <= cases("fig7")
    assert {(12, t, 2.5) for t in (2.5, 5, 10, 20)} <= cases("fig8")
    assert {(32, t, 5) for t in (0.25, 0.5, 1, 2, 4)} == cases("fig9")


@pytest.mark.slow
def test_mode_and_map_tables_have_their_columns(written):
    rows = read(written[0] / "modes.csv")
    assert tuple(rows[0]) == ("boundary", "taper", "basis", "mode", "p_prime_half")
    fixed = [float(r["p_prime_half"]) for r in rows
             if (r["boundary"], r["taper"], r["basis"]) == ("fixed", "1", "complete")]  # fmt: skip
    np.testing.assert_allclose(fixed[:2], [4.359629, 10.572831], atol=1e-6)
    assert tuple(read(written[0] / "fig11.csv")[0]) == (
        "species", "contact_mm", "duration_ms", "vibration_ratio",
    )  # fmt: skip


def test_the_page_holds_the_numbers_as_computed():
    """docs/paper.md's table is `published.markdown()`, line by line."""
    page = DOCS.read_text(encoding="utf-8")
    for line in published.markdown().splitlines():
        assert line in page


# Drawn figures: letters everywhere, no word cut or upon another, legends that explain ------------


def panels_of(figure):
    """Axes that show something, without colour bars and legends of their own."""
    return [a for a in figure.axes if a.axison and a.get_label() != "<colorbar>"]


def letters_of(panel):
    return [t.get_text() for t in panel.texts if t.get_fontweight() == "bold"]


@pytest.mark.slow
@pytest.mark.parametrize("name", FIGURES)
def test_words_are_whole_and_apart(drawn, name):
    assert faults(drawn[name]) == []


@pytest.mark.slow
@pytest.mark.parametrize("name", FIGURES)
def test_every_panel_has_a_letter_of_its_own(drawn, name):
    letters = [letters_of(panel) for panel in panels_of(drawn[name])]
    assert all(len(each) == 1 for each in letters)
    assert len({each[0] for each in letters}) == len(letters)


@pytest.mark.slow
@pytest.mark.parametrize("name", FIGURES)
def test_every_panel_says_what_is_along_its_axes(drawn, name):
    for panel in panels_of(drawn[name]):
        first_column = panel.get_subplotspec().is_first_col()
        if len(panel.get_yticks()) and (first_column or name == "fig10"):
            assert panel.get_ylabel(), letters_of(panel)


@pytest.mark.slow
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


@pytest.mark.slow
def test_light_words_of_the_map_have_a_dark_ground_or_rim(drawn):
    for panel in panels_of(drawn["fig11"]):
        for text in [t for t in panel.texts if t.get_fontweight() != "bold"]:
            box, rims = text.get_bbox_patch(), text.get_path_effects()
            grounds = [box.get_facecolor()[:3]] if box else []
            assert all(max(colour) < DARK for colour in grounds)
            assert grounds or [type(rim).__name__ for rim in rims] == ["withStroke"]


@pytest.mark.slow
def test_the_map_names_every_level_it_crosses(drawn):
    for panel in panels_of(drawn["fig11"]):
        labels = {t.get_text() for t in panel.texts}
        assert {"0.1", "0.3", "1", "3"} <= labels
