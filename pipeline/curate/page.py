"""One browser tab: Bokeh models that follow the desk, and the channel for commands."""

import json
import traceback
from functools import partial

from bokeh.layouts import column
from bokeh.models import CustomJS, Div, TextInput

from pipeline.curate import panels
from pipeline.curate.courses import Courses
from pipeline.curate.desk import Desk
from pipeline.curate.keys import COMMANDS
from pipeline.curate.picture import PATIENCE_S, Picture
from pipeline.curate.review import Span
from pipeline.errors import VideoError

ALLOWED = frozenset(COMMANDS.values()) | {"finish_now"}


class Page:
    """Brings a `Desk` to a Bokeh document: commands come in, what has changed goes out.

    `finish` is called when the person wants to end; `person` is the name that is saved with
    corrections until another is given.
    """

    def __init__(self, doc, results, finish, person=""):
        self.doc, self.results, self.finish = doc, results, finish
        self.desk = Desk(results, person)
        self.picture = Picture()
        self.courses = Courses(self._pointed)
        self._inbox, self._panel = TextInput(name="inbox"), Div(name="panel")
        self._inbox.on_change("value", lambda attr, old, new: self._take(new))
        self._shown, self._parts = {}, {}
        self._answer = 0
        self._state = ""
        self._build()
        self.render()
        results.listeners.append(self._tables_made)
        doc.on_session_destroyed(self._leave)

    def _build(self):
        doc = self.doc
        doc.title = f"{self.results.folder.resolve().name} · whiskerforce curate"
        doc.template = panels.environment().get_template("page.html")
        doc.template_variables.update(panels.template_variables(), person=self.desk.person)
        wires = column(self._inbox, self._panel, name="wires", visible=False)
        plots = (self.picture.whole, self.picture.close, *self.courses.plots.values())
        for root in (*plots, wires):
            doc.add_root(root)
        doc.js_on_event(
            "document_ready",
            CustomJS(
                args={"inbox": self._inbox, "panel": self._panel},
                code="window.curate.connect(inbox, panel)",
            ),
        )

    # ---- in ---------------------------------------------------------------------------------

    def _take(self, text):
        """Obey the commands of one message from the browser, then show what came of them."""
        message = json.loads(text)
        try:
            for command in message["commands"]:
                self._obey(command)
        except Exception as error:  # the page must go on answering
            traceback.print_exc()
            self.desk.message = f"error in the program: {type(error).__name__}: {error}"
            self.desk.is_error = True
        self._answer = message["n"]
        self.render()
        if self.desk.finishing:
            self._end()

    def _obey(self, command):
        what, _, value = command.partition(":")
        if what == "hello":  # the browser has nothing yet
            self._parts = {}
        elif what == "item":  # by its frames: the list may have changed since it was clicked
            onset, offset, whisker = value.split(":", 2)
            self.desk.select(Span(whisker, int(onset), int(offset)))
        elif what == "video":
            self.desk.open_video(value)
        elif what == "frame":
            self.desk.go_to(value)
        elif what == "person":
            self.desk.be(value)
        elif command in ALLOWED and hasattr(self.desk, command):
            self.desk.do(command)

    def _pointed(self, frame):
        self.desk.look_at(frame)
        self.render()

    def _tables_made(self, name):
        """Called from the results' thread, with a video whose tables are new."""
        if name == self.desk.video.name:
            self.doc.add_next_tick_callback(self.render)

    def _picture_there(self, frame):
        """Called from the reader's thread."""
        self.doc.add_next_tick_callback(partial(self._late_picture, self.desk.video, frame))

    def _late_picture(self, video, frame):
        if video is self.desk.video and frame == self.desk.frame:
            self.render()

    def _end(self):
        self.desk.finishing = False
        self.show_state("finishing")
        self.finish()

    def show_state(self, state):
        """Say over the page that it is "finishing" or "finished"."""
        self._state = state
        self.render()

    def _leave(self, session_context):
        if self._tables_made in self.results.listeners:
            self.results.listeners.remove(self._tables_made)

    # ---- out --------------------------------------------------------------------------------

    def _is_new(self, what, *values) -> bool:
        """Remember what is shown; True where it differs from what was shown before."""
        before = self._shown.get(what)
        self._shown[what] = values
        return before is None or any(
            a is not b and (not isinstance(a, (str, int, tuple, type(None))) or a != b)
            for a, b in zip(before, values, strict=True)
        )

    def render(self):
        """Bring the page in line with the desk; only what has changed is sent."""
        video = self.desk.video
        self.doc.hold("combine")
        try:
            image, missing = self._image()
            if self._is_new("video", video):
                self.picture.enter(image)
                self.courses.enter(video)
            self._render_picture(image, missing)
            self._render_courses()
            self._render_panels(missing)
        finally:
            self.doc.unhold()

    def _image(self):
        """(image, why there is none) of the present frame."""
        video, frame = self.desk.video, self.desk.frame
        if video.reader is None:
            return None, f"{video.no_picture}. Its contacts can be corrected without the picture."
        try:
            image = video.reader.frame(frame, PATIENCE_S)
        except VideoError as error:
            return None, str(error)
        if image is None:
            video.reader.when_there(frame, partial(self._picture_there, frame), self)
        return image, ""

    def _render_picture(self, image, missing):
        desk, video = self.desk, self.desk.video
        if missing and self._is_new("image", video, None):
            self.picture.show_image(None, video, desk.frame)
        if image is not None:
            if self._is_new("contrast", video):
                self.picture.enter(image)
            if self._is_new("image", video, desk.frame):
                self.picture.show_image(image, video, desk.frame)
        touching = tuple(s.whisker for s in video.review.spans if desk.frame in s)
        if self._is_new("findings", video, desk.frame, desk.whisker, desk.lines, touching):
            self.picture.show_findings(video, desk.frame, desk.whisker, desk.lines)

    def _render_courses(self):
        desk, video = self.desk, self.desk.video
        if self._is_new("window", video, video.tables, desk.start, desk.width, desk.whisker):
            self.courses.show_window(video, desk.start, desk.width, desk.whisker)
        if self._is_new("items", desk.items, desk.selected):
            self.courses.show_items(desk.items, video.whiskers, desk.selected)
        if self._is_new("cursor", video, desk.frame, desk.adding):
            self.courses.show_cursor(desk.frame, desk.adding)

    def _render_panels(self, missing):
        desk = self.desk
        parts = panels.panels(desk, missing)
        parts["cover"] = panels.cover(self._state, self.results)
        changed = {name: html for name, html in parts.items() if self._parts.get(name) != html}
        self._parts = parts
        self._panel.text = json.dumps(
            {
                "n": self._answer,
                "parts": changed,
                "helps": desk.helps,
                "ended": desk.frame == desk.video.n_frames - 1,
                "aspect": round(self.picture.aspect, 4),
                "lanes": len(desk.video.whiskers),
            }
        )
