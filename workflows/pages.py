"""Tables in Markdown, and the pages that they are put into."""

from pathlib import Path

import numpy as np

from pipeline.tables.whole_files import write_text


def table(header: list[str], rows: list[list[str]]) -> str:
    """A Markdown table with aligned columns."""
    widths = [max(len(r[k]) for r in [header, *rows]) for k in range(len(header))]
    rule = ["-" * w for w in widths]
    lines = (
        "| " + " | ".join(c.ljust(w) for c, w in zip(r, widths, strict=True)) + " |"
        for r in [header, rule, *rows]
    )
    return "\n".join(lines)


def cell(form, value) -> str:
    """A number by its format; a dash where it is not known."""
    return form.format(value) if np.isfinite(value) else "–"


def cell_and_ends(form, value, low, high) -> str:
    """A number, and in brackets the ends of its range or interval; a dash if it is not known."""
    ends = f" ({cell(form, low)} to {cell(form, high)})" if np.isfinite(value) else ""
    return cell(form, value) + ends


def publish(text: str, page, name: str) -> None:
    """Print a text; where a page is given, put it there, too, as of `write_between`."""
    print(text)
    if page:
        write_between(page, name, text)


def write_between(path, name: str, text: str) -> None:
    """Put `text` between the comments `<!-- name: begin -->` and `<!-- name: end -->` of a file.

    Raises ValueError where the file has no such comments.
    """
    path = Path(path)
    begin, end = f"<!-- {name}: begin -->", f"<!-- {name}: end -->"
    before, found, rest = path.read_text("utf-8").partition(begin)
    _, found_end, after = rest.partition(end)
    if not (found and found_end):
        raise ValueError(f"{path} must hold {begin} and {end}")
    write_text(path, f"{before}{begin}\n{text}\n{end}{after}")
