"""`whiskerforce import` and `export`: other programs' files in, and results out as theirs."""

import re
from functools import partial
from pathlib import Path

import typer

from pipeline.app import terminal
from pipeline.app.options import GROUP, Debug, Jobs, Out, Results, argument, option

importing = typer.Typer(help="Analyse what another program has tracked.", **GROUP)
exporting = typer.Typer(help="Write results in another program's format.", **GROUP)

FILES = {  # what a program's files are called: a pattern, and in words
    "janelia": (r"\.whiskers$", "NAME.whiskers"),
    "dlc": (r"DLC.*\.(csv|h5)$", "NAMEDLC_….csv or NAMEDLC_….h5"),
    "sleap": (r"analysis.*\.(csv|h5)$", "NAME.analysis.h5 or NAME.analysis.csv"),
}

Paths = argument(list[Path], "PATH", "Files, or folders with such files.")
Config = option(
    Path | None, "FILE", "Settings file to use.  [default: the session.toml beside the files]"
)
Names = option(
    str,
    "NAMES",
    "Names of the whiskers in the other program's order, separated by "
    "commas.  [default: as in session.toml]",
)


def _janelia(path, settings, names):
    from pipeline.convert.janelia import read_tracked

    return read_tracked(path, settings, names)


def _key_points(path, settings, names, program):
    from pipeline.convert.deeplabcut import read_deeplabcut
    from pipeline.convert.keypoints import lines_of
    from pipeline.convert.sleap import read_sleap

    points = {"dlc": read_deeplabcut, "sleap": read_sleap}[program](path)
    return lines_of(points, settings, path, names), None, len(points.xy)


def _command_for(program, read, words) -> None:
    """Add a command that imports what `read(path, settings, names)` reads of each file."""

    @importing.command(program, help=words)
    def command(
        paths: Paths,
        out: Out,
        config: Config = None,
        names: Names = "",
        jobs: Jobs = None,
        debug: Debug = False,
    ):
        from pipeline.app import batch

        of_whiskers = tuple(name.strip() for name in names.split(",") if name.strip())
        source = batch.Source(
            partial(_find, program=program),
            partial(_analyse, read=partial(read, names=of_whiskers)),
            partial(_check_names, of_whiskers),
        )
        cores, shown = jobs or terminal.cores(), terminal.progress
        summary = batch.run(paths, out, config, cores, True, False, shown, source)
        terminal.finish_run(summary, debug, terminal.say)


_command_for(
    "janelia", _janelia,
    "Lines from the Janelia Whisker Tracker.\n\n"
    "NAME.whiskers with NAME.measurements and, for the pole, NAME.bar.",
)  # fmt: skip
_command_for(
    "dlc", partial(_key_points, program="dlc"),
    "Key points along whiskers, from DeepLabCut.\n\n"
    "CSV, or HDF5, which needs the extra `formats`.",
)  # fmt: skip
_command_for(
    "sleap", partial(_key_points, program="sleap"),
    "Key points along whiskers, from SLEAP.\n\n"
    "Analysis files as CSV, or HDF5, which needs the extra `formats`.",
)  # fmt: skip


@importing.command("whacc")
def import_whacc(
    path: argument(Path, "FILE", "HDF5 file that WhACC wrote."),
    out: option(Path, "RESULTS", "Results folder of the same videos.", "--out"),
    whisker: option(
        str, "NAME", "Whisker that the contacts belong to.  [default: the only one]"
    ) = "",
    debug: Debug = False,
):
    """Contacts from WhACC, for videos already processed.

    They replace the contacts that were found: they are written as corrections, and forces are
    computed for them.
    """
    from pipeline.convert.results import read_results
    from pipeline.convert.whacc import take_contacts
    from pipeline.curate.corrected import renew_tables
    from pipeline.errors import InputError, need_content
    from pipeline.tables.result_exchange import settled

    need_content(path, "WhACC's HDF5 file, named,")
    if path.is_dir():
        raise InputError(f"{path}: a folder, not a file; name WhACC's HDF5 file in it")
    videos = read_results(out)
    with settled(out) as kept:
        for written in take_contacts(path, videos, whisker):
            typer.echo(str(written))
        problems, said = renew_tables(out)
    for line in kept + said:
        typer.echo(line)
    for name, problem in problems.items():
        raise InputError(f"{out / name}: {problem}")


# --- one way in --------------------------------------------------------------------------


def _find(paths, out, program):
    """The files that `paths` stand for: themselves, or those in a folder with a program's names.

    Of a file there as CSV and as HDF5, the CSV.
    """
    from pipeline.errors import InputError, need_content
    from pipeline.session.inputs import Input

    found, (pattern, names) = [], FILES[program]
    for root in paths:
        if not root.exists():
            raise InputError(f"no such file or folder: {root}; check the spelling")
        need_content(root, f"files called {names}")
        inside = [p for p in sorted(root.rglob("*")) if re.search(pattern, p.name)]
        inside = [p for p in inside if out.resolve() not in p.resolve().parents]
        inside = [p for p in inside if p.suffix != ".h5" or p.with_suffix(".csv") not in inside]
        if root.is_dir() and not inside:
            raise InputError(f"{root}: no file called {names} in it; name the files themselves")
        found += [Input(path, root) for path in (inside if root.is_dir() else [root])]
    return found


def _check_names(names, settings):
    """InputError where a name is given twice, or a session.toml has other whiskers only."""
    from pipeline.errors import InputError, need_distinct

    need_distinct(names, "--names: {} is there twice; give each whisker its own name")
    for each in settings:
        known = [whisker.name for whisker in each.whisker]
        unknown = [name for name in names if known and name not in known]
        if unknown:
            raise InputError(
                f"--names: session.toml has no [[whisker]] table for {', '.join(unknown)}, but "
                f"for {', '.join(known)}; correct the names, or add the table"
            )


def _analyse(task, keep, report, corrections, read):
    """Analyse the lines of one file."""
    from pipeline.errors import InputError
    from pipeline.run import analyse_lines

    if not task.path.stat().st_size:
        raise InputError("the file is empty; copy it again, or let the other program write it")
    lines, pole, n_frames = read(task.path, task.settings)
    return analyse_lines(lines, task.settings, pole, n_frames, keep, corrections)


# --- one way out -------------------------------------------------------------------------


@exporting.command("janelia")
def export_janelia(results: Results, out: Out, debug: Debug = False):
    """Files for the Janelia Whisker Tracker.

    For each video .whiskers, .measurements and, where a pole was found, .bar.
    """
    from pipeline.convert.janelia import write_tracked

    _export(results, out, write_tracked)


def _export(results, out, write):
    """Write every finished video with `write(folder, video)`, which returns the files' paths.

    One whose tables are damaged is left out; InputError where none can be written, or arguments
    cannot be used.
    """
    from pipeline.tables.own_files import write_new

    _, left_out = _each_of(
        results,
        lambda video: write_new(out, lambda new: write(new, video), [video.made_of]),
        lambda paths: "\n".join(map(str, paths)),
    )
    terminal.leave(left_out)


def _each_of(results, read, sentence):
    """What is read of each video, and why others are left out; a `sentence` on each is printed."""
    from pipeline.app.case_by_case import each
    from pipeline.convert.results import read_results

    return each(
        read_results(results),
        read,
        sentence,
        lambda line: line and typer.echo(line),
        lambda video: f"{video.name}: ",
        none=f"{results}: no video can be exported",
    )


@exporting.command("mat")
def export_mat(
    results: Results,
    out: Out,
    protraction: option(
        str,
        "DIRECTION",
        "Direction of protraction in the picture: upward, downward, leftward or "
        "rightward.  [default: counter-clockwise]",
    ) = "",
    debug: Debug = False,
):
    """MATLAB files like the Hires lab's WhiskerTrialLite.

    One per video, with the names used there.
    """
    from pipeline.convert.matlab import write_matlab

    _export(results, out, partial(write_matlab, protraction=protraction))


@exporting.command("nwb")
def export_nwb(
    results: Results,
    out: Out,
    start: option(
        str,
        "TIME",
        "Date and time of the recording's start, such as "
        "2024-11-22T10:30:00+00:00.  [default: the file's time]",
    ) = "",
    subject: option(str, "NAME", "Name of the animal.") = "",
    species: option(str, "NAME", 'Latin name of the species, such as "Mus musculus".') = "",
    sex: option(
        str, "SEX", "Sex of the animal: F (female), M (male), O (other), U (unknown)."
    ) = "",
    age: option(str, "AGE", "Age of the animal as an ISO 8601 duration (P90D: 90 days).") = "",
    debug: Debug = False,
):
    """Neurodata Without Borders.

    One file per video; needs the extra `nwb`.
    """
    from pipeline.convert.nwb import write_nwb

    animal = {"subject_id": subject, "species": species, "sex": sex, "age": age}
    _export(results, out, partial(write_nwb, start=start, moves_to=out, **animal))


@exporting.command("movement")
def export_movement(results: Results, out: Out, debug: Debug = False):
    """Poses for the library `movement`.

    One netCDF file per video; needs the extra `formats`.
    """
    from pipeline.convert.movement import write_movement

    _export(results, out, write_movement)


@exporting.command("whacc")
def export_whacc(results: Results, out: Out, debug: Debug = False):
    """Contacts in WhACC's format.

    One HDF5 file for all videos; needs the extra `formats`.
    """
    from pipeline.convert.whacc import write_whacc
    from pipeline.tables.own_files import write_new

    read, left_out = _each_of(results, lambda video: (video, video.frames), lambda _: "")
    videos = [video for video, _ in read]
    made_of = [video.made_of for video in videos]
    for path in write_new(out, lambda new: [write_whacc(new / "whacc.h5", videos)], made_of):
        typer.echo(str(path))
    terminal.leave(left_out)
