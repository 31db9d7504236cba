"""The report as people see it: on a wide and a narrow screen, and printed."""

import re

import numpy as np
import pandas as pd
import pytest
from browser import overlapping, word_faults, write_pdf
from headless import show
from printed import filled, ink_below, need_poppler, pages_of
from results_folder import contact, frame_table, make_results

from pipeline.reports import figures, overlay, report
from pipeline.tables import files
from pipeline.tables.columns import CONTACT_FLAGS, VIDEO_COLUMNS

pytestmark = pytest.mark.slow

WIDTHS = 1300, 420  # px
NAMES = ("mouse_0123456789_2024-11-22_session_3_trial_0042", "b", "c", "d")
WHISKERS = ("C1", "C2", "C3", "Delta")
FULL = 0.5  # of a page, that must be used, but for the last
BEHIND_HEADING = 12  # rows of ink (of 40 to the inch) that must follow a heading on its page


def session_contacts():
    """Contacts of four whiskers in four videos, with all flags there are."""
    rng = np.random.default_rng(1)
    flags = list(CONTACT_FLAGS)
    return [
        contact(video, k + 1, 5 + 12 * k, 4 + k, 10 ** rng.uniform(-0.5, 2), whisker=whisker,
                flags=flags[(k + n) % len(flags)], vibration_ratio=10 ** rng.uniform(-2, 0),
                contact_arc_length_mm=rng.uniform(5, 12), peak_force_se_uN=0.3,
                radius_uN_per_percent=0.4)
        for n, video in enumerate(NAMES)
        for k in range(8)
        for whisker in (WHISKERS[k % len(WHISKERS)],)
    ]  # fmt: skip


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    """Path of a report with all that a report can have."""
    contacts = session_contacts()
    results = make_results(tmp_path_factory.mktemp("session") / "results", contacts, NAMES)
    for name in NAMES:
        own = {
            w: [c for c in contacts if c["video"] == name and c["whisker"] == w] for w in WHISKERS
        }
        tables = [frame_table(rows).assign(whisker=w) for w, rows in own.items()]
        table = pd.concat(tables).sort_values(["frame", "whisker"], kind="stable")
        files.write_frames(results / name / "frames.parquet", table)
        (results / name / "overlay.mp4").touch()
    videos = files.read_csv(results / "videos.csv", VIDEO_COLUMNS)
    videos["message"] = "no forces: the whisker's length_mm, cone_length_mm are not given; " * 2
    files.write_csv(results / "videos.csv", videos, VIDEO_COLUMNS)
    with pytest.MonkeyPatch.context() as patch:
        picture = np.full((516, 640, 3), 120, np.uint8)
        patch.setattr(overlay, "stills", lambda *a: [picture] * len(a[2]))
        figures.write_fig3(results)
        report.write_report(results)
    return results / "report.html"


@pytest.mark.parametrize("width", WIDTHS)
def test_no_word_is_cut_or_upon_another(driver, page, width):
    for path in (page, page.parent / "figures" / "courses" / f"{NAMES[0]}.html"):
        show(driver, path.as_uri(), width)
        assert word_faults(driver) == []
        scrolled = driver.execute_script("return document.documentElement.scrollWidth")
        assert scrolled <= width


@pytest.mark.parametrize("width", WIDTHS)
def test_every_picture_is_there_and_inside(driver, page, width):
    show(driver, page.as_uri(), width)
    script = """return [...document.querySelectorAll("img, svg")].map(each => {
        const r = each.getBoundingClientRect();
        return [each.naturalWidth ?? 1, r.left, r.right, r.height]; })"""
    pictures = driver.execute_script(script)
    assert len(pictures) > 20
    for natural, left, right, height in pictures:
        assert natural > 0
        assert left >= 0
        assert right <= width
        assert height > 10


def test_a_click_on_a_contact_opens_its_stretch_of_the_overlay(driver, page):
    show(driver, page.as_uri(), 1300)
    before = driver.current_window_handle
    shade = driver.find_element(
        "css selector", "section:nth-of-type(2) .row:nth-of-type(3) a rect"
    )
    driver.execute_script("arguments[0].scrollIntoView({block: 'center'})", shade)
    shade.click()
    other = next(handle for handle in driver.window_handles if handle != before)
    driver.switch_to.window(other)
    address = driver.current_url
    driver.close()
    driver.switch_to.window(before)
    assert re.search(r"/b/overlay\.mp4#t=0\.00,0\.96$", address)  # frames 5 to 9, 25 frames/s


def test_printed_no_word_is_lost_and_no_page_half_empty(driver, page, tmp_path):
    need_poppler()
    show(driver, page.as_uri(), 1300)
    headings = driver.execute_script(
        "return [...document.querySelectorAll('h2, h3')].map(h => h.innerText.split(/\\s/))"
    )
    write_pdf(driver, tmp_path / "report.pdf")
    pages = pages_of(tmp_path / "report.pdf")
    for number, printed in enumerate(pages, 1):
        width, height = printed["size"]
        assert overlapping(printed["words"]) == [], number
        for word, left, top, right, bottom in printed["words"]:
            assert left >= 0, word
            assert right <= width, word
            assert top >= 0, word
            assert bottom <= height, word
        if number < len(pages):
            assert filled(printed) > FULL, number
    for heading in headings:
        followed = [ink_below(p, bottom) for p in pages for bottom in _places(p, heading)]
        assert followed, heading
        assert max(followed) > BEHIND_HEADING, heading


def _places(page, heading):
    """Lower edges [pt] of the places of a page where the words of a heading stand in a line."""
    words = page["words"]
    for k in range(len(words) - len(heading) + 1):
        if [word[0] for word in words[k : k + len(heading)]] == heading:
            yield words[k + len(heading) - 1][4]
