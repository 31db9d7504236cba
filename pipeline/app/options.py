"""Options that several commands share."""

from pathlib import Path
from typing import Annotated

import typer


def up_to_date(results: Path) -> Path:
    """The results folder, its tables brought up to a person's corrections."""
    from pipeline.curate.corrected import bring_up_to_date

    for line in bring_up_to_date(results):
        typer.echo(line)
    return results


Results = Annotated[
    Path,
    typer.Argument(
        metavar="RESULTS", help="Results folder of `whiskerforce run`.", callback=up_to_date
    ),
]
Out = Annotated[
    Path, typer.Option("--out", metavar="DIR", help="Folder to write to; created if missing.")
]
Jobs = Annotated[
    int | None,
    typer.Option(
        "--jobs", metavar="N", min=1, help="Number of parallel processes.  [default: one per core]"
    ),
]
Debug = Annotated[
    bool, typer.Option("--debug", help="Show where in the program an error occurred (traceback).")
]
