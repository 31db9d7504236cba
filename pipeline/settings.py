"""session.toml ↔ typed settings: read, checked in one go, turned into SI, written back."""

import copy
import difflib
import math
import tomllib
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError
from pydantic_core import PydanticCustomError

from pipeline.records import Recording
from whiskermodel.whisker import Whisker

FACES = ("left", "right", "top", "bottom")
DIMENSIONS = ("length_mm", "cone_length_mm", "base_radius_um")


class SettingsError(ValueError):
    """Unusable settings; the message names file, key, value, what is expected, what to do.

    Attributes
    ----------
    source : str, the file (or whatever the settings came from)
    problems : tuple of str, all that is wrong, one sentence or two each
    """

    def __init__(self, source, problems):
        self.source = str(source)
        self.problems = tuple(problems)
        count = "1 problem" if len(self.problems) == 1 else f"{len(self.problems)} problems"
        lines = "".join(f"\n  - {problem}" for problem in self.problems)
        super().__init__(f"{self.source}: {count}{lines}")


class _Range(NamedTuple):
    """Plausible values of a quantity, and factors from units it is often given in by mistake."""

    low: float
    high: float
    unit: str
    mistaken_units: dict[str, float]

    def check(self, value: float) -> float:
        if self.low <= value <= self.high:
            return value
        raise PydanticCustomError("implausible", "{advice}", {"advice": self.advice(value)})

    def advice(self, value: float) -> str:
        unit = f" {self.unit}" if self.unit else ""
        text = f"expected {self.low:g} to {self.high:g}{unit}"
        for mistaken, factor in self.mistaken_units.items():
            if self.low <= value * factor <= self.high:
                return f"{text}; is it in {mistaken}? then write {value * factor:.6g}"
        return f"{text}; correct the value"


def _quantity(low, high, unit, mistaken_units=None):
    """Type of a float that must lie in [low, high] `unit`."""
    limits = _Range(low, high, unit, mistaken_units or {})
    return Annotated[float, Field(strict=True), AfterValidator(limits.check)]


class _Table(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class RecordingSettings(_Table):
    """[recording]: what the camera saw."""

    frames_per_second: _quantity(10, 200_000, "frames/s", {"kHz": 1e3}) = Field(
        description="of the camera, not the file's playback rate"
    )
    pixels_per_mm: _quantity(1, 1000, "pixels/mm", {"pixels per m": 1e-3}) = Field(
        description="scale of the image"
    )
    face: Literal["left", "right", "top", "bottom"] = Field(
        description="side of the image: left, right, top, bottom"
    )

    def si(self) -> Recording:
        """Return it as the `Recording` that travels through the pipeline."""
        return Recording(self.frames_per_second, self.pixels_per_mm, self.face)


class WhiskerSettings(_Table):
    """One [[whisker]] table; the forces need length, cone length and base radius."""

    name: Annotated[str, Field(strict=True, min_length=1)] = Field(
        description="what the lab calls it"
    )
    length_mm: _quantity(1, 200, "mm", {"m": 1e3, "µm": 1e-3}) | None = Field(
        None, description="follicle to (cut) tip"
    )
    cone_length_mm: _quantity(1, math.inf, "mm", {"m": 1e3}) | None = Field(
        None, description="follicle to the extrapolated apex"
    )
    base_radius_um: _quantity(2, 500, "µm", {"mm": 1e3, "m": 1e6, "nm": 1e-3}) | None = Field(
        None, description="at the follicle; the force goes with its fourth power"
    )
    youngs_modulus_GPa: _quantity(0.05, 50, "GPa", {"MPa": 1e-3, "Pa": 1e-9}) = Field(
        3.0, description="the paper's mouse whiskers: 3"
    )
    density_kg_per_m3: _quantity(300, 3000, "kg/m³", {"g/cm³": 1e3}) = Field(
        1000.0, description="the paper's mouse whiskers: 1000"
    )
    damping_per_s: _quantity(0, 10_000, "1/s") = Field(
        215.0, description="decay rate of the ring-down, d = γ/2"
    )
    hidden_length_mm: _quantity(0, 20, "mm", {"µm": 1e-3}) = Field(
        1.4, description="between follicle and first visible point, in the fur"
    )

    @property
    def missing_dimensions(self) -> tuple[str, ...]:
        """Keys without which no force can be computed and that are not given."""
        return tuple(key for key in DIMENSIONS if getattr(self, key) is None)

    @property
    def hidden_length(self) -> float:
        """Follicle to first visible point [m]."""
        return 1e-3 * self.hidden_length_mm

    def si(self) -> Whisker | None:
        """Return it as a `Whisker` in SI units; None while a dimension is missing."""
        if self.missing_dimensions:
            return None
        return Whisker(
            length=1e-3 * self.length_mm,
            cone_length=1e-3 * self.cone_length_mm,
            base_radius=1e-6 * self.base_radius_um,
            youngs_modulus=1e9 * self.youngs_modulus_GPa,
            density=self.density_kg_per_m3,
            damping_rate=self.damping_per_s,
            name=self.name,
        )


class PoleSettings(_Table):
    """[pole]: the object that is touched."""

    diameter_mm: _quantity(0.02, 20, "mm", {"µm": 1e-3, "m": 1e3}) = Field(
        0.5, description="diameter of the pole"
    )
    x_px: _quantity(-20_000, 20_000, "px") | None = Field(
        None, description="its centre; found by itself where it is not given"
    )
    y_px: _quantity(-20_000, 20_000, "px") | None = Field(None, description="")

    @property
    def diameter(self) -> float:
        """Diameter [m]."""
        return 1e-3 * self.diameter_mm

    @property
    def position_px(self) -> tuple[float, float] | None:
        """Centre (x, y) in pixels, or None: to be found."""
        return None if self.x_px is None else (self.x_px, self.y_px)


class AnalysisSettings(_Table):
    """[analysis]: choices of method."""

    curvature_at_mm: _quantity(0.1, 100, "mm", {"m": 1e3, "µm": 1e-3}) = Field(
        5.5, description="arc length from the follicle at which curvature is measured"
    )
    friction: _quantity(0, 2, "") = Field(
        0.0, description="coefficient of friction between whisker and pole; 0: none"
    )

    @property
    def curvature_at(self) -> float:
        """Arc length from the follicle at which curvature is measured [m]."""
        return 1e-3 * self.curvature_at_mm


class Settings(_Table):
    """All of session.toml. Only `recording` is required.

    `whisker` holds one table per tracked whisker, anterior to posterior; it may be empty.
    """

    recording: RecordingSettings
    whisker: tuple[WhiskerSettings, ...] = ()
    pole: PoleSettings = PoleSettings()
    analysis: AnalysisSettings = AnalysisSettings()


def read_session(path) -> Settings:
    """Read and check a session.toml; SettingsError tells everything that is wrong with it."""
    path = Path(path)
    try:
        document = tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except FileNotFoundError:
        hint = "no such file; `whiskerforce init FOLDER` writes one beside the videos"
        raise SettingsError(path, [hint]) from None
    except tomllib.TOMLDecodeError as error:
        raise SettingsError(path, [f"not valid TOML: {error}; correct that line"]) from None
    except (OSError, UnicodeDecodeError) as error:
        raise SettingsError(path, [f"cannot be read as UTF-8 text: {error}"]) from None
    return settings_from(document, path)


def settings_from(document: dict[str, Any], source="session.toml") -> Settings:
    """Check a session.toml that is already parsed; `source` names it in a SettingsError."""
    document = _with_whisker_names(document)
    errors = []
    try:
        settings = Settings.model_validate(document)
    except ValidationError as error:
        errors = error.errors()
    problems = [_explain(each, document) for each in errors]
    problems += _contradictions(_without([each["loc"] for each in errors], document))
    if problems:
        raise SettingsError(source, problems)
    return settings


def _with_whisker_names(document):
    """Give whisker tables without a name one by their place: w1, w2, …"""
    tables = document.get("whisker")
    if not isinstance(tables, list):
        return document
    named = [
        {"name": f"w{i}", **table} if isinstance(table, dict) else table
        for i, table in enumerate(tables, 1)
    ]
    return {**document, "whisker": named}


def _without(places, document):
    """The document without the values at `places`, which are already found to be wrong."""
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
    if table != "whisker":
        return " ".join([f"[{table}]", *map(str, rest)])
    if not rest:
        return "[[whisker]]"
    index, *rest = rest
    entry = document["whisker"][index]
    name = entry.get("name") if isinstance(entry, dict) else None
    name = f' ("{name}")' if isinstance(name, str) else ""
    return " ".join([f"[[whisker]] {index + 1}{name}", *map(str, rest[:1])])


def _explain(error, document) -> str:
    """One pydantic error as a sentence: place, value, what is expected, what to do."""
    place, kind, value = _place(error["loc"], document), error["type"], error["input"]
    if kind == "extra_forbidden":
        return f"{place}: unknown {_table_or_key(error['loc'])}; {_known(error['loc'])}"
    if kind == "missing":
        return f"{place} is missing; {_wanted(error['loc'])}; add it"
    if kind == "implausible":
        return f"{place} = {value!r}: {error['ctx']['advice']}"
    if kind == "literal_error":
        return f"{place} = {value!r}: expected one of {', '.join(FACES)}; correct the value"
    if error["loc"] == ("whisker",):
        return "[whisker]: expected one [[whisker]] table (double brackets) per tracked whisker"
    return f"{place} = {value!r}: {_wanted(error['loc'])}, not {_toml_type(value)}"


def _field(location):
    """The declared field at a location such as ("whisker", 0, "length_mm"), or None."""
    field = Settings.model_fields.get(location[0])
    if len(location) == 1 or field is None:
        return field
    return _MODELS[location[0]].model_fields.get(location[2 if location[0] == "whisker" else 1])


_MODELS = {
    "recording": RecordingSettings,
    "whisker": WhiskerSettings,
    "pole": PoleSettings,
    "analysis": AnalysisSettings,
}


def _keys(location):
    """Names that may stand at this place of the file."""
    return list(_MODELS) if len(location) == 1 else list(_MODELS[location[0]].model_fields)


def _table_or_key(location) -> str:
    return "table or key" if len(location) == 1 else "key"


def _known(location) -> str:
    """What to write in place of an unknown key: the likeliest, or all that there are."""
    keys = _keys(location)
    close = difflib.get_close_matches(str(location[-1]), keys, n=1)
    if close:
        return f"did you mean {close[0]}?"
    return f"known here: {', '.join(keys)}; correct or remove it"


def _wanted(location) -> str:
    """What a key or table should hold."""
    if len(location) == 1 or (location[0] == "whisker" and len(location) == 2):
        return f"expected a table with {', '.join(_MODELS[location[0]].model_fields)}"
    field = _field(location)
    limits = _limits(field)
    if limits:
        return f"expected a number ({limits.low:g} to {limits.high:g} {limits.unit})"
    if field.annotation is str:
        return "expected a text in quotes, not empty"
    return f"expected one of {', '.join(FACES)}"


def _limits(field) -> _Range | None:
    """The plausible range of a numeric field, also inside `… | None`."""
    parts = [*field.metadata]
    for member in getattr(field.annotation, "__args__", ()):
        parts += getattr(member, "__metadata__", ())
    for part in parts:
        owner = getattr(getattr(part, "func", None), "__self__", None)
        if isinstance(owner, _Range):
            return owner
    return None


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
    pole = document.get("pole", {})
    if isinstance(pole, dict) and ("x_px" in pole) != ("y_px" in pole):
        absent = "y_px" if "x_px" in pole else "x_px"
        problems.append(f"[pole] {absent} is missing; give x_px and y_px, or neither")
    return problems


def _whisker_contradictions(table, place) -> list[str]:
    length, cone = _number(table, "length_mm"), _number(table, "cone_length_mm")
    hidden = _number(table, "hidden_length_mm")
    problems = []
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
        f'[[whisker]] name = "{name}" is given {names.count(name)} times; expected distinct names'
        for name in repeated
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


def session_text(settings: Settings, notes: dict[str, str] | None = None) -> str:
    """session.toml as text, every key with its comment.

    `notes` adds to comments, by "table.key" (for whiskers "whisker.key", all of them), e.g.
    ``{"recording.face": "found in the picture"}``. Keys without a value are written as
    comments, to be filled in.
    """
    notes = notes or {}
    lines = ["# Settings of a whiskerforce session.", ""]
    lines += _table_lines("[recording]", "recording", settings.recording, notes)
    for table in settings.whisker:
        lines += _table_lines("[[whisker]]", "whisker", table, notes)
    lines += _table_lines("[pole]", "pole", settings.pole, notes)
    lines += _table_lines("[analysis]", "analysis", settings.analysis, notes)
    return "\n".join(lines)


def _table_lines(header, prefix, table, notes):
    """Lines of one TOML table, its comments aligned."""
    pairs = []
    for key, field in type(table).model_fields.items():
        value = getattr(table, key)
        entry = f"# {key} = " if value is None else f"{key} = {_toml_value(value)}"
        comment = "; ".join(filter(None, [field.description, notes.get(f"{prefix}.{key}")]))
        pairs.append((entry, comment))
    width = max(len(entry) for entry, _ in pairs)
    lines = [f"{e:<{width}}   # {c}" if c else e.rstrip() for e, c in pairs]
    return [header, *lines, ""]


def _toml_value(value) -> str:
    if isinstance(value, str):
        import tomlkit

        return tomlkit.item(value).as_string()
    return repr(float(value))


def write_session(path, settings: Settings, notes: dict[str, str] | None = None) -> None:
    """Write a commented session.toml, whole or not at all; `notes` as in `session_text`."""
    from pipeline.tables import write_text

    write_text(path, session_text(settings, notes))
