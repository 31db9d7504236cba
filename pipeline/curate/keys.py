"""The keys of the page: which does what, said once for the page, its help and the manual."""

from typing import NamedTuple


class Key(NamedTuple):
    """`command` of the desk, the `keys` that give it (as browsers name them), and its meaning."""

    group: str
    command: str
    keys: tuple[str, ...]
    meaning: str


KEYS = (
    Key("Look", "next_frame", ("ArrowRight",), "next frame"),
    Key("Look", "previous_frame", ("ArrowLeft",), "previous frame"),
    Key("Look", "forward", ("Shift+ArrowRight",), "10 frames on"),
    Key("Look", "back", ("Shift+ArrowLeft",), "10 frames back"),
    Key("Look", "page_forward", ("PageDown",), "100 frames on"),
    Key("Look", "page_back", ("PageUp",), "100 frames back"),
    Key("Look", "first_frame", ("Home",), "first frame"),
    Key("Look", "last_frame", ("End",), "last frame"),
    Key("Look", "play", (" ",), "play slowly; again: stop"),
    Key("Look", "zoom_in", ("+", "="), "shorter time window"),
    Key("Look", "zoom_out", ("-",), "longer time window"),
    Key("Look", "show_lines", ("l",), "show or hide what is drawn on the picture"),
    Key("Go to", "next_contact", ("ArrowDown", "n"), "next contact"),
    Key("Go to", "previous_contact", ("ArrowUp", "p"), "previous contact"),
    Key("Go to", "next_doubtful", ("d",), "most doubtful contact that is left"),
    Key("Go to", "next_slip", ("s",), "next contact that ends by slipping past the pole"),
    Key("Go to", "strongest", ("f",), "strongest contact; again: the next in strength"),
    Key("Go to", "shortest", ("t",), "shortest contact; again: the next in length"),
    Key("Go to", "go_to_frame", ("g",), "a frame by its number, which you type; Enter goes there"),
    Key("Go to", "other_edge", ("e",), "onset or end of the selected contact, in turn"),
    Key("Go to", "next_whisker", ("w",), "next whisker"),
    Key("Go to", "next_video", ("v",), "next video"),
    Key("Go to", "previous_video", ("Shift+v",), "previous video"),
    Key("Decide", "confirm", ("Enter",), "right as it is; on to the most doubtful one left"),
    Key("Decide", "delete", ("Delete", "Backspace", "x"), "no contact"),
    Key("Decide", "onset", ("i",), "the contact begins with this frame"),
    Key("Decide", "offset", ("o",), "the contact is over in this frame, the first without"),
    Key("Decide", "add", ("a",), "a new contact begins here; again: it is over here"),
    Key("Decide", "accept", ("c",), "make the selected possible contact a contact"),
    Key("Decide", "merge", ("m",), "merge this contact with the next"),
    Key("Decide", "undo", ("u", "Ctrl+z"), "undo"),
    Key("Decide", "redo", ("r", "Shift+u", "Ctrl+y", "Ctrl+Shift+z"), "redo"),
    Key("Page", "escape", ("Escape",), "stop adding; deselect; close the help"),
    Key("Page", "show_help", ("?", "h"), "show or hide this list"),
    Key("Page", "export", ("Shift+e",), "write what was decided, by whom and when"),
    Key("Page", "finish", ("q",), "twice: write the tables and finish"),
)

COMMANDS = {key: each.command for each in KEYS for key in each.keys}
SHOWN = {
    "ArrowRight": "→", "ArrowLeft": "←", "ArrowUp": "↑", "ArrowDown": "↓", " ": "Space",
    "PageUp": "Page ↑", "PageDown": "Page ↓", "Delete": "Del", "Escape": "Esc", "-": "−",
}  # fmt: skip


def shown(key: str) -> str:
    """Return a key as a person would write it.

    >>> shown("Shift+ArrowRight"), shown("Ctrl+Shift+z"), shown("+")
    ('⇧ →', 'Ctrl ⇧ z', '+')
    """
    *held, last = key.split("+") if key != "+" else ("+",)
    names = ["⇧" if each == "Shift" else each for each in held]
    return " ".join([*names, SHOWN.get(last, last)])
