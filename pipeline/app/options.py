"""Options that several commands share."""

from pathlib import Path
from typing import Annotated

import typer

from pipeline.errors import InputError

GROUP = {"no_args_is_help": True, "rich_markup_mode": None}  # of every group of commands


def option(kind, metavar, words, *names, **more):
    """Type of an option of a `kind`: what its value is called, and its help."""
    return Annotated[kind, typer.Option(*names, metavar=metavar, help=words, **more)]


def switch(words, *names, **more):
    """Type of an option without a value."""
    return Annotated[bool, typer.Option(*names, help=words, **more)]


def argument(kind, metavar, words, **more):
    """Type of an argument."""
    return Annotated[kind, typer.Argument(metavar=metavar, help=words, **more)]


def number(words, kind=float | None):
    """Type of an option whose value is a number, or a list of them."""
    return option(kind, "X", words, parser=_number)


def _number(text) -> float:
    try:
        return float(text)
    except ValueError:
        raise typer.BadParameter(
            f"{text!r}: expected a number with a decimal point, such as 2.5"
        ) from None


def whole(words, least, most=None, *names):
    """Type of an option whose value is a whole number from `least` to `most`; None: no limit."""
    limits = f"of at least {least}" if most is None else f"from {least} to {most}"

    def read(text) -> int:
        try:
            value = int(text)
        except ValueError:
            value = least - 1
        if least <= value and (most is None or value <= most):
            return value
        raise typer.BadParameter(f"{text!r}: expected a whole number {limits}")

    return option(int | None, "N", words, *names, parser=read)


def up_to_date(results: Path) -> Path:
    """The results folder, its tables brought up to a person's corrections."""
    from pipeline.curate.corrected import bring_up_to_date

    for line in bring_up_to_date(results):
        typer.echo(line)
    return results


def a_folder(out: Path) -> Path:
    """Where results will go; InputError before any work where they cannot."""
    for place in (out, *out.parents):
        if place.exists() and not place.is_dir():
            raise InputError(f"--out {out}: {place} is a file, not a folder; choose another one")
    return out


Results = argument(Path, "RESULTS", "Results folder of `whiskerforce run`.", callback=up_to_date)
Out = option(Path, "DIR", "Folder to write to; created if missing.", "--out", callback=a_folder)
Jobs = whole("Number of parallel processes.  [default: one per core]", 1, None, "--jobs")
Debug = switch("Show where in the program an error occurred (traceback).", "--debug")
