"""session.toml ↔ typed settings: read, checked in one go, written back."""

import hashlib
import tomllib
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from pipeline.errors import InputError, counted
from pipeline.session.quantities import fields_of
from pipeline.session.schema import Settings
from pipeline.session.toml_fault import encoding_fault, toml_fault
from pipeline.session.validation import faults_of
from pipeline.tables.run_record import STATE_FILE
from pipeline.tables.whole_files import sha256, write_text


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
        count = counted(len(self.problems), "problem")
        lines = "".join(f"\n  - {problem}" for problem in self.problems)
        super().__init__(f"{self.source}: {count}{lines}")


def read_session(path) -> Settings:
    """Read and check a session.toml; a SettingsError lists all that is wrong with it."""
    path = Path(path)
    if path.is_dir():
        hint = f"is a folder; name the settings file in it, such as {path / 'session.toml'}"
        raise SettingsError(path, [hint])
    try:
        text = path.read_text(encoding="utf-8-sig")
        document = tomllib.loads(text)
    except FileNotFoundError:
        hint = "no such file; `whiskerforce init FOLDER` writes one beside the videos"
        if (path.parent / STATE_FILE).exists():  # in a results folder
            hint = "is missing; `whiskerforce run` with the same videos and --out writes it anew"
        raise SettingsError(path, [hint]) from None
    except tomllib.TOMLDecodeError as error:
        raise SettingsError(path, [toml_fault(text, error)]) from None
    except UnicodeDecodeError as error:
        raise SettingsError(path, [encoding_fault(error)]) from None
    except OSError as error:
        raise SettingsError(
            path, [f"cannot be read ({error.strerror}); give a settings file that you may read"]
        ) from None
    settings = settings_from(document, path)
    settings = settings.model_copy(update={"image": settings.image.beside(path.parent)})
    of_results = (path.parent / STATE_FILE).exists()  # which may have been copied without a mask
    problem = "" if of_results else settings.image.mask_problem()
    if problem:
        raise SettingsError(path, [problem])
    return settings


def settings_from(document: dict[str, Any], source="session.toml") -> Settings:
    """Check a session.toml that is already parsed; `source` names it in a SettingsError."""
    document = _with_whisker_names(document)
    errors = []
    try:
        settings = Settings.model_validate(document)
    except ValidationError as error:
        errors = error.errors()
    problems = faults_of(document, errors)
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


def settings_digest(settings: Settings) -> str:
    """Hash of all settings."""
    image = settings.image
    mask = "" if image.mask is None else sha256(Path(image.mask))  # its content, wherever it lies
    image = image.model_copy(update={"mask": mask})
    content = settings.model_copy(update={"image": image}).model_dump_json()
    return hashlib.sha256(content.encode()).hexdigest()


def session_text(settings: Settings, notes: dict[str, str] | None = None) -> str:
    """session.toml as text, every key with its comment.

    `notes` adds to comments, by "table.key" (for whiskers "whisker.key", all of them), e.g.
    ``{"recording.face": "found in the picture"}``. Keys without a value are written as
    comments, to be filled in; of whiskers behind the first that have nothing but a name, only that
    is written. Of the parameters in `[advanced]` only those that differ from their
    defaults are written.
    """
    notes = notes or {}
    lines = ["# Settings of a whiskerforce session.", ""]
    lines += _table_lines("[recording]", "recording", settings.recording, notes)
    for table in settings.whisker[:1]:
        lines += _table_lines("[[whisker]]", "whisker", table, notes)
    others = settings.whisker[1:]
    if any(_has_only_a_name(table) for table in others):
        lines += _what_is_not_there(others[0])
    for table in others:
        if _has_only_a_name(table):
            lines += ["[[whisker]]", f"name = {_toml_value(table.name)}", ""]
        else:
            lines += _table_lines("[[whisker]]", "whisker", table, notes)
    lines += _table_lines("[pole]", "pole", settings.pole, notes)
    lines += _table_lines("[image]", "image", settings.image, notes)
    lines += _table_lines("[analysis]", "analysis", settings.analysis, notes)
    for room in fields_of(type(settings.advanced)):
        table = getattr(settings.advanced, room)
        defaults = {key: each.default for key, each in fields_of(type(table)).items()}
        changed = [key for key, value in defaults.items() if getattr(table, key) != value]
        if changed:
            lines += _table_lines(f"[advanced.{room}]", f"advanced.{room}", table, notes, changed)
    return "\n".join(lines)


def _has_only_a_name(table) -> bool:
    """Whether a whisker's values are those that hold where none are given."""
    return table == type(table)(name=table.name)


def _what_is_not_there(table) -> list[str]:
    """Lines before tables of whiskers that have only a name."""
    usual = {key: each.default for key, each in fields_of(type(table)).items() if key != "name"}
    given = ", ".join(f"{key} = {value:g}" for key, value in usual.items() if value is not None)
    return [
        "# Copy keys of the whisker above into the tables below where you know their values.",
        f"# What is left out there has its usual value: {given}.",
        "",
    ]


def _table_lines(header, prefix, table, notes, keys=None):
    """Lines of one TOML table, its comments aligned; all keys, or only some."""
    pairs = []
    for key, field in fields_of(type(table)).items():
        if keys is not None and key not in keys:
            continue
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
    if isinstance(value, tuple):
        return f"[{', '.join(map(_toml_value, value))}]"
    return repr(float(value))


def write_session(path, settings: Settings, notes: dict[str, str] | None = None) -> None:
    """Write a commented session.toml, whole or not at all; `notes` as in `session_text`."""
    if not isinstance(settings, Settings):
        raise InputError(f"settings: expected `Settings`, got {type(settings).__name__}")
    write_text(path, session_text(settings, notes))
