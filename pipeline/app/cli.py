"""The `whiskerforce` command: arguments, progress, exit status; no science.

Exit status: 0 all done; 1 some videos failed; 2 unusable arguments or settings.
"""

import gc
import os
import shlex
import sys
import traceback
from pathlib import Path
from typing import Annotated

import typer

from pipeline.app import convert
from pipeline.app.calibrate import calibrate
from pipeline.app.options import Debug, Jobs, Out

app = typer.Typer(
    name="whiskerforce",
    help="High-speed videos of rodent whiskers in, forces at the follicle out.",
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"]},
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
app.add_typer(calibrate, name="calibrate")
app.add_typer(convert.importing, name="import")
app.add_typer(convert.exporting, name="export")

FAILED, UNUSABLE, INTERRUPTED = 1, 2, 130


def _show_version(wanted: bool):
    if wanted:
        from pipeline import __version__

        typer.echo(f"whiskerforce {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_show_version, is_eager=True, help="Print the version and end."
        ),
    ] = False,
    debug: Debug = False,
):
    pass


def _cores() -> int:
    """Cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


Quiet = Annotated[
    bool, typer.Option("--quiet", help="Print only warnings and failures; no progress.")
]


@app.command()
def run(
    paths: Annotated[
        list[Path], typer.Argument(metavar="PATH...", help="Videos, or folders of videos.")
    ],
    out: Out,
    config: Annotated[
        Path | None,
        typer.Option(help="Settings file to use.  [default: the session.toml beside the videos]"),
    ] = None,
    jobs: Jobs = None,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Process finished videos again, too.")
    ] = False,
    overlay: Annotated[
        bool,
        typer.Option("--overlay", help="Write a copy of each video with the findings drawn in."),
    ] = False,
    quiet: Quiet = False,
    debug: Debug = False,
):
    """Turn videos into tables, figures and a report.

    Finished videos are skipped on the next run unless settings, input or version changed.
    """
    from pipeline.app import batch
    from pipeline.runtime import interrupts

    interrupts.listen()
    jobs, shown = jobs or _cores(), None if quiet else _progress
    summary = batch.run(paths, out, config, jobs, overwrite, overlay, shown)
    _finish_run(summary, debug, _say_nothing if quiet else _say)


def _progress(*what):
    """A bar on a terminal, plain lines elsewhere; `what` as of `pipeline.runtime.Progress`."""
    from pipeline.runtime import progress

    if not sys.stdout.isatty():
        return progress.Lines(*what, write=_say)
    from rich.console import Console

    return progress.Bar(*what, console=Console())


def _say(line: str):
    typer.echo(line)
    sys.stdout.flush()


def _say_nothing(line: str):
    pass


def _finish_run(summary, debug, say):
    """Say what came of it, failures last, and leave with the exit status."""
    say(summary.line())
    for name, path in (("report", "report.html"), ("contacts", "contacts.csv")):
        if (summary.out / path).is_file():
            say(f"{name}: {(summary.out / path).resolve()}")
    overlays = sorted(summary.out.glob("*/overlay.*"))
    if overlays:
        more = f" and {len(overlays) - 1} more" if len(overlays) > 1 else ""
        say(f"overlay: {overlays[0].resolve()}{more}")
    if any(each.contacts for each in summary.outcomes):
        say(
            f"next: look at the report, then `whiskerforce curate {shlex.quote(str(summary.out))}`"
        )
    for problem in summary.problems:
        _say(f"warning: {problem}")
    failed = summary.of("failed")
    for names in summary.copies:
        _say(f"warning: {' and '.join(names)} are the same video: its contacts count twice")
    if summary.lost:
        _say(
            f"no longer there: {', '.join(summary.lost)}; left out of videos.csv and "
            "contacts.csv, their own results stay"
        )
    for each in summary.of("warning"):
        _say(f"warning: {each.video}: {each.message}")
    for each in failed:
        if debug and each.details:
            typer.echo(each.details, err=True)
        _say(f"failed: {each.video} ({each.path}): {each.message}")
    if summary.interrupted:
        _say(
            "interrupted; what is finished is kept, the same command goes on from here and makes "
            "figures and report"
        )
        raise typer.Exit(INTERRUPTED)
    raise typer.Exit(FAILED if failed else 0)


@app.command()
def init(
    folder: Annotated[Path, typer.Argument(help="Folder with the videos.")],
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace the session.toml that is there.")
    ] = False,
    config: Annotated[
        Path | None,
        typer.Option(help="Settings file to draw a preview from; nothing else is written."),
    ] = None,
    debug: Debug = False,
):
    """Write a first session.toml from a look at the videos.

    It lies in their folder, has a comment for every setting, and comes with a preview picture of
    what was found. Where there is one already, it is kept, and the picture shows what its settings
    find, with the names that `run` will give.
    """
    from pipeline.app.init import init_folder

    for line in init_folder(folder, overwrite, config, _say):
        _say(line)


@app.command()
def demo(
    out: Annotated[
        Path,
        typer.Option("--out", help="Folder for videos and results; made where it is missing."),
    ] = Path("whiskerforce-demo"),
    jobs: Jobs = None,
    debug: Debug = False,
):
    """Render a small session, process it, compare with its truth."""
    from pipeline.app.demo import run_demo

    raise typer.Exit(FAILED if run_demo(out, jobs or _cores(), _progress, _say) else 0)


@app.command()
def synth(
    folder: Annotated[
        Path,
        typer.Argument(metavar="DIR", help="Folder for the videos; made where it is missing."),
    ],
    preset: Annotated[
        str, typer.Option(help="Name of what to render; `--preset list` lists the names.")
    ],
    seed: Annotated[
        int,
        typer.Option(
            min=0, help="Seed of the random numbers: the same seed renders the same videos."
        ),
    ] = 0,
    trials: Annotated[
        int | None,
        typer.Option(
            min=1, help="Number of videos to render.  [default: as many as the preset has]"
        ),
    ] = None,
    frames: Annotated[int, typer.Option(min=50, help="Length of each video.")] = 1000,
    jobs: Jobs = None,
    quiet: Quiet = False,
    debug: Debug = False,
):
    """Render videos with known truth.

    Beside the videos lie their session.toml and truth tables with the columns of the results.
    """
    from pipeline.app.demo import preset_lines, render

    if preset == "list":
        for line in preset_lines():
            _say(line)
        return
    shown, say = (None, _say_nothing) if quiet else (_progress, _say)
    render(folder, preset, seed, trials, jobs or _cores(), shown, say, frames)


@app.command()
def figures(
    results: Annotated[Path, typer.Argument(help="Results folder of `whiskerforce run`.")],
    truth: Annotated[
        Path | None,
        typer.Option(
            help="Folder of true tables, written by `synth`, to compare the results with."
        ),
    ] = None,
    video: Annotated[
        str | None, typer.Option(help="Name of the video that panels a and b show.")
    ] = None,
    whisker: Annotated[str | None, typer.Option(help="Whisker that panels a and b show.")] = None,
    contact: Annotated[
        int | None,
        typer.Option(
            min=1, help="Number of the contact that they show.  [default: a typical one]"
        ),
    ] = None,
    debug: Debug = False,
):
    """Draw the paper's figure 3 from the tables.

    The numbers behind it are written too, as CSV.
    """
    from pipeline.reports.figures import write_fig3
    from pipeline.tables.result_exchange import settled

    with settled(results):
        for path in write_fig3(results, truth, video, whisker, contact):
            _say(str(path))


@app.command()
def curate(
    results: Annotated[Path, typer.Argument(help="Results folder of `whiskerforce run`.")],
    port: Annotated[
        int, typer.Option(min=0, help="Port that the page is served at; 0 takes any that is free.")
    ] = 0,
    browser: Annotated[bool, typer.Option(help="Open the page in the browser at once.")] = True,
    name: Annotated[
        str | None,
        typer.Option(
            help="Name of who curates, saved with every correction.  "
            "[default: the user's name on this computer]"
        ),
    ] = None,
    debug: Debug = False,
):
    """Correct contacts in the browser.

    decisions.csv in the results folder lists what was decided, by whom and when.
    """
    from pipeline.curate import curate as open_page
    from pipeline.reports.figures import write_fig3
    from pipeline.reports.report import write_report

    open_page(results, port=port, open_browser=browser, say=_say, name=name)
    write_fig3(results)
    write_report(results)


@app.command()
def paper(
    out: Out,
    debug: Debug = False,
):
    """Draw the paper's model figures.

    Each comes with its CSV; modes.csv and published.csv are beside them.
    """
    from whiskermodel.paper.files import write_paper

    for path in write_paper(out, progress=_say):
        _say(str(path))


def main(arguments=None):
    """Run the command; turn expected errors into a message and an exit status."""
    from pipeline.runtime.numba_cache import prepare_cache
    from pipeline.runtime.workers import THREADS

    prepare_cache()
    for name in THREADS:  # the matrices are small: threads would only wait for each other
        os.environ.setdefault(name, "1")
    gc.set_threshold(50_000, 20, 20)  # imports make much that stays: searching it takes 0.2 s
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):  # not every console has every letter of a file's name
            stream.reconfigure(errors="replace")
    arguments = sys.argv[1:] if arguments is None else list(arguments)
    try:
        app(arguments, standalone_mode=True)
    except KeyboardInterrupt:
        typer.echo("interrupted", err=True)
        sys.exit(INTERRUPTED)
    except Exception as error:
        if "--debug" in arguments:
            traceback.print_exc()
        typer.echo(_explain(error), err=True)
        sys.exit(UNUSABLE if _is_unusable(error) else FAILED)


def _is_unusable(error) -> bool:
    """The arguments or settings are to blame, not the program."""
    from pipeline.errors import VideoError

    return isinstance(error, (ValueError, VideoError, OSError))


def _explain(error) -> str:
    from pipeline.errors import why

    if _is_unusable(error):
        return f"error: {why(error) if isinstance(error, OSError) else error}"
    return f"error: {type(error).__name__}: {error} (a fault of the program; --debug shows where)"


if __name__ == "__main__":
    main()
