"""New values for a whisker of a session.toml; comments, order and line ends stay as they are."""

import re
from pathlib import Path

from pipeline.session.session_file import SettingsError, read_session, settings_from
from pipeline.tables.whole_files import write_text


def check_whisker(path, name: str) -> None:
    """Raise SettingsError where a session.toml cannot be used or has no whisker of this name."""
    names = [whisker.name for whisker in read_session(path).whisker]
    if name not in names:
        known = ", ".join(names) or "no [[whisker]] at all"
        raise SettingsError(
            path, [f'has no whisker named "{name}" (found: {known}); correct --whisker']
        )


def set_whisker_values(path, name: str, values: dict[str, float]) -> str:
    """Write `values` into the [[whisker]] table `name` of a session.toml, or nothing at all.

    Keys that stand there as comments to be filled in are filled in. Returns what was written, in
    words.

    Raises
    ------
    SettingsError
        Where there is no such whisker, or the file would no longer be right.
    """
    import tomlkit

    path = Path(path)
    check_whisker(path, name)
    index = [whisker.name for whisker in read_session(path).whisker].index(name)
    with open(path, encoding="utf-8-sig") as file:
        text, line_ends = file.read(), file.newlines
    document = tomlkit.parse(_filled_in(text, index, values))
    table = document["whisker"][index]
    for key, value in values.items():
        table[key] = float(value)
    text = tomlkit.dumps(document)
    settings_from(document.unwrap(), path)
    line_end = line_ends if isinstance(line_ends, str) else None  # of several kinds: the system's
    # a link stays one: several folders may share the file
    write_text(path.resolve(), text, line_end)
    return f"{path}, whisker {name}: {', '.join(f'{k} = {v:g}' for k, v in values.items())}"


def whisker_has(path, name: str, key: str) -> bool:
    """Whether a whisker of a session.toml has a value for `key`."""
    (whisker,) = [each for each in read_session(path).whisker if each.name == name]
    return getattr(whisker, key) is not None


def _filled_in(text, index, keys):
    """The text with `# key =` of whisker table number `index` made into `key = 0.0`."""
    lines, table = text.split("\n"), -1
    for i, line in enumerate(lines):
        if line.lstrip().startswith("["):
            table += line.replace(" ", "").startswith("[[whisker]]")
            here = table == index and line.replace(" ", "").startswith("[[whisker]]")
            continue
        empty = re.match(r"#\s*(\w+)\s*=\s*(#.*)?$", line)
        if table >= 0 and here and empty and empty[1] in keys:
            lines[i] = f"{empty[1]} = 0.0   {empty[2] or ''}".rstrip()
    return "\n".join(lines)
