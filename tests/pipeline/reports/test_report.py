"""report.html: one file, nothing from outside, everything that was promised on it."""

import html
import re
from urllib.parse import unquote

import numpy as np
import pandas as pd
import pytest
from results_folder import CONTACTS, SETTINGS, contact, frame_table, make_results

from pipeline.contacts.base_moments import add_base_moments
from pipeline.errors import VideoError
from pipeline.reports import figures, overlay, report, stills, vibration_map
from pipeline.reports.session_numbers import read_contacts
from pipeline.reports.time_courses import read_courses
from pipeline.reports.whisker_styles import whisker_styles
from pipeline.session.session_file import settings_from, write_session
from pipeline.tables import files
from pipeline.tables.columns import CONTACT_COLUMNS, DECISION_COLUMNS, VIDEO_COLUMNS, as_table


def page_of(results) -> str:
    """The text of the report that is written into a results folder."""
    assert not report.write_report(results)  # nothing that a person has changed
    return (results / "report.html").read_text("utf-8")


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """A results folder with figures and report, to be read."""
    results = make_results(tmp_path_factory.mktemp("reported") / "results")
    figures.write_fig3(results)
    report.write_report(results)
    return results


@pytest.fixture(scope="module")
def page(results):
    """Its report."""
    return (results / "report.html").read_text("utf-8")


def test_nothing_comes_from_outside(page):
    assert "http" not in re.sub(r"data:[^\"]*", "", page)
    assert "<script" not in page
    assert not re.search(r"src=[\"'](?!data:)", page)


def test_links_lead_to_files_of_the_results(page, results):
    links = re.findall(r"href=[\"'](?!#)([^\"'#]*)", page)
    assert {"contacts.csv", "videos.csv", "one/frames.parquet", "figures/courses/one.html"} <= set(
        links
    )
    assert all((results / unquote(link)).is_file() for link in links)


def test_the_end_of_a_contact_is_explained(page, results):
    for text in (page, (results / "figures" / "courses" / "one.html").read_text("utf-8")):
        assert "shaded, with the numbers of their first frame and of the first one after" in text


def test_videos_with_their_messages(page):
    assert ">one<" in page
    assert ">two<" in page
    assert html.escape("<b> & broken") in page
    assert "<b> & broken" not in page
    assert "2</b>videos; 1 more failed" in page
    assert "100.0 %" in page
    assert "share of the frames in which a whisker is seen" in page


def test_messages_of_few_videos_are_all_seen_at_once(tmp_path, page, monkeypatch):
    assert '<div class="tall">' not in page
    monkeypatch.setattr(report, "STACKS", 0)
    results = make_results(tmp_path / "results")
    assert '<div class="tall">' in page_of(results)


def test_pages_that_a_person_has_changed_are_kept_and_said(tmp_path):
    results = make_results(tmp_path / "results")
    page_of(results)
    pages = results / "figures" / "courses" / "one.html", results / "report.html"
    for page in pages:
        page.write_text(page.read_text("utf-8") + "my notes", "utf-8")
    kept = [page.with_name(f"{page.name}.old") for page in pages]
    assert report.write_report(results) == [
        f"{page} was changed since whiskerforce wrote it: it is kept as {old}; take from there "
        "what you need" for page, old in zip(pages, kept, strict=True)
    ]  # fmt: skip
    assert all(old.read_text("utf-8").endswith("my notes") for old in kept)
    page_of(results)


def test_the_main_doubts_come_first(tmp_path):
    results = make_results(tmp_path / "results", ())
    videos = files.read_csv(results / "videos.csv", VIDEO_COLUMNS)
    row = videos.iloc[:1].assign(message="names (of C1; C2) are in doubt; no forces: no length_mm")
    files.write_csv(results / "videos.csv", pd.concat([row] * 5), VIDEO_COLUMNS)
    page = page_of(results)
    head = page[: page.index("<h2")]
    assert head.count("names (of C1; C2) are in doubt.") == report.DOUBTS
    assert "no forces" not in head
    assert "2 more\nvideos have messages" in head


def test_videos_without_a_pole_are_named_together_at_the_head(tmp_path):
    results = make_results(tmp_path / "results", ())
    row = files.read_csv(results / "videos.csv", VIDEO_COLUMNS).iloc[:1]
    name, seen = row["video"].iloc[0], ("a paw", "a tuft")
    missing = [
        row.assign(message=f"no pole of 0.5 mm found, so no contacts; {each}") for each in seen
    ]
    other = row.assign(message="names are in doubt")
    files.write_csv(
        results / "videos.csv", pd.concat([missing[0], other, missing[1]]), VIDEO_COLUMNS
    )
    page = page_of(results)
    head = page[: page.index("<h2")]
    assert f"<b>{name}, {name}</b>: no pole of 0.5 mm found, so no contacts." in head
    assert "names are in doubt." in head
    assert "more\nvideo" not in head
    assert all(each in page for each in seen)  # in the table of videos


def test_contacts_of_the_trials_have_the_colours_of_the_time_courses(tmp_path, monkeypatch):
    results, given = make_results(tmp_path / "results"), {}

    def with_another(*of):
        frames = read_courses(*of)
        return pd.concat([frames.assign(whisker=name) for name in ("C1", "C2")])

    def draw(videos, contacts, styles):
        given.update(styles)

    monkeypatch.setattr(report, "read_courses", with_another)
    monkeypatch.setattr(report, "raster", draw)
    page_of(results)
    assert given == whisker_styles(["C1", "C2"])


@pytest.mark.parametrize(
    ("rows", "said"),
    [(CONTACTS[1:], "1 contact in every video."), (CONTACTS, "1.5 contacts a video on average")],
)
def test_how_many_contacts_a_video_has(tmp_path, rows, said):
    assert said in page_of(make_results(tmp_path / "results", rows))


def test_decisions_are_counted_at_the_head(tmp_path, page):
    results = make_results(tmp_path / "r")
    row = {"video": "one", "whisker": "C2", "decision": "no contact"}
    decided = as_table(pd.DataFrame([row]), DECISION_COLUMNS)
    files.write_csv(results / "decisions.csv", decided, DECISION_COLUMNS)
    said = "Corrections: 1 decision in one"
    assert said in page_of(results)
    assert said not in page


def test_what_failed_comes_before_what_is_doubtful(tmp_path):
    results = make_results(tmp_path / "results", ())
    row = files.read_csv(results / "videos.csv", VIDEO_COLUMNS).iloc[:1]
    doubtful, failed = row.assign(message="no pole"), row.assign(status="failed", message="broken")
    files.write_csv(
        results / "videos.csv", pd.concat([*[doubtful] * report.DOUBTS, failed]), VIDEO_COLUMNS
    )
    page = page_of(results)
    head = page[: page.index("<h2")]
    assert head.index("broken") < head.index("no pole")


def test_numbers_figure_flags_settings_and_version(page):
    assert "data:image/svg+xml;base64," in page
    assert "12417" in page
    assert "large_deflection" in page
    assert "not_half_gaussian" in page
    assert "two frame 50" in page  # at its peak
    assert "base_radius_um = 37.0" in page
    assert "9.9" in page
    assert "Which contacts ring?" in page


def test_without_contacts_and_figures(tmp_path):
    results = make_results(tmp_path / "results", ())
    page = page_of(results)
    assert ">one<" in page
    assert "Which contacts ring?" not in page
    assert ">Contacts<" not in page


def test_without_contacts_the_traced_frames_are_shown(tmp_path, monkeypatch):
    results = make_results(tmp_path / "results", ())
    path = results / "one" / "frames.parquet"
    frames = pd.concat([files.read_frames(path).assign(whisker=name) for name in ("C1", "C2")])
    sure = frames["frame"].between(50, 51) | (frames["frame"].eq(53) & frames["whisker"].eq("C1"))
    frames["confidence"] = np.where(sure, 0.9, 0.1)
    frames["tracked"] = frames["frame"] != 50
    files.write_frames(path, frames)
    asked = []

    def stills(folder, path, frames, settings, whole):
        asked.append((folder.name, list(frames), whole))
        return [np.zeros((20, 30, 3), np.uint8)]

    monkeypatch.setattr(overlay, "stills", stills)
    figures.write_fig3(results)
    page = page_of(results)
    assert asked[0] == ("one", [51], True)  # in 50 nothing is tracked
    assert "one, frame 51: 2 whiskers traced<" in page
    assert "No contact was found. Blue: a whisker; grey, dashed: not sure" in page
    assert "image/svg+xml" not in page  # no empty plots
    assert 'class="row lanes"' not in page


def test_pictures_are_of_the_contacts(tmp_path, monkeypatch):
    asked = []

    def stills(folder, path, frames, settings):
        asked.extend((folder.name, frame) for frame in frames)
        return [np.zeros((20, 30, 3), np.uint8) for _ in frames]

    monkeypatch.setattr(overlay, "stills", stills)
    page = page_of(make_results(tmp_path / "results"))
    assert asked == [("one", 35), ("one", 70), ("two", 50)]  # each video is opened once
    assert page.count("data:image/jpeg") == len(CONTACTS)
    captions = dict.fromkeys(re.findall(r"(one|two), frame (\d+):", page))
    assert list(captions) == [("one", "35"), ("two", "50"), ("one", "70")]  # of each video first
    assert "peak 30\u00a0µN, 40\u00a0ms" in page


def test_no_picture_is_of_another_video_of_that_name(tmp_path, monkeypatch):
    def is_another(folder, path):
        raise VideoError(path, "is another")

    monkeypatch.setattr(stills, "check_video", is_another)
    monkeypatch.setattr(overlay, "stills", lambda *_: [np.zeros((20, 30, 3), np.uint8)])
    page = page_of(make_results(tmp_path / "results"))
    assert "data:image/jpeg" not in page


def test_videos_that_are_gone_leave_no_gap(page):
    assert "data:image/jpeg" not in page  # the inputs of these results do not exist
    assert "What was found" not in page


# --- error budget ----------------------------------------------------------------------------


def test_budget_is_on_the_page(tmp_path):
    contacts = [{**c, "radius_uN_per_percent": 0.04 * c["peak_force_uN"]} for c in CONTACTS]
    results = make_results(tmp_path / "r", contacts)
    page = page_of(results)
    row = re.search(r"base radius</span>.*", page).group()
    assert "assumed" in row
    assert ">1 %<" in row
    assert ">4.0 %<" in row


def test_no_budget_without_dimensions(tmp_path):
    contacts = [contact("one", 1, 30, 10, np.nan, flags="doubtful")]
    results = make_results(tmp_path / "r", contacts)
    recording = SETTINGS.recording.model_dump()
    bare = settings_from({"recording": recording, "whisker": [{"name": "C2"}]})
    for name in ("one", "two"):
        write_session(results / name / "session.toml", bare)
    page = page_of(results)
    assert "No contact has a force: for that" in page
    assert "base radius" not in page
    assert "nan" not in re.sub(r"data:[^\"]*", "", page)


# --- trials, ringing, flags ------------------------------------------------------------------


def test_contacts_per_trial(page, tmp_path):
    assert "1.5 contacts a video on average, from 1 to 2." in page
    results = make_results(tmp_path / "r", CONTACTS[:2])
    other = page_of(results)
    assert "1 contacts a video on average, from 0 to 2;\n1 without any." in other


def test_ringing_contacts_are_counted_and_named(tmp_path):
    contacts = [
        contact("one", 1, 10, 2, 4.0, vibration_ratio=1.3),
        contact("one", 2, 60, 20, 10.0, vibration_ratio=0.05),
        contact("two", 1, 30, 5, 30.0, vibration_ratio=0.4),
        contact("two", 2, 60, 5, 30.0, vibration_ratio=np.nan),
    ]
    page = page_of(make_results(tmp_path / "r", contacts))
    text = " ".join(page.split())
    assert "the largest steady one in 1 of 3 contacts: they ring." in text
    assert "In 1 more it is more than a tenth" in text
    most = text[text.index("ringing most") :]
    assert most.index("one C2, contact 1") < most.index("two C2, contact 1")
    assert "two C2, contact 2" not in most


def test_one_is_one_contact_and_not_contacts(tmp_path):
    results = make_results(tmp_path / "r")
    table = files.read_csv(results / "contacts.csv", CONTACT_COLUMNS).head(1)
    files.write_csv(results / "contacts.csv", table.assign(vibration_ratio=0.2), CONTACT_COLUMNS)
    page = page_of(results)
    assert "<b>1</b>contact</div>" in page
    assert "in none of 1 contact. In 1 it is" in " ".join(page.split())


def test_map_agrees_with_the_table_of_contacts(tmp_path):
    rows = [
        contact("one", 1, 10, 3, 4.0, contact_arc_length_mm=12.0, peak_base_moment_nN_m=-9.0),
        contact("one", 2, 60, 20, 10.0, contact_arc_length_mm=7.0, peak_base_moment_nN_m=9.0),
    ]
    table = files.as_table(pd.DataFrame(rows), CONTACT_COLUMNS)
    whisker = SETTINGS.whisker[0].si()
    recording = SETTINGS.recording.si()
    table = add_base_moments(table, frame_table(rows), {"C2": whisker}, recording)
    on_map = np.diagonal(vibration_map.ratio_grid(whisker, [3.0, 20.0], [12.0, 7.0]))
    np.testing.assert_allclose(on_map, table["vibration_ratio"], rtol=1e-3)
    assert on_map[0] > 10 * on_map[1]


def test_flags_lead_to_stills_of_bounded_number(tmp_path, monkeypatch):
    picture = np.zeros((20, 30, 3), np.uint8)
    monkeypatch.setattr(overlay, "stills", lambda *a: [picture] * len(a[2]))
    contacts = [contact("one", n, 3 * n, 2, 5.0, flags=f"flag_{n % 6}; all") for n in range(1, 36)]
    page = page_of(make_results(tmp_path / "r", contacts))
    links = re.findall(r'href="#(contact-[^"]*)"', page)
    ids = re.findall(r' id="(contact-[^"]*)"', page)
    assert len(links) > report.STILLS
    assert set(links) <= set(ids)
    assert len(ids) == len(set(ids)) == report.PICTURES + report.STILLS
    assert "2\u00a0ms; flag_1, all" in page


def test_flags_without_videos_have_no_dead_links(page):
    assert 'href="#contact-' not in page


def test_peak_frame_is_where_the_force_is_largest(tmp_path):
    results = make_results(tmp_path / "r")
    path = results / "one" / "frames.parquet"
    table = files.read_frames(path)
    table.loc[62, "contact_force_uN"] = 12.0
    files.write_frames(path, table)
    found = stills.with_peaks(results, read_contacts(results))
    assert found["peak_frame"].tolist() == [35, 62, 50]


def test_lines_of_no_known_whisker_are_not_lost_ones(tmp_path):
    frames = pd.DataFrame(
        {
            "whisker": ["w1", "w1", "w2", "w2"],
            "tracked": [True, False, True, False],
            "confidence": [0.9, 0.0, 0.4, 0.0],
        }
    )
    row = report._video_row(tmp_path, {"video": "one"}, frames, ())
    assert (row["tracked"], row["lost"]) == (0.5, 1)
