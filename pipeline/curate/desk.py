"""What a person does at the page: commands come in by name, attributes hold what is shown.

This module does not depend on browsers.
"""

from pipeline.curate.decisions import name_of
from pipeline.curate.results import Results
from pipeline.curate.review import EditError
from pipeline.curate.view import View
from pipeline.errors import counted, in_words


class Desk(View):
    """One person's view of the results, and everything that can be done in it.

    Attributes, beside those of `View`
    ----------
    helps : the help is shown
    finishing : the person wants to end
    person : name of the person, saved with every correction
    """

    def __init__(self, results: Results, person: str = ""):
        super().__init__(results)
        self.person = name_of(person)
        self.helps = self.finishing = False
        self._asked = 0  # commands for which the question whether to finish stands

    def do(self, command: str) -> None:
        """Carry out a command of keys.py; what makes no sense is reported and ignored."""
        self.message, self.is_error = "", False
        self._asked -= bool(self._asked)
        self.video.review.person = self.person
        self._rank = self._rank + 1 if command == self._ranked_by else 0
        self._ranked_by = command
        try:
            getattr(self, command)()
        except EditError as error:
            self.message, self.is_error = str(error), True

    def be(self, person: str) -> None:
        """Save corrections under this name from now on."""
        self.person = name_of(person)
        self.is_error = False
        self.message = f"corrections are saved under the name {self.person or '(none)'}"

    # ---- commands: decide -----------------------------------------------------------------

    def confirm(self):
        """Say that the selected item is right as it is, and go on to what is left."""
        done = ""
        if self.selected is not None:
            item = self._need_current()
            if item.is_contact:
                self.video.review.confirm(item.span)
            else:
                self.video.review.dismiss(item.span)
            done = f"{_named(item)} confirmed"
        if self._to_doubtful():
            self.message = done
        else:
            self.message = "all contacts of this video are looked at; v goes to the next video"

    def delete(self):
        """Say that there is no contact where the selected one is."""
        item = self._need_current()
        if not item.is_contact:
            self.video.review.dismiss(item.span)
        else:
            self.video.review.delete(item.span)
            self.selected = None
        self.message = f"{_named(item)} deleted"

    def onset(self):
        """Let the selected contact begin with the present frame."""
        self._move(onset=self.frame)

    def offset(self):
        """Let the selected contact (or the one being added) be over in the present frame."""
        if self.adding is not None:
            self.add()
        else:
            self._move(offset=self.frame)

    def _move(self, **edge):
        item = self._need_current()
        if not item.is_contact:
            raise EditError(f"{_named(item)} has no edges to move yet; c makes a contact of it")
        self.selected = self.video.review.move(item.span, **edge)
        self.message = f"contact now {self.selected}"

    def add(self):
        """Begin a new contact here, or end the one that was begun."""
        self._need_whisker()
        if self.adding is None:
            there = self.video.review.at(self.whisker, self.frame)
            if there:
                raise EditError(
                    f"{self.whisker} has contact {there} in frame {self.frame} already; i and o "
                    "move its edges, and a begins one in a frame without contact"
                )
            self.adding, self.selected = self.frame, None
            self.message = (
                f"new contact of {self.whisker} from frame {self.frame}: step to the first "
                "frame without contact, then a again (Esc: cancel)"
            )
            return
        self.selected = self.video.review.add(self.whisker, self.adding, self.frame)
        self.adding = None
        self.message = f"contact {self.selected} added"

    def accept(self):
        """Make a contact of the selected possible one."""
        item = self._need_current()
        if item.is_contact:
            raise EditError(f"{_named(item)} is one already; Enter says that it is right")
        self.selected = self.video.review.add(*item.span)
        self.message = f"contact {self.selected} added"

    def merge(self):
        """Make one of the selected contact and the next."""
        item = self._need_current()
        if not item.is_contact:
            raise EditError(f"{_named(item)} cannot be merged; c makes a contact of it")
        self.selected = self.video.review.merge(self.selected)
        self.message = f"merged into {self.selected}"

    def undo(self):
        """Take the last edit back and go to where it was."""
        nothing = f"no change of {self.video.name} is left to undo; x, i and o make changes"
        self._turn_back(self.video.review.undo, "undone", nothing)

    def redo(self):
        """Make the edit again that was taken back."""
        nothing = f"nothing of {self.video.name} to do again: u comes first"
        self._turn_back(self.video.review.redo, "done again", nothing)

    def _turn_back(self, turn, done, nothing):
        before = {item.span: item.state for item in self.items}
        if not turn():
            raise EditError(nothing)
        self.adding = None
        items = self.items
        changed = [item for item in items if before.get(item.span) != item.state]
        if changed:
            self._select(changed[0])
        elif self.selected not in [item.span for item in items]:
            self.selected = None
        self.message = done

    # ---- commands: page -------------------------------------------------------------------

    def escape(self):
        """Leave off what is being done: help, then adding, then the selection."""
        if self.helps:
            self.helps = False
        elif self.adding is not None:
            self.adding = None
        else:
            self.selected = None

    def show_help(self):
        """Show or hide the keys."""
        self.helps = not self.helps

    def export(self):
        """Write what was decided in all videos."""
        try:
            path, count, said = self.results.write_decisions()
        except (OSError, ValueError) as error:
            raise EditError(
                f"decisions.csv cannot be written: {in_words(error)}; every correction is saved "
                "beside its video's tables: correct this, and press the key again"
            ) from error
        self.message = "; ".join(
            [f"{counted(count, 'decision')} written to {path.resolve()}", *said]
        )

    def finish(self):
        """End, if the command comes twice in a row."""
        if self._asked:
            self.finish_now()
        self._asked = 2
        self.message = "q again to finish and write the tables; any other key continues"

    def finish_now(self):
        """End."""
        self.finishing = True


def _named(item):
    what = "contact" if item.is_contact else "possible contact"
    return f"{what} {item.span}"
