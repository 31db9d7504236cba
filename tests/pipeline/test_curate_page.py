"""The page for correcting contacts: its parts, and the whole in a real browser."""

import contextlib
import http.client
import shutil
import socket
import subprocess
import sys
import time
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np
import pandas as pd
import pytest

from pipeline import batch, tables
from pipeline.curate import curate
from pipeline.curate.desk import Desk
from pipeline.curate.frames import BLOCK, FrameReader
from pipeline.curate.items import FLAGS, items_of, probabilities
from pipeline.curate.keys import COMMANDS, KEYS, shown
from pipeline.curate.results import Results
from pipeline.curate.review import Review, Span
from pipeline.curation import read_corrections, table_of
from pipeline.errors import VideoError
from pipeline.inputs import InputError
from pipeline.progress import Progress
from pipeline.records import CONTACT_COLUMNS, CONTACT_FLAGS
from pipeline.settings import read_session
from pipeline.video import open_video

PATIENCE_S = 20  # for an answer of the page, on a busy machine
FRAMES = 240


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    """A rendered session of two short videos, processed: (videos, results)."""
    from synthetic.session import render_session

    folder = tmp_path_factory.mktemp("session")
    render_session(folder / "videos", "h264", seed=3, trials=2, frames=FRAMES)
    process(folder / "videos", folder / "results")
    return folder / "videos", folder / "results"


def process(videos, results, **options):
    summary = batch.run([videos], results, progress=Progress, **options)
    assert not summary.of("failed")


@pytest.fixture
def results(session, tmp_path):
    """A copy of the results that a test may change."""
    shutil.copytree(session[1], tmp_path / "results")
    return tmp_path / "results"


@contextlib.contextmanager
def opened(folder):
    results = Results(folder)
    try:
        yield results
    finally:
        results.close()


def contacts_of(folder, video=None):
    return tables.read_csv(
        folder / (f"{video}/contacts.csv" if video else "contacts.csv"), CONTACT_COLUMNS
    )


def edges(contacts):
    return list(zip(contacts["onset_frame"], contacts["offset_frame"], strict=True))


# ---- frames in any order -------------------------------------------------------------------


@pytest.fixture(scope="module")
def video(session):
    """Path of a video and all its frames."""
    path = sorted(session[0].glob("*.mp4"))[0]
    return path, list(open_video(path))


def test_frames_in_any_order_are_the_videos_own(video):
    path, frames = video
    reader = FrameReader(path, len(frames), cache_bytes=3 * BLOCK * frames[0].nbytes)
    order = np.random.default_rng(1).permutation(len(frames))[:25]
    for i in [*order, *range(len(frames) - 1, len(frames) - 70, -1), 0, len(frames) - 1]:
        np.testing.assert_array_equal(reader.frame(int(i)), frames[i])
    reader.close()


def test_the_cache_keeps_to_its_size(video):
    path, frames = video
    limit = 4 * BLOCK * frames[0].nbytes
    reader = FrameReader(path, len(frames), cache_bytes=limit)
    for i in range(0, len(frames), 5):
        reader.frame(i)
    held = sum(len(block) for block in reader._blocks.values()) * frames[0].nbytes
    reader.close()
    assert held <= limit


def test_who_cannot_wait_is_called_when_the_frame_is_there(video):
    path, frames = video
    reader = FrameReader(path, len(frames))
    there = []
    reader.when_there(200, lambda: there.append(200))
    deadline = time.monotonic() + PATIENCE_S
    while not there and time.monotonic() < deadline:
        time.sleep(0.01)
    assert there == [200]
    np.testing.assert_array_equal(reader.frame(200, timeout=0), frames[200])
    reader.close()


def test_frames_that_are_not_there_raise_and_do_not_hang(video):
    path, frames = video
    reader = FrameReader(path, len(frames) + 40)
    with pytest.raises(VideoError, match="ends before frame"):
        reader.frame(len(frames) + 10)
    with pytest.raises(ValueError, match="index must be in"):
        reader.frame(len(frames) + 40)
    np.testing.assert_array_equal(reader.frame(5), frames[5])
    reader.close()


# ---- what is doubtful ----------------------------------------------------------------------


def review_with(probability, *spans, verdicts=()):
    """A review of one whisker's contacts, its contacts table and probabilities."""
    n = len(probability)
    table = pd.DataFrame({
        "whisker": ["C2"] * len(spans),
        "onset_frame": [a for a, _ in spans],
        "offset_frame": [b for _, b in spans],
        "duration_ms": [float(b - a) for a, b in spans],
        "peak_force_uN": [10.0] * len(spans),
        "flags": [""] * len(spans),
    })  # fmt: skip
    evidence = pd.DataFrame({"whisker": "C2", "frame": np.arange(n), "probability": probability})
    review = Review(table[["whisker", "onset_frame", "offset_frame"]], table_of(verdicts), n,
                    lambda corrections: None)  # fmt: skip
    return review, table, probabilities(evidence)


def course(n=200, **stretches):
    """Probability of contact that is 1 in the given stretches, or what is said third."""
    values = np.zeros(n)
    for start, stop, *level in stretches.values():
        values[start:stop] = level[0] if level else 1.0
    return values


def test_flags_that_are_weighed_are_flags_of_contacts():
    assert set(FLAGS) <= set(CONTACT_FLAGS)


def test_a_clear_contact_is_not_doubtful():
    (item,) = items_of(*review_with(course(a=(50, 80)), (50, 80)))
    assert (item.state, item.doubt, item.reasons) == ("detected", 0.0, ())


@pytest.mark.parametrize(
    ("probability", "reason"),
    [
        (course(a=(50, 80, 0.8)), "probability 0.80"),
        (course(a=(50, 80), b=(49, 50, 0.4)), "onset not sharp"),
        (course(a=(50, 80), b=(79, 80, 0.6)), "offset not sharp"),
    ],
)
def test_thin_evidence_is_doubtful(probability, reason):
    (item,) = items_of(*review_with(probability, (50, 80)))
    assert item.is_doubtful
    assert reason in item.reasons


@pytest.mark.parametrize(
    ("column", "value", "reason"),
    [
        ("duration_ms", 3.0, "short, 3 ms"),
        ("peak_force_uN", 0.4, "weak, 0.4 µN"),
        ("flags", "slip;large_deflection", "slips off: is the end right?"),
    ],
)
def test_weak_short_and_flagged_contacts_are_doubtful(column, value, reason):
    review, table, probability = review_with(course(a=(50, 80)), (50, 80))
    (item,) = items_of(review, table.assign(**{column: value}), probability)
    assert item.is_doubtful
    assert reason in item.reasons


def test_a_flag_on_the_force_alone_is_told_but_not_doubtful():
    review, table, probability = review_with(course(a=(50, 80)), (50, 80))
    (item,) = items_of(review, table.assign(flags="large_deflection"), probability)
    assert not item.is_doubtful
    assert item.reasons == ("large deflection",)


def test_a_stretch_that_was_nearly_a_contact_is_shown_until_dismissed():
    review, *rest = review_with(course(a=(50, 80), b=(120, 130, 0.4)), (50, 80))
    possible = items_of(review, *rest)[1]
    assert (possible.span, possible.state) == (Span("C2", 120, 130), "possible")
    assert possible.is_doubtful
    review.dismiss(possible.span)
    assert items_of(review, *rest)[1].state == "dismissed"


def test_what_a_person_has_looked_at_is_not_doubtful():
    review, *rest = review_with(course(a=(50, 80, 0.6)), (50, 80))
    review.confirm(Span("C2", 50, 80))
    assert [(i.state, i.doubt) for i in items_of(review, *rest)] == [("confirmed", 0.0)]
    review.move(Span("C2", 50, 80), offset=90)
    assert [i.state for i in items_of(review, *rest)] == ["curated"]
    review.delete(Span("C2", 50, 90))
    assert [i.state for i in items_of(review, *rest)] == ["dismissed"]


# ---- the desk ------------------------------------------------------------------------------


def test_every_key_has_its_command():
    by_page = {"play"}  # which the browser does, by stepping
    assert all(hasattr(Desk, key.command) for key in KEYS if key.command not in by_page)
    assert len(COMMANDS) == sum(len(key.keys) for key in KEYS)


def test_the_manual_names_every_key():
    manual = (Path(__file__).parents[2] / "docs" / "curate.md").read_text(encoding="utf-8")
    for key in KEYS:
        names = " ".join(f"`{shown(k)}`" for k in key.keys)
        assert f"| {names} | {key.meaning} |" in manual


def test_the_window_follows_the_frame(results):
    with opened(results) as folder:
        desk = Desk(folder)
        for command in [*["zoom_in"] * 3, "last_frame", "back", "first_frame", "page_forward",
                        *["next_frame"] * 60, "zoom_out"]:  # fmt: skip
            desk.do(command)
            assert desk.start <= desk.frame < desk.stop
            assert 0 <= desk.start <= desk.video.n_frames


def test_confirming_goes_through_all_contacts_the_doubtful_first(results):
    with opened(results) as folder:
        desk = Desk(folder)
        todo = len(desk.items)
        doubts = []
        for _ in range(todo):
            doubts.append(desk.current.is_doubtful)
            desk.do("confirm")
        assert doubts == sorted(doubts, reverse=True)
        assert not any(item.is_open for item in desk.items)
        assert "all contacts of this video are looked at" in desk.message
        verdicts = read_corrections(results / desk.video.name)["verdict"]
        assert len(verdicts) == todo


def test_commands_without_sense_are_told_and_change_nothing(results):
    with opened(results) as folder:
        desk = Desk(folder)
        desk.do("escape")
        for command in ("delete", "onset", "offset", "accept", "undo", "redo", "other_edge"):
            desk.do(command)
            assert desk.is_error, command
            assert desk.message, command
        assert read_corrections(results / desk.video.name).empty


def test_corrections_reach_the_tables_with_forces_made_anew(results):
    with opened(results) as folder:
        desk = Desk(folder)
        name, before = desk.video.name, contacts_of(results)
        own = before[before["video"] == name]
        longest = (own["offset_frame"] - own["onset_frame"]).idxmax()
        onset, offset = edges(own.loc[[longest]])[0]
        desk.select(Span(own.loc[longest, "whisker"], onset, offset))
        desk.go(onset + 2)
        desk.do("onset")
        folder.settle()
        after = contacts_of(results)
    row = after[(after["video"] == name) & (after["onset_frame"] == onset + 2)].squeeze()
    assert row["curated"]
    assert row["offset_frame"] == offset
    assert row["impulse_uN_ms"] < own.loc[longest, "impulse_uN_ms"]
    assert np.isfinite(row["pulse_duration_ms"])
    frames = tables.read_frames(results / name / "frames.parquet")
    part = frames[frames["whisker"] == row["whisker"]].set_index("frame")
    touching = part["in_contact"].loc[onset : offset - 1].tolist()
    assert touching == [False] * 2 + [True] * (offset - onset - 2)
    assert (part["contact_force_uN"].loc[onset : onset + 1] == 0).all()
    own_after, rest_after, rest_before = (
        table.reset_index(drop=True)
        for table in (
            after[after["video"] == name],
            after[after["video"] != name],
            before[before["video"] != name],
        )
    )
    pd.testing.assert_frame_equal(rest_after, rest_before)
    pd.testing.assert_frame_equal(contacts_of(results, name), own_after)


def test_undone_corrections_leave_the_tables_as_they_were(results):
    with opened(results) as folder:
        desk = Desk(folder)
        before = contacts_of(results)
        frames = tables.read_frames(results / desk.video.name / "frames.parquet")
        desk.do("delete")
        folder.settle()
        assert len(contacts_of(results)) == len(before) - 1
        desk.do("undo")
        folder.settle()
        pd.testing.assert_frame_equal(contacts_of(results), before)
        again = tables.read_frames(results / desk.video.name / "frames.parquet")
        pd.testing.assert_frame_equal(again, frames)


def test_what_an_interrupted_curation_left_behind_is_made_up_for(results):
    with opened(results) as folder:
        video = folder.video(folder.names[0])
        video._changed = None  # as if the program died after saving corrections.csv
        video.review.delete(video.review.spans[0])
        n = len(contacts_of(results, video.name))
    assert len(contacts_of(results, video.name)) == n
    with opened(results) as folder:
        folder.settle()
    assert len(contacts_of(results, video.name)) == n - 1


def test_folders_with_nothing_to_curate_are_told(results, tmp_path):
    with pytest.raises(InputError, match=r"no videos\.csv in it.*--out folder"):
        Results(tmp_path)
    for file in results.glob("*/evidence.parquet"):
        file.unlink()
    with pytest.raises(InputError, match="whiskerforce run"):
        Results(results)


def test_a_video_that_is_gone_leaves_the_time_courses(results):
    name = Results(results).names[0]
    state = tables.read_json(results / name / "run.json")
    tables.write_json(results / name / "run.json", {**state, "path": "/nowhere/video.mp4"})
    with opened(results) as folder:
        video = folder.video(name)
        assert video.reader is None
        assert "/nowhere/video.mp4" in video.no_picture
        assert len(video.traces()["C2"].force_uN) == FRAMES


def test_a_second_run_keeps_corrections(session, tmp_path):
    videos, finished = session
    results = tmp_path / "results"
    shutil.copytree(finished, results)
    with opened(results) as folder:
        desk = Desk(folder)
        desk.do("delete")
        desk.do("next_contact")
        desk.go(desk.selected.offset + 1)
        desk.do("offset")
    curated = contacts_of(results)
    frames = tables.read_frames(results / desk.video.name / "frames.parquet")
    assert curated["curated"].sum() == 1
    process(videos, results)
    pd.testing.assert_frame_equal(contacts_of(results), curated)
    process(videos, results, overwrite=True)
    pd.testing.assert_frame_equal(contacts_of(results), curated)
    again = tables.read_frames(results / desk.video.name / "frames.parquet")
    pd.testing.assert_frame_equal(again, frames)


# ---- the server ----------------------------------------------------------------------------


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


@pytest.mark.parametrize(
    ("origin", "status"), [("http://127.0.0.1:{port}", 101), ("http://elsewhere.example", 403)]
)
def test_pages_from_elsewhere_get_no_websocket(served, origin, status):
    from bokeh.util.token import generate_jwt_token, generate_session_id

    url = urlsplit(served[0].url)
    connection = http.client.HTTPConnection(url.hostname, url.port, timeout=PATIENCE_S)
    token = generate_jwt_token(generate_session_id())
    headers = {
        "Origin": origin.format(port=url.port), "Upgrade": "websocket", "Connection": "Upgrade",
        "Sec-WebSocket-Version": "13", "Sec-WebSocket-Key": "AAAAAAAAAAAAAAAAAAAAAA==",
        "Sec-WebSocket-Protocol": f"bokeh, {token}",
    }  # fmt: skip
    connection.request("GET", url.path + "/ws", headers=headers)
    assert connection.getresponse().status == status
    connection.close()


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


def test_a_port_that_is_taken_is_told(served):
    port = served[0]._socket.getsockname()[1]
    with pytest.raises(InputError, match=f"--port {port}: cannot serve there"):
        curate(served[1], port=port, open_browser=False, block=False)


# ---- the whole, in a browser ---------------------------------------------------------------


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


@pytest.fixture(scope="module")
def driver(tmp_path_factory):
    """A headless Chromium."""
    webdriver = pytest.importorskip("selenium.webdriver", reason="selenium is not installed")
    names = ("chromium", "chromium-browser", "google-chrome", "chrome")
    chromium = next(filter(None, map(shutil.which, names)), None)
    chromedriver = shutil.which("chromedriver")
    if chromium is None or chromedriver is None:
        pytest.skip("no chromium with its chromedriver on this computer")
    options = webdriver.ChromeOptions()
    options.binary_location = chromium
    profile = tmp_path_factory.mktemp("profile")
    for argument in (
        "--headless=new", "--no-sandbox", "--disable-gpu", "--disable-background-networking",
        "--disable-component-update", "--disable-sync", "--no-first-run",
        "--window-size=1440,960", f"--user-data-dir={profile}",
    ):  # fmt: skip
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    service = webdriver.ChromeService(executable_path=chromedriver)
    driver = webdriver.Chrome(options=options, service=service)
    yield driver
    driver.quit()


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
    assert read_corrections(results / name).empty
    assert [row[:2] for row in tab.rows()] == [row[:2] for row in before]
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


def test_results_are_of_the_kind_that_run_makes(session):
    """What the other tests stand on: contacts were found in both videos, and doubts are few."""
    settings = read_session(session[1] / "session.toml")
    assert settings.recording.frames_per_second == 1000
    assert contacts_of(session[1]).groupby("video").size().min() >= 2
