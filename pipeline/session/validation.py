"""What is wrong with a session.toml, in words: place, value, what is expected, what to do."""

import copy
import difflib
import math
from typing import get_args

from pipeline.session.quantities import fields_of, limits_of
from pipeline.session.schema import AnalysisSettings, Settings

UNKNOWN = ("extra_forbidden", "unexpected_keyword_argument")


def faults_of(document, errors) -> list[str]:
    """All problems of a parsed session.toml, a sentence or two each.

    Parameters
    ----------
    document : dict, the parsed file
    errors : list of dict, what pydantic found wrong with it (`ValidationError.errors()`)
    """
    unknown = [each["loc"] for each in errors if each["type"] in UNKNOWN]
    written = {_likeliest(location): location[-1] for location in unknown}
    problems = [_explain(each, document, written.get(each["loc"])) for each in errors]
    return problems + _contradictions(_without([each["loc"] for each in errors], document))


def _without(places, document):
    """The document without the values at `places`, which are already known to be wrong."""
    document = copy.deepcopy(document)
    for *above, key in places:
        table = document
        try:
            for step in above:
                table = table[step]
            table[key] = None
        except (KeyError, IndexError, TypeError):
            pass  # it is missing, or something above it is wrong
    return document


def _place(location, document) -> str:
    """Name a key as the user wrote it: `[recording] face`, `[[whisker]] 2 ("D1") length_mm`."""
    table, *rest = location
    if table == "advanced" and len(rest) > 1:
        table, rest = f"advanced.{rest[0]}", rest[1:]
    if table != "whisker":
        return " ".join([f"[{table}]", *map(str, rest)])
    if not rest:
        return "[[whisker]]"
    index, *rest = rest
    entry = document["whisker"][index]
    name = entry.get("name") if isinstance(entry, dict) else None
    name = f' ("{name}")' if isinstance(name, str) else ""
    return " ".join([f"[[whisker]] {index + 1}{name}", *map(str, rest[:1])])


def _explain(error, document, written=None) -> str:
    """One of pydantic's errors as a sentence: place, value, what is expected, what to do.

    `written`: an unknown key that may stand for one that is missing.
    """
    place, kind, value = _place(error["loc"], document), error["type"], error["input"]
    if kind in UNKNOWN:
        home = _home(error["loc"][-1])
        if home and not isinstance(value, dict):
            return f"{error['loc'][-1]} = {value!r} belongs below {home}; move it there"
        unknown = "table or key" if len(error["loc"]) == 1 else "key"
        return f"{place}: unknown {unknown}; {_known(error['loc'])}"
    if kind == "missing":
        remedy = f"rename {written}" if written else "add it"
        return f"{place} is missing; {_wanted(error['loc'])}; {remedy}"
    if kind == "implausible":
        return f"{place} = {value!r}: {error['ctx']['advice']}"
    if kind in ("literal_error", "string_too_short"):
        return f"{place} = {value!r}: {_wanted(error['loc'])}; correct the value"
    if error["loc"] == ("whisker",):
        return "[whisker]: expected one [[whisker]] table (double brackets) per tracked whisker"
    if isinstance(value, list) and _table_of(_field(error["loc"])) is not None:
        return f"{place}: expected only one such table; write {place} once, in single brackets"
    return f"{place} = {value!r}: {_wanted(error['loc'])}, not {_toml_type(value)}; correct it"


def _table_of(field):
    """The class of the table that a field holds, or None where it holds a value."""
    inside = (field.annotation, *get_args(field.annotation))
    return next((each for each in inside if hasattr(each, "__pydantic_validator__")), None)


def _field(location):
    """The declared field at a location such as ("whisker", 0, "length_mm")."""
    table, field = Settings, None
    for key in (step for step in location if not isinstance(step, int)):
        field = fields_of(table)[key]
        table = _table_of(field)
    return field


def _keys(location) -> list[str]:
    """Keys of the table at a location; () is the whole file."""
    return list(fields_of(_table_of(_field(location)) if location else Settings))


def _home(key) -> str:
    """The heading of the table that has a key, "" where none has it."""
    for name, field in fields_of(Settings).items():
        table = _table_of(field)
        if table is not None and name != "advanced" and key in fields_of(table):
            return "[[whisker]]" if name == "whisker" else f"[{name}]"
    return ""


def _known(location) -> str:
    """What to write in place of an unknown key: the likeliest, or all that there are."""
    likeliest = _likeliest(location)
    if likeliest:
        return f"did you mean {likeliest[-1]}?{_other_width(str(location[-1]), likeliest[-1])}"
    return f"known here: {', '.join(_keys(location[:-1]))}; correct or remove it"


def _likeliest(location):
    """The location of the key that was meant by an unknown one; None: it is like none."""
    key, keys = str(location[-1]), _keys(location[:-1])
    likely = (key, key.replace("radius", "diameter"))
    close = [match for each in likely for match in difflib.get_close_matches(each, keys, n=1)]
    close += [each for each in keys if each.startswith(f"{key}_")]  # its unit was left out
    return (*location[:-1], close[0]) if close else None


def _other_width(given, meant) -> str:
    """A warning where the value is not to be kept: forces go with the radius' fourth power."""
    if "diameter" in given and "radius" in meant:
        return " write half of the diameter there"
    if "radius" in given and "diameter" in meant:
        return " write twice the radius there"
    return ""


def _wanted(location) -> str:
    """What a key or table should hold."""
    field = _field(location)
    if _table_of(field) is not None:
        return f"expected a table with {', '.join(_keys(location))}"
    limits = limits_of(field)
    if limits:
        return f"expected a number ({limits})"
    choices = _choices(field.annotation)
    return f"expected one of {', '.join(choices)}" if choices else "expected a non-empty text"


def _choices(annotation) -> list[str]:
    """Texts that a key may hold, also inside `… | None`; none where any text may stand."""
    inside = [each for each in get_args(annotation) if each is not type(None)]
    if inside and all(isinstance(each, str) for each in inside):
        return inside
    return next((found for each in inside if (found := _choices(each))), [])


def _toml_type(value) -> str:
    names = {bool: "true/false", str: "text", dict: "a table", list: "a list"}
    return names.get(type(value), type(value).__name__)


def _number(table, key, default=None):
    """The value at `key` if it is a number, else `default`."""
    value = table.get(key, default) if isinstance(table, dict) else default
    return value if isinstance(value, (int, float)) and not isinstance(value, bool) else None


def _contradictions(document) -> list[str]:
    """Values that are possible one by one but not together."""
    tables = document.get("whisker")
    tables = tables if isinstance(tables, list) else []
    problems = []
    for index, table in enumerate(tables):
        if isinstance(table, dict):
            problems += _whisker_contradictions(table, _place(("whisker", index), document))
    tables = [table for table in tables if isinstance(table, dict)]
    problems += _repeated_names(tables)
    problems += _curvature_contradictions(document, tables)
    problems += _unknown_names(document, tables)
    problems += _snout_contradictions(document.get("recording"))
    pole = document.get("pole", {})
    if isinstance(pole, dict) and ("x_px" in pole) != ("y_px" in pole):
        absent = "y_px" if "x_px" in pole else "x_px"
        problems.append(f"[pole] {absent} is missing; give x_px and y_px, or neither")
    return problems


def _snout_contradictions(recording) -> list[str]:
    """A snout that is not at one end of the face's side."""
    recording = recording if isinstance(recording, dict) else {}
    face, snout = recording.get("face"), recording.get("snout")
    across, upright = ("left", "right"), ("top", "bottom")
    for faces, snouts in ((across, upright), (upright, across)):
        if face in faces and snout in faces:
            return [
                f'[recording] snout = "{snout}": expected {" or ".join(snouts)}, as the face is '
                f"at the {face}; correct one of them, or leave snout out"
            ]
    return []


def _whisker_contradictions(table, place) -> list[str]:
    length, cone = _number(table, "length_mm"), _number(table, "cone_length_mm")
    hidden = _number(table, "hidden_length_mm")
    base, tip = _number(table, "base_radius_um"), _number(table, "tip_radius_um")
    problems = []
    if cone is not None and tip is not None:
        problems.append(
            f"{place} cone_length_mm and tip_radius_um are both given; each follows from the "
            "other: remove one of them"
        )
    if base is not None and tip is not None and tip > base:
        problems.append(
            f"{place} tip_radius_um = {tip!r}: expected at most base_radius_um = {base!r}; "
            "correct one of them"
        )
    if length is not None and cone is not None and cone < length:
        problems.append(
            f"{place} cone_length_mm = {cone!r}: expected at least length_mm = {length!r} "
            "(the apex lies beyond the tip); correct one of them"
        )
    if length is not None and hidden is not None and hidden >= length:
        problems.append(
            f"{place} hidden_length_mm = {hidden!r}: expected less than length_mm = {length!r}; "
            "correct one of them"
        )
    return problems


def _repeated_names(tables) -> list[str]:
    names = [str(table.get("name")) for table in tables]
    repeated = sorted({name for name in names if names.count(name) > 1})
    return [
        f'[[whisker]] name = "{name}" is given {names.count(name)} times; '
        "expected distinct names: rename all but one"
        for name in repeated
    ]


def _unknown_names(document, tables) -> list[str]:
    """Whiskers that are to be followed, but have no table while others have one."""
    analysis = document.get("analysis", {})
    follow = analysis.get("follow") if isinstance(analysis, dict) else None
    names = [table.get("name") for table in tables]
    unknown = [n for n in follow or () if n not in names] if isinstance(follow, list) else []
    if not names or not unknown:
        return []
    lacks = "has" if len(unknown) == 1 else "have"
    return [
        f"[analysis] follow = {follow!r}: {', '.join(map(repr, unknown))} {lacks} no [[whisker]] "
        f"table; known are {', '.join(map(str, names))}; correct the name or add its table"
    ]


def _curvature_contradictions(document, tables) -> list[str]:
    analysis = document.get("analysis", {})
    at = _number(analysis, "curvature_at_mm", AnalysisSettings().curvature_at_mm)
    problems = []
    for table in tables:
        low, high = _number(table, "hidden_length_mm", 0.0), _number(table, "length_mm", math.inf)
        if None not in (at, low, high) and low < high and not low < at < high:
            problems.append(
                f"[analysis] curvature_at_mm = {at!r}: expected a visible place on whisker "
                f'"{table.get("name")}", between hidden_length_mm = {low!r} and '
                f"length_mm = {high!r}; correct one of them"
            )
    return problems
