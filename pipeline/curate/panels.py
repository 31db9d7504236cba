"""The page's words: status, read-outs, lists, as HTML made by panels.html."""

import math
from functools import cache
from itertools import groupby
from pathlib import Path

from markupsafe import Markup, escape

from pipeline.curate.colours import state_of
from pipeline.curate.keys import COMMANDS, KEYS, shown

MOST_ROWS = 120  # of the list of contacts: in a longer list those around the present frame
POLE, NO_POLE = "close-up of the pole", "no pole seen: close-up of the middle"

BUTTONS = (
    (("previous_contact", "Previous"), ("next_contact", "Next"), ("next_doubtful", "Doubtful")),
    (("next_slip", "Slip"), ("strongest", "Strongest"), ("shortest", "Shortest")),
    (("confirm", "Right"), ("delete", "No contact"), ("add", "Add")),
    (("onset", "Begins here"), ("offset", "Over here"), ("merge", "Merge")),
    (("undo", "Undo"), ("redo", "Redo")),
    (("play", "Play"), ("zoom_in", ""), ("zoom_out", "")),
)
STATE_WORDS = {
    "detected": "detected contact",
    "doubtful": "doubtful contact",
    "confirmed": "confirmed contact",
    "curated": "contact added or moved",
    "possible": "possible contact",
    "dismissed": "no contact",
}


@cache
def environment():
    """Return the jinja2 environment of the page's templates."""
    import jinja2

    loader = jinja2.FileSystemLoader(Path(__file__).parent)
    return jinja2.Environment(loader=loader, autoescape=True, trim_blocks=True, lstrip_blocks=True)


def template_variables() -> dict:
    """What page.html needs: styles, script, buttons and keys."""
    here = Path(__file__).parent
    by_command = {key.command: key for key in KEYS}
    return {
        "css": (here / "page.css").read_text(encoding="utf-8"),
        "js": (here / "page.js").read_text(encoding="utf-8"),
        "handled": COMMANDS,
        "buttons": [
            [(c, text, shown(by_command[c].keys[0]), by_command[c].meaning) for c, text in group]
            for group in BUTTONS
        ],
        "help": [
            (group, [([shown(k) for k in key.keys], key.meaning) for key in keys])
            for group, keys in groupby(KEYS, key=lambda key: key.group)
        ],
    }


def panels(desk, no_picture="") -> dict[str, str]:
    """HTML of every part of the page that changes, by the element's id."""
    video, item = desk.video, desk.current
    macro = environment().get_template("panels.html").module
    fault = desk.results.faults.get(video.name) or video.no_lines
    return {
        "video": macro.video(desk),
        "progress": macro.progress(_count(desk.items)),
        "saved": macro.saved("busy" if desk.results.busy else "ok", fault),
        "badge": macro.badge(
            _contact_state(desk), desk.frame,
            f"{1e3 * desk.frame / video.recording.frames_per_second:.5g}",
        ),
        "readout": macro.readout(
            _readings(desk), _described(item, video), desk.whisker,
            item.reasons if item else (), desk.adding,
        ),
        "closeup_of": NO_POLE if video.pole(desk.frame) is None else POLE,
        "items": macro.items(list(_rows(desk)), len(video.whiskers) > 1),
        "message": _message(desk),
        "no_picture": str(escape(no_picture)),
    }  # fmt: skip


def cover(state, results) -> str:
    """HTML over the page while finishing, and after."""
    macro = environment().get_template("panels.html").module.cover
    return macro(state, results.folder, results.faults)


def _message(desk):
    css = "error" if desk.is_error else ""
    return str(Markup('<span class="{}">{}</span>').format(css, desk.message))


def _count(items):
    contacts = [item for item in items if item.is_contact]
    return {
        "all": len(contacts),
        "seen": sum(not item.is_open for item in contacts),
        "doubtful": sum(item.is_doubtful and item.is_open for item in items),
    }


def _contact_state(desk):
    """Whether the present whisker touches in this frame."""
    touching = [s.whisker for s in desk.video.review.spans if desk.frame in s]
    if touching:
        several = len(desk.video.whiskers) > 1
        names = f" {', '.join(dict.fromkeys(touching))}" if several else ""
        return {"css": "contact", "text": f"contact{names}"}
    return {"css": "free", "text": "free"}


def _readings(desk):
    """(name, value, unit) of the present whisker and frame."""
    traces = desk.video.traces().get(desk.whisker)
    if traces is None:
        return []
    at = desk.frame
    rows = [
        ("distance", traces.distance_mm, "mm", "{:.3f}"),
        ("curvature change", traces.curvature_change, "1/m", "{:.1f}"),
        ("force", traces.force_uN, "µN", "{:.2f}"),
        ("force if it touched", traces.would_be_force_uN, "µN", "{:.2f}"),
        ("probability", traces.probability, "", "{:.3f}"),
    ]
    several = len(desk.video.whiskers) > 1
    head = [("whisker", desk.whisker, "")] if several else []
    return head + [(name, _number(v[at], form), unit) for name, v, unit, form in rows]


def _number(value, form):
    if not math.isfinite(value):
        return "–"
    text = form.format(value)
    return text.lstrip("-") if float(text) == 0 else text.replace("-", "−")


def _described(item, video):
    """Words on the selected item."""
    if item is None:
        return None
    span, name = item.span, state_of(item)
    frames = span.offset - span.onset
    facts = (
        _value(item, "peak_force_uN", "peak {:.3g}\u00a0µN"),
        _value(item, "peak_base_moment_nN_m", "moment {:.3g}\u00a0nN\u00a0m"),
        _value(item, "contact_arc_length_mm", "{:.3g}\u00a0mm from the follicle"),
    )
    whisker = f"{span.whisker}: " if len(video.whiskers) > 1 else ""
    duration = 1e3 * frames / video.recording.frames_per_second
    return {
        "css": name,
        "title": whisker + STATE_WORDS[name],
        "frames": f"frames {span.onset} to {span.offset} (not included), {duration:.4g}\u00a0ms",
        "facts": ", ".join(filter(None, facts)).replace("-", "−"),
    }


def _value(item, name, words):
    """A value of the item in words; "" where it is not known."""
    value = item.values.get(name, math.nan)
    return words.format(value) if math.isfinite(value) else ""


def _rows(desk):
    """Rows of the list of contacts."""
    items = desk.items
    first = 0
    if len(items) > MOST_ROWS:
        before = sum(item.span.onset <= desk.frame for item in items)
        first = max(0, before - MOST_ROWS // 2)
    rate = desk.video.recording.frames_per_second
    for item in items[first : first + MOST_ROWS]:
        span = item.span
        yield {
            "css": state_of(item),
            "selected": span == desk.selected,
            "whisker": span.whisker,
            "onset": span.onset,
            "offset": span.offset,
            "ms": f"{1e3 * (span.offset - span.onset) / rate:.4g}",
            "peak": _value(item, "peak_force_uN", "{:.3g}"),
            "remarks": "; ".join(item.reasons) or _remark(item),
        }


def _remark(item):
    words = {"confirmed": "confirmed", "curated": "added or moved", "dismissed": "no contact"}
    return words.get(item.state, "")
