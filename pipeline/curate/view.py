"""Where a person is at the page: the place in the video, the selection, and how to get about.

Like `desk`, this module does not depend on browsers.
"""

from functools import partialmethod

from pipeline.curate.items import Item
from pipeline.curate.results import Results, VideoUnderReview
from pipeline.curate.review import EditError, Span
from pipeline.errors import InputError, counted, in_words

WIDTHS = (50, 100, 200, 400, 800, 1600, 3200, 6400, 12800, 25600)  # frames in the time window
FIRST_WIDTH = 400
MARGIN = 0.1  # of the window, that stays ahead of the present frame
MOST_OF_WINDOW = 0.8  # a contact longer than this part of the window is not centred
ON = "v goes to the next video"


class View:
    """What a person looks at, and the commands that look and go.

    Attributes
    ----------
    video : the video looked at
    frame, whisker : the present frame, the whisker that new contacts belong to
    selected : `Span` of the contact (or possible contact) that edits apply to, or None
    adding : first frame of a contact that is being added, or None
    start, width : of the time window, in frames
    message, is_error : the answer to the last command
    lines : findings are drawn on the picture
    """

    def __init__(self, results: Results):
        self.results = results
        self._rank, self._ranked_by = 0, ""  # how often the same ranking was asked for in a row
        self.width = FIRST_WIDTH
        self.message, self.is_error = "", False
        self.lines = True
        self.video = None
        self._enter_first()
        self._to_doubtful()

    # ---- questions ------------------------------------------------------------------------

    @property
    def items(self) -> list[Item]:
        """Contacts and possible contacts of the video, by onset."""
        return self.video.items()

    @property
    def current(self) -> Item | None:
        """The selected item."""
        return next((item for item in self.items if item.span == self.selected), None)

    @property
    def stop(self) -> int:
        """End of the time window."""
        return self.start + self.width

    # ---- the place ------------------------------------------------------------------------

    def go(self, frame: int) -> None:
        """Go to a frame, within the video, and keep it in the time window."""
        self.frame = min(max(int(frame), 0), self.video.n_frames - 1)
        margin = int(MARGIN * self.width)
        if not self.start + margin <= self.frame < self.stop - margin:
            self.start = self.frame - self.width // 2
        self._fit_window()

    def go_to(self, text: str) -> None:
        """Go to the frame of this number, as a person typed it."""
        last = self.video.n_frames - 1
        self.message, self.is_error = "", False
        if text.isdecimal() and int(text) <= last:
            self.look_at(int(text))
        else:
            self.message = f"no frame {text}: {self.video.name} has frames 0 to {last}; g again"
            self.is_error = True

    def look_at(self, frame: int) -> None:
        """Go to a frame that was clicked, and select the contact there."""
        self.go(frame)
        here = [item for item in self.items if self.frame in item.span]
        own = [item for item in here if item.span.whisker == self.whisker]
        self._select(next(iter(own or here), None), go=False)

    def select(self, span: Span) -> None:
        """Select a contact or possible contact and go to its onset."""
        self._select(next((item for item in self.items if item.span == span), None))

    def open_video(self, name: str) -> None:
        """Look at another video, at its most doubtful contact."""
        self.message, self.is_error = "", False
        if name not in self.results.names or name == self.video.name:
            return
        try:
            self._enter(name)
            self._to_doubtful()
        except EditError as error:
            self.message, self.is_error = str(error), True

    def _enter_first(self):
        """Open the first video that can be opened; say which cannot."""
        problems = []
        for name in self.results.names:
            try:
                self._enter(name)
            except EditError as error:
                problems.append(str(error))
            else:
                break
        if self.video is None:
            raise InputError("; ".join(problems))
        self.message, self.is_error = "; ".join(problems), bool(problems)

    def _enter(self, name):
        try:
            video = self.results.video(name)
        except (OSError, ValueError) as error:
            raise EditError(f"{name} cannot be opened: {in_words(error)}") from error
        if self.video is not None:
            self.video.close()
        self.video: VideoUnderReview = video
        self.frame = self.start = 0
        self.whisker = next(iter(video.whiskers), None)
        self.selected = self.adding = None
        self._fit_window()

    def _fit_window(self):
        self.start = max(0, min(self.start, self.video.n_frames - self.width))

    def _select(self, item, go=True):
        self.selected = None if item is None else item.span
        if item is None:
            return
        self.whisker = item.span.whisker
        if go:
            length = item.span.offset - item.span.onset
            self.frame = item.span.onset
            middle = self.frame + (length // 2 if length < MOST_OF_WINDOW * self.width else 0)
            self.start = middle - self.width // 2
            self._fit_window()

    # ---- commands: look -------------------------------------------------------------------

    def _step(self, frames):
        self.go(self.frame + frames)

    next_frame, previous_frame = partialmethod(_step, 1), partialmethod(_step, -1)
    forward, back = partialmethod(_step, 10), partialmethod(_step, -10)
    page_forward, page_back = partialmethod(_step, 100), partialmethod(_step, -100)

    def first_frame(self):
        """Go to the video's start."""
        self.go(0)

    def last_frame(self):
        """Go to the video's end."""
        self.go(self.video.n_frames - 1)

    def zoom_in(self):
        """Take the next shorter time window, about the present frame."""
        self._zoom(max((w for w in WIDTHS if w < self.width), default=self.width))

    def zoom_out(self):
        """Take the next longer time window, up to the whole video."""
        if self.width < self.video.n_frames:
            self._zoom(min((w for w in WIDTHS if w > self.width), default=self.width))

    def _zoom(self, width):
        share = (self.frame - self.start) / self.width
        self.width = width
        self.start = int(self.frame - share * width)
        self.go(self.frame)

    def show_lines(self):
        """Show or hide what is drawn on the picture."""
        self.lines = not self.lines

    # ---- commands: go to ------------------------------------------------------------------

    def _neighbour(self, step):
        """Go to the onset of the next contact, or of that before, of whatever whisker."""
        contacts = self._contacts()
        spans = [item.span for item in contacts]
        if self.selected in spans:
            index = spans.index(self.selected) + step
        else:
            before = sum(span.onset <= self.frame for span in spans)
            index = before if step > 0 else before - 1
        if not 0 <= index < len(contacts):
            side, other = ("after", "p") if step > 0 else ("before", "n")
            raise EditError(
                f"{self.video.name} has no contact {side} frame {self.frame}; {other} goes the "
                f"other way, {ON}"
            )
        self._select(contacts[index])

    next_contact, previous_contact = partialmethod(_neighbour, 1), partialmethod(_neighbour, -1)

    def next_doubtful(self):
        """Go to the most doubtful contact that is left; without any to the next not looked at."""
        if not self._to_doubtful(apart_from=self.selected):
            raise EditError(f"no other contact of {self.video.name} is left to look at; {ON}")

    def _to_doubtful(self, apart_from=None):
        left = [item for item in self.items if item.is_open and item.span != apart_from]
        doubtful = sorted((i for i in left if i.is_doubtful), key=lambda i: -i.doubt)
        if not left:
            return False
        after = [item for item in left if item.span.onset >= self.frame]
        self._select((doubtful or after or left)[0])
        return True

    def next_slip(self):
        """Go to the next contact that ends by slipping past the pole."""
        start = self.frame if self.selected is None else self.selected.onset
        slips = [i for i in self._contacts() if i.values.get("slip") and i.span.onset > start]
        if not slips:
            raise EditError(
                f"no contact of {self.video.name} after frame {start} ends by slipping; {ON}"
            )
        self._select(slips[0])

    def strongest(self):
        """Go to the contact of the largest peak force, or to the next in strength."""
        self._ranked("peak_force_uN", largest_first=True, unit="µN")

    def shortest(self):
        """Go to the shortest contact, or to the next in length."""
        self._ranked("duration_ms", largest_first=False, unit="ms")

    def _ranked(self, name, largest_first, unit):
        known = [i for i in self._contacts() if i.values.get(name, float("nan")) >= 0]
        known.sort(key=lambda item: item.values[name], reverse=largest_first)
        if self._rank >= len(known):
            self._ranked_by = ""  # the next time begins anew
            raise EditError(
                f"that was the last of {counted(len(known), 'contact')}; the same key begins anew"
                if known
                else f"no contact of {self.video.name} has a {name}; videos.csv says why"
            )
        item = known[self._rank]
        self._select(item)
        order = "strongest" if largest_first else "shortest"
        self.message = f"{order}: {item.values[name]:.3g} {unit}, {self._rank + 1} of {len(known)}"

    def _contacts(self):
        return [item for item in self.items if item.is_contact]

    def other_edge(self):
        """Go to the selected contact's onset, or from there to its end."""
        span = self._need_current().span
        self.go(span.offset if self.frame == span.onset else span.onset)

    def next_whisker(self):
        """Go on to the next whisker."""
        names = self.video.whiskers
        self._need_whisker()
        self.whisker = names[(names.index(self.whisker) + 1) % len(names)]
        self.selected = self.adding = None

    def _other_video(self, step):
        names = self.results.names
        index = names.index(self.video.name) + step
        if not 0 <= index < len(names):
            place, key = ("last", "⇧ v goes back") if step > 0 else ("first", "v goes on")
            raise EditError(
                f"{self.video.name} is the {place} video of {len(names)}; {key}, q q ends"
            )
        self._enter(names[index])
        self._to_doubtful()

    next_video, previous_video = partialmethod(_other_video, 1), partialmethod(_other_video, -1)

    # ---- what commands need ---------------------------------------------------------------

    def _need_whisker(self):
        if self.whisker is None:
            raise EditError(f"no whisker was found in {self.video.name}; {ON}")

    def _need_current(self) -> Item:
        item = self.current
        if item is None:
            raise EditError("no contact is selected; n, p, d or a click selects one")
        return item
