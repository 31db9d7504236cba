"""`whiskerforce import` and `export`: other programs' files in, and results out as theirs."""

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

GROUP = {"no_args_is_help": True, "rich_markup_mode": None}
importing = typer.Typer(help="Make results of what another program has tracked.", **GROUP)
exporting = typer.Typer(help="Write results in another program's format.", **GROUP)

Paths = Annotated[list[Path], typer.Argument(metavar="PATH...", help="Files, or their folders.")]
Results = Annotated[Path, typer.Argument(help="Results folder of `whiskerforce run`.")]
Out = Annotated[Path, typer.Option("--out", help="Folder to write into.")]
Config = Annotated[
    Path | None, typer.Option(help="Settings.  [default: the session.toml beside the files]")
]
Jobs = Annotated[
    int | None, typer.Option("--jobs", min=1, help="Processes at once.  [default: all cores]")
]
Debug = Annotated[bool, typer.Option("--debug", help="Show tracebacks.")]
Names = Annotated[
    str,
    typer.Option(
        help="Whiskers, in the other program's order, with commas.  [default: as in session.toml]"
    ),
]


@importing.command("janelia")
def import_janelia(
    paths: Paths,
    out: Out,
    config: Config = None,
    names: Names = "",
    jobs: Jobs = None,
    debug: Debug = False,
):
    """Lines of the Janelia Whisker Tracker: .whiskers, .measurements, and .bar for the pole."""
    _import(
        (".whiskers",), partial(_janelia, names=_split(names)), (paths, out, config, jobs, debug)
    )


def _janelia(path, settings, names):
    from pipeline.convert.janelia import read_tracked

    return read_tracked(path, settings, names)


# --- one way in --------------------------------------------------------------------------


def _import(suffixes, read, options):
    """Analyse the lines that `read(path, settings)` gives of each file with these suffixes."""
    from pipeline.app import batch, cli

    paths, out, config, jobs, debug = options
    source = batch.Source(partial(_find, suffixes=suffixes), partial(_analyse, read=read))
    progress = cli._progress_of_run
    jobs = jobs or cli._cores()
    cli._finish_run(batch.run(paths, out, config, jobs, True, False, progress, source), debug)


def _find(paths, out, suffixes):
    """The files that `paths` stand for: themselves, or those with the suffixes in a folder."""
    from pipeline.errors import InputError
    from pipeline.session.inputs import Input

    found = []
    for root in paths:
        if not root.exists():
            raise InputError(f"no such file or folder: {root}; check the spelling")
        inside = [p for p in sorted(root.rglob("*")) if p.name.lower().endswith(suffixes)]
        inside = [p for p in inside if out.resolve() not in p.resolve().parents]
        if root.is_dir() and not inside:
            raise InputError(f"{root}: no {' or '.join(suffixes)} file in it; name their folder")
        found += [Input(path, root) for path in (inside if root.is_dir() else [root])]
    return found


def _analyse(task, keep, report, corrections, read):
    """Analyse the lines of one file."""
    from pipeline.run import analyse_lines

    lines, pole, n_frames = read(task.path, task.settings)
    return analyse_lines(lines, task.settings, pole, n_frames, keep, corrections)


def _split(names):
    return tuple(name.strip() for name in names.split(",") if name.strip())


# --- one way out -------------------------------------------------------------------------


@exporting.command("janelia")
def export_janelia(results: Results, out: Out, debug: Debug = False):
    """Lines as .whiskers, .measurements and .bar, a set per video."""
    from pipeline.convert.janelia import write_tracked

    _export(results, out, write_tracked)


def _export(results, out, write):
    """Write every finished video with `write(folder, video)`, which returns the files' paths."""
    from pipeline.convert.results import read_results
    from pipeline.errors import InputError

    videos = read_results(results)
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"--out {out}: cannot write there ({error}); choose a folder") from None
    for video in videos:
        for path in write(out, video):
            typer.echo(str(path))
