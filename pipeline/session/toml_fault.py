"""Where a file is not valid TOML: line, column, the line's text, and what to do."""

import codecs
import re

PLACE = re.compile(r" \(at (?:line (\d+), column (\d+)|end of document)\)$")
ADVICE = "correct that line: decimal points, no commas; texts between straight quotes"
TWICE = "a table or key may be there only once: remove one of them"
BACKSLASH = "correct that line: in the names of files, write / in place of \\"
OF_BACKSLASHES = ("Unescaped", "Invalid hex value")  # how tomllib's messages about them begin
SAVE = "save it as UTF-8 (Notepad: Save as, Encoding UTF-8)"
SHOWN = 60  # characters of a line before the place, and behind it


def toml_fault(text: str, error) -> str:
    """The fault in a file's `text` as a sentence, then the line with a mark below the place.

    `error` is what tomllib says; its message ends with the place, counted from 1.
    """
    message = str(error)
    found = PLACE.search(message)
    lines = text.replace("\r\n", "\n").rstrip().split("\n")
    line, column = len(lines), len(lines[-1]) + 1
    if found and found[1]:
        line, column = int(found[1]), int(found[2])
    what = PLACE.sub("", message)
    return (
        f"line {line}, column {column}: not valid TOML: {what}; {_advice(what)}\n"
        f"{_marked(lines[min(line, len(lines)) - 1], column)}"
    )


def encoding_fault(error: UnicodeDecodeError) -> str:
    """The fault of a file that is not UTF-8, as a sentence."""
    content = error.object
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return f"is saved as UTF-16; {SAVE}"
    line = content.count(b"\n", 0, error.start) + 1
    return f"line {line}: a character that is not UTF-8; write it again and {SAVE}"


def _advice(what: str) -> str:
    """What to do about a fault that tomllib names."""
    if "twice" in what or "overwrite" in what:
        return TWICE
    return BACKSLASH if what.startswith(OF_BACKSLASHES) else ADVICE


def _marked(line: str, column: int) -> str:
    """The part of a line about a column, counted from 1, with a mark in the line below."""
    start = max(column - 1 - SHOWN, 0)
    part = line[start : column - 1 + SHOWN].replace("\t", " ").rstrip()
    return f"      {part}\n      {' ' * (column - 1 - start)}^"
