"""Options that several commands share."""

from pathlib import Path
from typing import Annotated

import typer

Out = Annotated[Path, typer.Option("--out", help="Folder to write to; created if missing.")]
Jobs = Annotated[
    int | None,
    typer.Option("--jobs", min=1, help="Number of parallel processes.  [default: one per core]"),
]
Debug = Annotated[
    bool, typer.Option("--debug", help="Show where in the program an error occurred (traceback).")
]
