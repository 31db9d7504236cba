"""The `whiskerforce` command: arguments, progress, exit status; no science.

Exit status: 0 all done; 1 some videos, figures or report failed; 2 unusable arguments or settings.
"""

import os
import re
import sys
import traceback
from pathlib import Path

import typer

from pipeline.app import convert, terminal
from pipeline.app.calibrate import calibrate
from pipeline.app.options import Debug, Jobs, Out, Results, argument, option, switch, whole
from pipeline.app.terminal import FAILED, UNUSABLE, say
from pipeline.runtime.interrupts import INTERRUPTED, listen

app = typer.Typer(
    name="whiskerforce",
    help="High-speed videos of rodent whiskers in, forces at the follicle out.",
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"]},
    epilog="Where to begin: `whiskerforce demo`. With videos of your own: `whiskerforce init "
    "FOLDER`, then `whiskerforce run FOLDER --out RESULTS`.",
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
app.add_typer(calibrate, name="calibrate")
app.add_typer(convert.importing, name="import")
app.add_typer(convert.exporting, name="export")


def _show_version(wanted: bool):
    if wanted:
        from pipeline import __version__

        typer.echo(f"whiskerforce {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: switch(
        "Print the version and exit.", "--version", callback=_show_version, is_eager=True
    ) = False,
    debug: Debug = False,
):
    pass


def _list_presets(preset: str) -> str:
    if preset == "list":
        from pipeline.app.demo import preset_lines

        for line in preset_lines():
            say(line)
        raise typer.Exit
    return preset


Quiet = switch("Print only warnings and failures; no progress.", "--quiet")


@app.command()
def run(
    paths: argument(list[Path], "PATH", "Videos, or folders of videos."),
    out: Out,
    config: option(
        Path | None, "FILE", "Settings file to use.  [default: the session.toml beside the videos]"
    ) = None,
    jobs: Jobs = None,
    overwrite: switch("Process all videos again, even finished ones.", "--overwrite") = False,
    overlay: switch("Also write each video with the results drawn in.", "--overlay") = False,
    quiet: Quiet = False,
    debug: Debug = False,
):
    """Turn videos into tables, figures and a report.

    Settings are read from the session.toml beside the videos; `whiskerforce init` writes one.
    Finished videos are skipped on the next run unless settings, input or version changed.
    """
    from pipeline.app import batch
    from pipeline.runtime.numba_cache import is_compiled

    if not (quiet or is_compiled()):
        say(
            "this first run compiles parts of the program while it works, which takes a minute or "
            "two; later runs do not, and speeds are given without it"
        )
    jobs, shown = jobs or terminal.cores(), None if quiet else terminal.progress
    summary = batch.run(paths, out, config, jobs, overwrite, overlay, shown)
    terminal.finish_run(summary, debug, terminal.say_nothing if quiet else say)


@app.command()
def init(
    folder: argument(Path, "FOLDER", "Folder with the videos."),
    overwrite: switch(
        "Replace an existing session.toml; it is kept as session.toml.old.", "--overwrite"
    ) = False,
    config: option(
        Path | None, "FILE", "Settings file to preview; only the picture is written."
    ) = None,
    debug: Debug = False,
):
    """Look at the videos and write a first session.toml.

    It is written to their folder, with a comment on every setting and a preview picture of what
    was found. An existing session.toml is kept; the picture then shows what is found with its
    settings, under the names that `run` will use.
    """
    from pipeline.app.init import init_folder
    from pipeline.runtime.numba_cache import is_compiled

    if not is_compiled("pipeline/detection/line_fit.py"):  # what takes longest here
        say(
            "this first time, parts of the program are compiled, which takes a minute or two; "
            "later it takes seconds"
        )
    for line in init_folder(folder, overwrite, config, say):
        say(line)


@app.command()
def demo(
    out: option(Path, "DIR", "Folder for videos and results; created if missing.", "--out") = Path(
        "whiskerforce-demo"
    ),
    jobs: Jobs = None,
    debug: Debug = False,
):
    """Render a short session, process it, compare with the truth."""
    from pipeline.app.demo import run_demo

    raise typer.Exit(
        FAILED if run_demo(out, jobs or terminal.cores(), terminal.progress, say) else 0
    )


@app.command()
def synth(
    folder: argument(Path, "DIR", "Folder for the videos; created if missing."),
    preset: option(
        str,
        "NAME",
        "What to render; `--preset list` shows the choices.",
        callback=_list_presets,
        is_eager=True,
    ),
    seed: whole("Random seed; the same seed renders the same videos.", 0) = 0,
    trials: whole("Number of videos to render.  [default: as many as the preset has]", 1) = None,
    frames: whole("Number of frames per video, 50 or more.", 50) = 1000,
    jobs: Jobs = None,
    quiet: Quiet = False,
    debug: Debug = False,
):
    """Render videos with known truth.

    Their session.toml is written beside them, and tables of the truth with the same columns as
    the results.
    """
    from pipeline.app.demo import render

    shown, tell = (None, terminal.say_nothing) if quiet else (terminal.progress, say)
    render(folder, preset, seed, trials, jobs or terminal.cores(), shown, tell, frames)


@app.command()
def figures(
    results: Results,
    truth: option(
        Path | None, "DIR", "Folder of truth tables, written by `synth`, to compare with."
    ) = None,
    video: option(str | None, "NAME", "Video shown in panels a and b.") = None,
    whisker: option(str | None, "NAME", "Whisker shown in panels a and b.") = None,
    contact: whole("Number of the contact shown there.  [default: a typical one]", 1) = None,
    debug: Debug = False,
):
    """Draw the paper's figure 3 from the tables.

    The numbers behind it are written as CSV.
    """
    from pipeline.reports.figures import write_fig3
    from pipeline.reports.session_numbers import damaged_videos
    from pipeline.tables.result_exchange import settled

    with settled(results) as kept:
        for line in kept:
            say(line)
        damaged = damaged_videos(results)
        for path in write_fig3(results, truth, video, whisker, contact, damaged):
            say(str(path))
        terminal.leave(_say_damaged(damaged))


def _say_damaged(damaged) -> bool:
    """Name the videos whose results cannot be read; whether there are any."""
    for video, fault in damaged.items():
        say(f"left out: {video}: {fault}")
    return bool(damaged)


@app.command()
def curate(
    results: argument(Path, "RESULTS", "Results folder of `whiskerforce run`."),
    port: whole("Port to serve the page on; 0: any free port.", 0, 65535) = 0,
    browser: switch("Open the page in the browser.") = True,
    name: option(
        str | None,
        "NAME",
        "Your name, saved with every correction.  [default: your user name on this computer]",
    ) = None,
    debug: Debug = False,
):
    """Correct contacts in the browser.

    Every correction is saved at once; tables, figures and report follow when you finish, in the
    page or with Ctrl-C. decisions.csv in the results folder lists what was decided, by whom and
    when.
    """
    from pipeline.app.session_files import write_pictures
    from pipeline.curate import curate as open_page
    from pipeline.reports.session_numbers import damaged_videos

    server = open_page(results, port=port, open_browser=browser, say=say, name=name)
    damaged = damaged_videos(results)
    failed, kept = write_pictures(results, damaged=damaged)
    for line in (*server.results.kept, *kept, *failed):
        say(line)
    for video, fault in server.results.faults.items():
        say(
            f"{results / video}: its corrections are saved, but its tables do not follow from "
            f"them ({fault}): mend that, and curate or run again"
        )
    if _say_damaged(damaged) or failed or server.results.faults:
        raise typer.Exit(FAILED)
    say(f"tables, figures and report follow from the corrections: {results / 'report.html'}")


@app.command()
def paper(out: Out, debug: Debug = False):
    """Draw the paper's model figures.

    The numbers behind each are written as CSV, with modes.csv and published.csv.
    """
    from pipeline.tables.own_files import write_new
    from whiskermodel.paper.files import write_paper

    for path in write_new(out, lambda new: write_paper(new, progress=say)):
        say(str(path))


def main(arguments=None):
    """Run the command; turn expected errors into a message and an exit status."""
    arguments = _with_home(sys.argv[1:] if arguments is None else arguments)
    try:
        listen()
        _prepare()
        command = typer.main.get_command(app)
        _without_types(command)
        command(arguments, standalone_mode=True)
    except KeyboardInterrupt:
        typer.echo("interrupted", err=True)
        sys.exit(INTERRUPTED)
    except Exception as error:
        if "--debug" in arguments:
            traceback.print_exc()
        typer.echo(_explain(error), err=True)
        sys.exit(UNUSABLE if _is_unusable(error) else FAILED)


def _without_types(command) -> None:
    """Let the help name arguments as they are typed, not by their types in Python."""
    for each in command.params:
        if each.param_type_name == "argument":
            each.display_type_rich = lambda ctx: ""
    for inner in getattr(command, "commands", {}).values():
        _without_types(inner)


def _prepare() -> None:
    """Set up what all commands need; a warning where the system gives too little."""
    from pipeline.runtime.address_space import shortage
    from pipeline.runtime.garbage import search_seldom
    from pipeline.runtime.numba_cache import prepare_cache
    from pipeline.runtime.workers import THREADS

    prepare_cache()
    for name in THREADS:  # the matrices are small: threads would only wait for each other
        os.environ.setdefault(name, "1")
    search_seldom()
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:  # closed, as by `>&-`
            setattr(sys, name, os.fdopen(os.open(os.devnull, os.O_WRONLY), "w"))
        if hasattr(stream, "reconfigure"):  # not every console has every letter of a file's name
            stream.reconfigure(errors="replace")
    if said := shortage():
        typer.echo(said, err=True)


def _with_home(arguments) -> list[str]:
    """The arguments, with the user's folder for a `~` that the shell has left, as in --out=~/a."""
    parts = [re.fullmatch(r"(--[\w-]+=)?(~(?:[/\\].*)?)", each, re.DOTALL) for each in arguments]
    return [
        f"{part[1] or ''}{Path(part[2]).expanduser()}" if part else each
        for each, part in zip(arguments, parts, strict=True)
    ]


def _is_unusable(error) -> bool:
    """The arguments or settings are to blame, not the program."""
    from pipeline.errors import VideoError

    return isinstance(error, (ValueError, VideoError, OSError))


def _explain(error) -> str:
    from pipeline.errors import lacks_memory, with_advice

    if _is_unusable(error):
        return f"error: {with_advice(error) if isinstance(error, OSError) else error}"
    if type(error).__module__.split(".")[0] in ("pipeline", "synthetic"):  # said for people
        return f"error: {error}"
    what = f"{type(error).__name__}: {error}"
    if lacks_memory(what):
        return f"error: out of memory ({what}); close other programs, and try again"
    return f"error: {what} (an error in the program; --debug shows where)"


if __name__ == "__main__":
    main()
