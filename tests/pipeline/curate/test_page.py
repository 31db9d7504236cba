"""The page, served and in a real browser."""

import http.client
import itertools
import logging
import re
import shutil
import socket
import subprocess
import sys
import threading
import time
from urllib.parse import urlsplit

import numpy as np
import pytest
from bokeh.document import Document
from browser import show_as_before, word_faults
from curated import FRAMES, PATIENCE_S, contacts_of, edges, opened
from headless import show

from pipeline.contacts.corrections import read_corrections
from pipeline.curate import curate
from pipeline.curate.decisions import user_name
from pipeline.curate.keys import KEYS
from pipeline.curate.page import Page
from pipeline.curate.panels import panels
from pipeline.errors import InputError
from pipeline.runtime.folder_lock import locked
from pipeline.tables.result_exchange import draft, is_settled

pytestmark = pytest.mark.e2e


@pytest.fixture
def served(results):
    """A running page: (its server, the results folder)."""
    server = curate(results, open_browser=False, block=False, say=lambda line: None)
    yield server, results
    server.stop()


def test_served_on_this_computer_only(served):
    host, port = served[0]._socket.getsockname()
    assert host == "127.0.0.1"
    others = {info[4][0] for info in socket.getaddrinfo(socket.gethostname(), None)}
    for other in others - {"127.0.0.1", "127.0.1.1", "::1"}:
        family = socket.AF_INET6 if ":" in other else socket.AF_INET
        with socket.socket(family) as probe:
            probe.settimeout(1)
            assert probe.connect_ex((other, port)) != 0


def _asked(served, path="", **headers):
    """Answer to a GET request: (connection, response)."""
    url = urlsplit(served[0].url)
    connection = http.client.HTTPConnection(url.hostname, url.port, timeout=PATIENCE_S)
    connection.request("GET", url.path + path, headers=headers)
    return connection, connection.getresponse()


def _websocket(served, origin, token):
    """Status of the answer to a websocket's request, and the first byte that came after it."""
    url = urlsplit(served[0].url)
    connection, response = _asked(
        served, "/ws", Origin=origin.format(port=url.port), Upgrade="websocket",
        Connection="Upgrade", **{
            "Sec-WebSocket-Version": "13", "Sec-WebSocket-Key": "AAAAAAAAAAAAAAAAAAAAAA==",
            "Sec-WebSocket-Protocol": f"bokeh, {token}",
        },
    )  # fmt: skip
    # through the buffer: the first message may have come together with the header
    first = response.fp.read(1) if response.status == 101 else b""
    connection.close()
    return response.status, first


TEXT, CLOSE = b"\x81", b"\x88"  # kinds of websocket messages


@pytest.mark.parametrize(
    ("origin", "status"), [("http://127.0.0.1:{port}", 101), ("http://elsewhere.example", 403)]
)
def test_pages_from_elsewhere_get_no_websocket(served, origin, status):
    page = _asked(served)[1].read().decode()
    token = re.search(r'"token":"([^"]+)"', page)[1]
    assert _websocket(served, origin, token) == (status, TEXT if status == 101 else b"")


def test_forged_session_tokens_are_refused(served):
    from bokeh.util.token import generate_jwt_token, generate_session_id

    forged = generate_jwt_token(generate_session_id())
    signed = generate_jwt_token(
        generate_session_id(secret_key=b"mine", signed=True), secret_key=b"mine", signed=True
    )
    for token in (forged, signed):
        status, first = _websocket(served, "http://127.0.0.1:{port}", token)
        assert (status, first) in [(101, CLOSE), (101, b""), (403, b"")]


@pytest.mark.parametrize(
    ("host", "status"),
    [("127.0.0.1:{port}", 200), ("localhost:{port}", 200), ("evil.example", 403)],
)
def test_only_who_calls_this_computer_by_its_name_is_answered(served, host, status):
    port = urlsplit(served[0].url).port
    assert _asked(served, Host=host.format(port=port))[1].status == status


@pytest.mark.parametrize(
    "path",
    ["/../run.json", "/..%2f..%2frun.json", "//etc/passwd", "/static/js/../../../../etc/passwd"],
)
def test_no_file_of_the_disk_is_served(served, path):
    assert _asked(served, path)[1].status in (400, 403, 404)


def test_the_page_needs_nothing_from_the_internet(served):
    url = urlsplit(served[0].url)
    connection = http.client.HTTPConnection(url.hostname, url.port, timeout=PATIENCE_S)
    connection.request("GET", url.path)
    page = connection.getresponse().read().decode()
    connection.close()
    assert 'id="picture"' in page
    for attribute in ('src="http', 'href="http', "@import"):
        outside = [part[:60] for part in page.split(attribute)[1:] if "127.0.0.1" not in part[:40]]
        assert not outside


def test_a_page_that_is_closed_prints_no_warning(served, caplog):
    logging.getLogger("bokeh.server.views.ws").warning("connection was closed")
    assert caplog.records == []


def test_a_port_that_is_taken_is_reported(served, tmp_path):
    port = served[0]._socket.getsockname()[1]
    other = shutil.copytree(served[1], tmp_path / "other")
    with pytest.raises(
        InputError, match=f"--port {port}: cannot serve there.*leave --port out for any"
    ):
        curate(other, port=port, open_browser=False, block=False)


def test_a_folder_is_curated_by_one_and_not_while_a_run_is_at_work(results):
    def open_page():
        return curate(results, open_browser=False, block=False, say=lambda line: None)

    with locked(results), pytest.raises(InputError, match="another whiskerforce is using it"):
        open_page()
    server = open_page()
    with pytest.raises(InputError, match="another whiskerforce is using it"):
        open_page()
    server.stop()
    open_page().stop()


def test_results_of_a_killed_run_are_put_in_place_first(results):
    folder = results / first_video(results)
    files = list(folder.iterdir())
    with draft(folder) as new:
        for path in files:
            shutil.move(path, new)
    curate(results, open_browser=False, block=False, say=lambda line: None).stop()
    assert is_settled(folder)
    assert (folder / "evidence.parquet").is_file()


def test_a_page_ends_where_tables_cannot_be_written(served, monkeypatch):
    """As in a folder made read-only: what cannot be written is tried again, and named."""
    server, results = served

    def refuse(*_):
        raise PermissionError(13, "Permission denied", "contacts.csv")

    monkeypatch.setattr("pipeline.curate.results.files.replace_csv", refuse)
    name = first_video(results)
    review = server.results.video(name).review
    review.delete(review.spans[0])
    end = threading.Thread(target=server.stop, daemon=True)
    end.start()
    end.join(PATIENCE_S)
    assert not end.is_alive()
    assert list(server.results.faults) == [name]
    assert len(read_corrections(results / name)) == 1


def test_a_row_that_was_clicked_is_that_contact_whatever_the_list_has_become(results):
    """As where another tab has added a contact, or the answer to the last key has not come yet."""
    with opened(results) as folder:
        page = Page(Document(), folder, finish=None)
        before = page.desk.items
        rows = re.findall(r'data-do="(item:[^"]+)"', panels(page.desk)["items"])
        page.desk.video.review.add(page.desk.whisker, 0, 1)
        page._obey(rows[-1])
        assert page.desk.selected == before[-1].span


# ---- in a browser --------------------------------------------------------------------------


class Tab:
    """A browser tab with the page, and a person's hands."""

    def __init__(self, driver, url):
        self.driver = driver
        driver.get(url)
        self.wait(lambda: self.answered() > 0)

    def answered(self):
        return self.driver.execute_script("return +(document.body.dataset.answered ?? 0)")

    def wait(self, condition):
        deadline = time.monotonic() + PATIENCE_S
        while not condition():
            assert time.monotonic() < deadline, f"the page does not come to it: {self.message}"
            time.sleep(0.02)

    def press(self, *keys):
        """Type keys, one after the other; wait for the answer to each."""
        from selenium.webdriver.common.action_chains import ActionChains

        for key in keys:
            before = self.answered()
            *held, last = (key,) if isinstance(key, str) else key
            chain = ActionChains(self.driver)
            for each in held:
                chain.key_down(each)
            chain.send_keys(last)
            for each in held:
                chain.key_up(each)
            chain.perform()
            self.wait(lambda before=before: self.answered() > before)

    def click(self, selector):
        """Click in the middle of an element, wherever it is by then."""
        from selenium.webdriver.common.action_chains import ActionChains

        before = self.answered()
        script = """
            const place = document.querySelector(arguments[0]).getBoundingClientRect();
            return [place.x + place.width / 2, place.y + place.height / 2]"""
        x, y = self.driver.execute_script(script, selector)
        body = self.driver.find_element("tag name", "body")
        at = body.size["width"] / 2, body.size["height"] / 2
        ActionChains(self.driver).move_to_element_with_offset(
            body, x - at[0], y - at[1]
        ).click().perform()
        self.wait(lambda: self.answered() > before)

    def text(self, selector):
        """What an element says; at once, as the page may make it anew at any time."""
        return self.driver.execute_script(
            "return document.querySelector(arguments[0]).innerText", selector
        )

    def chosen_video(self):
        return self.driver.execute_script("return document.querySelector('#video select').value")

    @property
    def message(self):
        return self.text("#message")

    @property
    def frame(self):
        return int(self.text("#badge b"))

    def rows(self):
        """Onset and end of every contact in the list, with the row's class."""
        script = """return [...document.querySelectorAll('#items tbody tr')].map(
            r => [...r.querySelectorAll('td')].map(c => c.textContent.trim())
                .concat(r.className))"""
        return [(int(r[1]), int(r[2]), r[-1].split()) for r in self.driver.execute_script(script)]

    def picture(self):
        """What the picture shows, as grey levels (rows, columns), without what is drawn on it."""
        script = """
            const plot = Bokeh.documents[0].get_model_by_name('picture');
            const image = plot.renderers[0].data_source.data.image[0];
            return [Array.from(image), image.shape]"""
        levels, shape = self.driver.execute_script(script)
        return np.array(levels, np.uint8).reshape(shape)

    def click_course(self, name, frame):
        """Click into a time course at a frame, by the plot's own scale."""
        from selenium.webdriver.common.action_chains import ActionChains

        script = """
            const view = Bokeh.index.get_by_id(
                Bokeh.documents[0].get_model_by_name(arguments[0]).id);
            return [view.frame.x_scale.compute(arguments[1]), view.frame.bbox.vcenter]"""
        x, y = self.driver.execute_script(script, name, frame)
        place = self.driver.find_element("id", name)
        dx, dy = x - place.size["width"] / 2, y - place.size["height"] / 2
        ActionChains(self.driver).move_to_element_with_offset(place, dx, dy).click().perform()

    def faults(self):
        """Errors that the browser has logged since the last call."""
        return [e["message"] for e in self.driver.get_log("browser") if e["level"] == "SEVERE"]


@pytest.fixture
def tab(driver, served):
    page = Tab(driver, served[0].url)
    page.faults()
    yield page
    assert page.faults() == []


def first_video(results):
    return contacts_of(results)["video"].iloc[0]


def test_the_picture_is_the_videos_frame(tab, served, video):
    from selenium.webdriver.common.keys import Keys

    tab.press(Keys.HOME)
    assert tab.frame == 0
    tab.press(Keys.ARROW_RIGHT, Keys.ARROW_RIGHT, Keys.ARROW_LEFT)
    assert tab.frame == 1
    tab.press((Keys.SHIFT, Keys.ARROW_RIGHT), Keys.PAGE_DOWN)
    assert tab.frame == 111
    tab.wait(lambda: np.array_equal(tab.picture(), video[1][111]))
    tab.press(Keys.END)
    assert tab.frame == FRAMES - 1
    tab.wait(lambda: np.array_equal(tab.picture(), video[1][FRAMES - 1]))


def test_a_held_key_keeps_up(tab):
    """A hundred strokes without waiting arrive, in order, and none is lost."""
    from selenium.webdriver.common.action_chains import ActionChains
    from selenium.webdriver.common.keys import Keys

    tab.press(Keys.HOME)
    ActionChains(tab.driver, duration=0).send_keys(Keys.ARROW_RIGHT * 100).perform()
    tab.wait(lambda: tab.frame == 100)


def test_playing_goes_on_until_stopped(tab):
    from selenium.webdriver.common.action_chains import ActionChains
    from selenium.webdriver.common.keys import Keys

    tab.press(Keys.HOME)
    ActionChains(tab.driver).send_keys(Keys.SPACE).perform()
    tab.wait(lambda: tab.frame > 5)
    ActionChains(tab.driver).send_keys(Keys.SPACE).perform()
    time.sleep(0.5)
    stopped = tab.frame
    time.sleep(0.5)
    assert tab.frame == stopped


def test_a_page_that_is_ready_twice_asks_for_its_parts_once(tab):
    """Else the answer to the second question is taken for that to the next key."""
    tab.driver.execute_script("""
        const doc = Bokeh.documents[0];
        window.curate.connect(doc.get_model_by_name('inbox'), doc.get_model_by_name('panel'))""")
    tab.press("?", "?")
    assert tab.answered() == 3  # the page's own question, and two keys


def test_delete_undo_redo_by_keys(tab, served):
    from selenium.webdriver.common.keys import Keys

    results = served[1]
    before = tab.rows()
    chosen = next(row for row in before if "selected" in row[2])[:2]
    tab.press(Keys.DELETE)
    name = first_video(results)
    assert "deleted" in tab.message
    assert read_corrections(results / name)["verdict"].tolist() == ["free"]  # at once
    assert [row[2][0] for row in tab.rows() if row[:2] == chosen] == ["dismissed"]
    tab.press((Keys.CONTROL, "z"))
    # on a busy machine, the answer waited for may still be that to the key before
    tab.wait(lambda: read_corrections(results / name).empty)
    tab.wait(lambda: [row[:2] for row in tab.rows()] == [row[:2] for row in before])
    tab.press("r")
    served[0].results.settle()
    assert chosen not in edges(contacts_of(results, name))


def test_add_and_move_a_contact_by_keys(tab, served):
    """The longest contact is deleted, put in again a little shorter, and both edges are moved."""
    from selenium.webdriver.common.keys import Keys

    server, results = served
    name = first_video(results)
    onset, offset, _ = max(tab.rows(), key=lambda row: row[1] - row[0])
    tab.press(Keys.HOME, Keys.ESCAPE)
    while tab.frame != onset:
        tab.press(Keys.ARROW_DOWN)
    tab.press("x", Keys.ARROW_RIGHT, Keys.ARROW_RIGHT, "a")
    assert f"from frame {onset + 2}" in tab.message
    tab.press(Keys.ARROW_RIGHT, Keys.ARROW_RIGHT, Keys.ARROW_RIGHT, "a")
    assert (onset + 2, onset + 5) in [row[:2] for row in tab.rows()]
    tab.press(Keys.ARROW_RIGHT, "o", "e", Keys.ARROW_LEFT, "i")
    moved = (onset + 1, onset + 6)
    assert moved in [row[:2] for row in tab.rows()]
    server.results.settle()
    row = contacts_of(results, name).query("onset_frame == @moved[0]").squeeze()
    assert (row["offset_frame"], row["curated"]) == (moved[1], True)
    assert row["peak_force_uN"] > 0
    assert (onset, offset) not in edges(contacts_of(results))


def test_clicks_do_what_keys_do(tab, served):
    from selenium.webdriver.common.keys import Keys

    results = served[1]
    onset, offset = tab.rows()[1][:2]
    tab.press(Keys.HOME, Keys.ESCAPE)
    middle = (onset + offset) // 2
    tab.click_course("overview", middle)
    tab.wait(lambda: abs(tab.frame - middle) <= 1)
    assert "selected" in tab.rows()[1][2]
    tab.click_course("force", middle + 1)
    tab.wait(lambda: tab.frame == middle + 1)
    tab.click("#items tbody tr:first-child")
    assert tab.frame == tab.rows()[0][0]
    tab.click('nav button[data-do="delete"]')
    assert read_corrections(results / first_video(results))["verdict"].tolist() == ["free"]
    tab.click('nav button[data-do="undo"]')
    assert read_corrections(results / first_video(results)).empty


def test_help_and_videos(tab, served):
    from selenium.webdriver.common.keys import Keys

    names = served[0].results.names
    assert not tab.driver.find_element("id", "help").is_displayed()
    tab.press("?")
    shown = tab.text("#help")
    assert all(key.meaning in shown for key in KEYS)
    tab.press(Keys.ESCAPE)
    assert not tab.driver.find_element("id", "help").is_displayed()
    tab.press("v")
    assert tab.chosen_video() == names[1]
    tab.press("v")
    assert "last video" in tab.message
    tab.press("V")
    assert tab.chosen_video() == names[0]


def test_a_page_without_an_answer_says_what_to_do(tab):
    """Drawn by the style sheet: nothing else of the page may work then."""
    script = """document.body.classList.add("lost");
        return getComputedStyle(document.body, "::before").content"""
    said = tab.driver.execute_script(script)
    assert "No answer from whiskerforce" in said
    assert "run `whiskerforce curate` again" in said


PANELS = ("picture", "traces", "below", "items")


@pytest.mark.parametrize(("width", "stacked"), [(1200, False), (1199, True), (420, True)])
def test_below_1200_px_the_panels_stack(tab, served, width, stacked):
    try:
        show(tab.driver, served[0].url, width)
        tab.wait(lambda: tab.answered() > 0)
        script = """return arguments[0].map(id => {
            const r = document.getElementById(id).getBoundingClientRect();
            return [r.left, r.right, r.top, r.bottom]; })"""
        places = tab.driver.execute_script(script, list(PANELS))
        below = [b[2] >= a[3] for a, b in itertools.pairwise(places)]
        assert all(below) == stacked
        assert all(left >= 0 and right <= width for left, right, *_ in places)
        assert tab.driver.execute_script("return scrollY") == 0
        scrolled = tab.driver.execute_script("return document.documentElement.scrollWidth")
        assert scrolled <= width
        assert word_faults(tab.driver) == []
    finally:
        show_as_before(tab.driver)


def test_panels_of_a_crowd_do_not_lie_upon_each_other(tab, served):
    left_beside_axis_names = """const doc = Bokeh.documents[0];
        const pen = document.createElement("canvas").getContext("2d");
        return ["distance", "change", "force"].map(id => {
            const plot = doc.get_model_by_name(id), axis = plot.left[0];
            pen.font = `${axis.axis_label_text_font_size} ${axis.axis_label_text_font}`;
            const height = Bokeh.index.get_by_id(plot.id).frame.bbox.height;
            return height - pen.measureText(axis.axis_label).width; })"""
    try:
        show(tab.driver, served[0].url, 1440)
        tab.wait(lambda: tab.answered() > 0)
        script = """document.documentElement.style.setProperty("--lanes", 44);
            return arguments[0].map(id => {
            const r = document.getElementById(id).getBoundingClientRect();
            return [r.top, r.bottom]; })"""
        panels = ("lanes", "distance", "change", "force", "overview", "legend")
        places = tab.driver.execute_script(script, list(panels))
        assert all(bottom - top > 10 for top, bottom in places)  # px
        assert all(b[0] >= a[1] - 1 for a, b in itertools.pairwise(places))
        tab.wait(lambda: min(tab.driver.execute_script(left_beside_axis_names)) > 0)  # px
    finally:
        show_as_before(tab.driver)


def test_frames_lie_below_each_other_in_all_courses(tab, served):
    """Whatever the numbers and names at their axes."""
    script = """
        const doc = Bokeh.documents[0], name = arguments[0];
        doc.get_model_by_name('change').y_range.setv({start: -1200, end: 10});
        doc.get_model_by_name('lanes').left[0].major_label_overrides = new Map([[0, name]]);
        return ["lanes", "distance", "change", "force", "overview"].map(
            id => Bokeh.index.get_by_id(doc.get_model_by_name(id).id).frame.bbox.left)"""
    tab.driver.execute_script(script, "right_w21")
    tab.press("n")
    assert len({round(left) for left in tab.driver.execute_script(script, "right_w21")}) == 1


def test_a_frame_and_a_name_are_typed(tab, served):
    from selenium.webdriver.common.action_chains import ActionChains
    from selenium.webdriver.common.keys import Keys

    results = served[1]
    ActionChains(tab.driver).send_keys("g").send_keys("37", Keys.ENTER).perform()
    tab.wait(lambda: tab.frame == 37)
    tab.press(Keys.ARROW_RIGHT)  # keys speak to the page again
    assert tab.frame == 38
    field = tab.driver.find_element("css selector", "#person input")
    assert field.get_attribute("value") == user_name()
    field.clear()
    field.send_keys("Ada", Keys.ENTER)
    tab.wait(lambda: "name Ada" in tab.message)
    tab.press("f")
    assert "strongest" in tab.message
    tab.press(Keys.ENTER)
    assert read_corrections(results / first_video(results))["saved_by"].tolist() == ["Ada"]
    tab.click('button[data-do="export"]')
    assert "1 decision written to" in tab.message
    assert tab.driver.execute_script(
        "return Bokeh.documents[0].get_model_by_name('force').below[0].axis_label"
    ) == "frame (1 ms each)"  # fmt: skip


def test_two_tabs_see_the_same_corrections(tab, served, driver):
    from selenium.webdriver.common.keys import Keys

    first = driver.current_window_handle
    driver.switch_to.new_window("tab")
    other = Tab(driver, served[0].url)
    seen = len([row for row in other.rows() if "dismissed" not in row[2]])
    driver.switch_to.window(first)
    tab.press(Keys.DELETE)
    second = next(h for h in driver.window_handles if h != first)
    driver.switch_to.window(second)
    other.wait(lambda: len([row for row in other.rows() if "dismissed" not in row[2]]) == seen - 1)
    driver.close()
    driver.switch_to.window(first)


def test_reviewing_a_whole_session_without_the_mouse(driver, results):
    """As from the command line: a process of its own, ended by the page; tables then whole."""
    from selenium.webdriver.common.keys import Keys

    code = (
        "from pipeline.curate import curate; import sys; curate(sys.argv[1], open_browser=False)"
    )
    with subprocess.Popen([sys.executable, "-uc", code, str(results)], text=True,
                          stdout=subprocess.PIPE) as program:  # fmt: skip
        tab = Tab(driver, program.stdout.readline().split()[-1])
        before = contacts_of(results)
        gone = next(row for row in tab.rows() if "selected" in row[2])[:2]
        tab.press("x")
        while "Finished" not in tab.text("body"):
            while "looked at; v" not in tab.message:
                tab.press(Keys.ENTER)
            tab.press("v")
            if "last video" in tab.message:
                tab.press("q", "q")
                tab.wait(lambda: "Finished" in tab.text("#cover"))
        assert program.wait(PATIENCE_S) == 0
    after = contacts_of(results)
    assert len(after) == len(before) - 1
    name = first_video(results)
    assert gone in edges(before[before["video"] == name])
    assert gone not in edges(after[after["video"] == name])
    looked_at = sum(len(read_corrections(results / n)) for n in set(before["video"]))
    assert looked_at >= len(before)
    assert not after["curated"].any()
