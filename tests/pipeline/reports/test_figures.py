"""Fig. 3 from the tables: its numbers, its panels, its files."""

import xml.etree.ElementTree as ElementTree
from types import SimpleNamespace

import cv2
import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.figure import Figure
from results_folder import CONTACTS, contact, make_results

from pipeline.reports import fig3_panels, fig3_tables, figures, session_numbers
from pipeline.reports.whisker_styles import whisker_styles
from pipeline.tables import files, whole_files
from pipeline.tables.columns import CONTACT_COLUMNS


@pytest.fixture
def results(tmp_path):
    return make_results(tmp_path / "results")


@pytest.fixture(scope="module")
def drawn(tmp_path_factory):
    """A results folder with Fig. 3, to be read, and the files that were written."""
    results = make_results(tmp_path_factory.mktemp("drawn") / "results")
    return results, figures.write_fig3(results)


def test_all_files_are_written(drawn):
    results, written = drawn
    names = {path.name for path in written}
    whole = {"fig3.png", "fig3.svg", "fig3.csv"}
    assert names == whole | {f"fig3{p}.{kind}" for p in "abcdef" for kind in ("csv", "svg")}
    assert {p.name for p in (results / "figures").glob("[!.]*")} == names
    picture = cv2.imread(str(results / "figures" / "fig3.png"))
    assert picture.shape[0] > 600
    assert 0.02 < np.mean(picture < 128) < 0.3  # something is drawn, and most is paper
    texts = ElementTree.parse(results / "figures" / "fig3.svg").findall(".//{*}text")
    shown = {"".join(text.itertext()) for text in texts}
    assert set("abcdef") <= shown
    assert {"before", "during", "after", "contact duration (ms)"} <= shown


@pytest.mark.parametrize("kind", ["png", "svg"])
def test_names_in_any_script_are_drawn_without_a_word(tmp_path, kind, recwarn):
    figure = Figure()
    figure.text(0.5, 0.5, "whisker \u65e5\u672c")  # in no font of Matplotlib's
    (drawn,) = figures._save(figure, tmp_path, "name", [kind])
    assert drawn.stat().st_size
    assert not recwarn.list


def test_numbers_stand_beside_the_papers(drawn):
    results, _ = drawn
    numbers = pd.read_csv(results / "figures" / "fig3.csv").set_index(["quantity", "statistic"])
    force, duration = np.array([4.0, 10, 30]), np.array([10.0, 20, 40])
    expected = {
        ("contacts", "number"): 3,
        ("peak force", "5 %"): np.percentile(force, 5),
        ("peak force", "median"): 10,
        ("peak force", "mean"): force.mean(),
        ("peak force", "95 %"): np.percentile(force, 95),
        ("duration", "mean"): duration.mean(),
        ("duration", "95 %"): np.percentile(duration, 95),
        ("peak force and duration", "r²"): np.corrcoef(force, duration)[0, 1] ** 2,
    }
    for key, value in expected.items():
        assert numbers.loc[key, "recovered"] == pytest.approx(value, rel=1e-5)
    paper = numbers["paper"]
    assert paper["contacts", "number"] == 12417
    assert paper["peak force and duration", "r²"] == 0.368
    assert list(paper["peak force"]) == [1.8, 16.1, 19.6, 44.4]
    assert list(paper["duration"]) == [5, 16, 30.9, 113]
    assert numbers["truth"].isna().all()


@pytest.mark.slow
def test_truth_is_put_beside_where_there_is_one(results, tmp_path):
    truth = tmp_path / "truth"
    for video in ("one", "two"):
        rows = [{**c, "peak_force_uN": 2 * c["peak_force_uN"]} for c in CONTACTS]
        (truth / video).mkdir(parents=True)
        own = pd.DataFrame([r for r in rows if r["video"] == video])
        files.write_csv(truth / video / "contacts.csv", own, CONTACT_COLUMNS)
    figures.write_fig3(results, truth)
    numbers = pd.read_csv(results / "figures" / "fig3.csv").set_index(["quantity", "statistic"])
    ratio = numbers["truth"] / numbers["recovered"]
    assert ratio["peak force", "median"] == pytest.approx(2)
    assert ratio["duration", "median"] == pytest.approx(1)


def test_truth_beside_the_videos_is_found(results, tmp_path):
    folder = tmp_path / "session" / "mouse1"
    folder.mkdir(parents=True)
    state = whole_files.read_json(results / "run.json")
    state["inputs"]["one"]["path"] = str(folder / "film.avi")
    whole_files.write_json(results / "run.json", state)
    place = tmp_path / "session" / "truth" / "film"
    place.mkdir(parents=True)
    files.write_csv(place / "contacts.csv", pd.DataFrame([CONTACTS[0]]), CONTACT_COLUMNS)
    truth = session_numbers.read_truth(results)
    assert list(truth["video"]) == ["one"]


def test_typical_contact_is_near_the_medians_and_clean(tmp_path):
    rows = [
        contact("one", 1, 30, 10, 4.0),
        contact("one", 2, 60, 20, 10.0),
        contact("two", 1, 30, 21, 10.5, flags="slip"),
        contact("two", 2, 80, 30, 30.0),
    ]
    results = make_results(tmp_path / "results", rows)
    typical = fig3_tables.typical_contact(results, session_numbers.read_contacts(results))
    assert (typical.contact["video"], typical.contact["contact"]) == ("one", 2)
    assert typical.pole == (230, 240, 6.25)
    margin = fig3_tables.BEFORE_AFTER_MS
    assert list(typical.frames["frame"]) == list(range(60 - int(margin), 80 + int(margin)))
    assert len(typical.centrelines) == len(typical.frames)


def test_panels_a_and_b_show_the_contact(drawn):
    results, _ = drawn
    a = pd.read_csv(results / "figures" / "fig3a.csv")
    b = pd.read_csv(results / "figures" / "fig3b.csv")
    assert "True" not in (results / "figures" / "fig3a.csv").read_text()  # as in contacts.csv
    shown = a.drop_duplicates("frame").set_index("frame")["in_contact"]
    assert set(shown) == {True, False}
    assert shown.loc[61:79].all()
    assert not shown.loc[41:59].any()
    assert shown.loc[:39].all()  # the contact before
    assert a["follicle_x_mm"].unique() == pytest.approx([40 / 25])
    inside = b[b["in_contact"] & (b["time_ms"] >= 0)]
    assert inside["time_ms"].max() == 19
    # the pulse is the force itself here, but for the digits written
    np.testing.assert_allclose(inside["force_uN"], inside["pulse_uN"], atol=1e-4)
    assert b["pulse_uN"].max() == pytest.approx(10)


def test_diameters_follow_the_cone(results):
    table = fig3_tables.diameters(results)
    assert table["whisker"].unique() == ["1 C2"]
    expected = 2 * 37 * (1 - table["arc_length_mm"] / 18.947)
    np.testing.assert_allclose(table["diameter_um"], expected)
    assert table["arc_length_mm"].max() == pytest.approx(18)


def test_whiskers_look_as_in_the_time_courses():
    names = [f"w{k}" for k in range(12)]
    table = pd.DataFrame(
        [(f"1 {name}", s, 74 - s) for name in names for s in (0.0, 18.0)],
        columns=["whisker", "arc_length_mm", "diameter_um"],
    )
    axis = Figure().subplots()
    fig3_panels._panel_c(axis, SimpleNamespace(panels={"c": table}))
    styles = whisker_styles(names)
    for line in axis.lines:
        style = styles[line.get_label()]
        assert line.get_color() == style.colour
        assert tuple(line._unscaled_dash_pattern[1] or ()) == style.dash  # no public way


@given(st.lists(st.floats(0.1, 300), min_size=1, max_size=50), st.sampled_from([0.0, 1.0, 2.0]))
def test_histograms_lose_no_contact(values, step):
    table = fig3_tables.histogram(pd.Series([*values, np.nan]), "x", step)
    assert table["contacts"].sum() == len(values)
    widths = (table["x_to"] - table["x_from"]).to_numpy()
    assert widths == pytest.approx(widths[0])
    assert step == 0 or widths[0] / step == pytest.approx(round(widths[0] / step))
    assert table["x_from"].iloc[0] == 0


def test_bins_are_narrower_the_more_contacts_there_are():
    draw = np.random.default_rng(0).gamma(2, 10, 12417)  # µN
    widths = [fig3_tables.bin_width(draw[:n]) for n in (20, 300, 12417)]
    assert widths[0] > widths[1] > widths[2] > 0
    assert 20 < 100 / widths[2] < 200  # bins for the full session


def test_bins_of_durations_are_whole_frames():
    rows = [contact("one", k, 10, d, 5.0) for k, d in enumerate((6, 8, 12, 40, 90))]
    table = pd.DataFrame(rows).assign(duration_ms=[3.0, 4.0, 6.0, 20.0, 45.0])  # 2000 frames/s
    assert fig3_tables.frame_ms(table) == 0.5
    assert fig3_tables.bin_width(table["duration_ms"], 0.5) % 0.5 == 0


@pytest.mark.slow
def test_the_contact_shown_can_be_chosen(results):
    figures.write_fig3(results, video="one", contact=1)
    b = pd.read_csv(results / "figures" / "fig3b.csv")
    assert b["force_uN"][b["time_ms"].between(0, 10)].max() == pytest.approx(4, rel=0.03)
    texts = ElementTree.parse(results / "figures" / "fig3.svg").findall(".//{*}text")
    assert {"one", "C2, contact 1"} <= {"".join(text.itertext()) for text in texts}


@pytest.mark.parametrize(
    ("wanted", "message"),
    [
        (
            {"video": "four"},
            "--video four: no video of this name has contacts in .*; give one of one, two$",
        ),
        ({"whisker": "D1"}, "--whisker D1: .* one of C2"),
        ({"video": "two", "contact": 7}, "--contact 7: .* one of 1"),
    ],
)
def test_a_contact_that_there_is_not_is_refused(results, wanted, message):
    with pytest.raises(ValueError, match=message):
        figures.write_fig3(results, **wanted)


def test_r_squared_needs_three_points_that_differ():
    x = pd.Series([1.0, 2, 3, np.nan])
    assert session_numbers.r_squared(x, pd.Series([2.0, 4, 6, 1])) == pytest.approx(1)
    assert np.isnan(session_numbers.r_squared(x[:2], x[:2]))
    assert np.isnan(session_numbers.r_squared(x, pd.Series([1.0, 1, 1, 1])))


@pytest.mark.slow
@pytest.mark.parametrize("videos", [("one",), ()])
def test_without_contacts_there_are_still_figures(tmp_path, videos):
    results = make_results(tmp_path / "results", (), videos)
    figures.write_fig3(results)
    numbers = pd.read_csv(results / "figures" / "fig3.csv").set_index(["quantity", "statistic"])
    assert numbers.loc[("contacts", "number"), "recovered"] == 0
    assert np.isnan(numbers.loc[("duration", "median"), "recovered"])
    assert pd.read_csv(results / "figures" / "fig3f.csv").empty


@pytest.mark.slow
def test_contacts_without_forces_are_counted_and_drawn(tmp_path):
    rows = [contact("one", 1, 30, 10, np.nan, pulse_r2=np.nan)]
    results = make_results(tmp_path / "results", rows)
    figures.write_fig3(results)
    numbers = pd.read_csv(results / "figures" / "fig3.csv").set_index(["quantity", "statistic"])
    assert numbers.loc[("contacts", "number"), "recovered"] == 1
    assert numbers.loc[("duration", "median"), "recovered"] == 10


def test_a_folder_without_results_is_refused(tmp_path):
    with pytest.raises(ValueError, match="is an empty folder: expected results"):
        figures.write_fig3(tmp_path)


def test_a_folder_without_these_videos_truth_is_refused(tmp_path):
    results = make_results(tmp_path / "results")
    (tmp_path / "empty").mkdir()
    for folder, message in ((tmp_path / "empty", "is an empty folder: expected true tables"),
                            (tmp_path, "no true tables of these videos in it")):  # fmt: skip
        with pytest.raises(ValueError, match=message):
            figures.write_fig3(results, folder)
