"""`whiskerforce calibrate`: measurements that fill session.toml."""

from pathlib import Path

import typer

from pipeline.app.options import GROUP, Debug, Out, Results, argument, number, option, up_to_date
from pipeline.app.terminal import leave

calibrate = typer.Typer(help="Measure whiskers, follicle motion and elevation.", **GROUP)

Into = option(
    Path | None, "FILE", "Settings file (session.toml) to write the results to.", "--into"
)
Whisker = option(str | None, "NAME", "Name of the whisker in that settings file.", "--whisker")


@calibrate.command()
def geometry(
    images: argument(list[Path], "IMAGE", "Micrographs, one whisker in each."),
    out: Out,
    pixels_per_mm: number("Scale of the micrographs: pixels per millimetre.") = None,
    scale_bar_mm: number(
        "Length of the scale bar in the micrographs, if their scale is not known."
    ) = None,
    mass_ug: number(
        "Mass of each whisker [µg], in the order of the images, for its density.",
        list[float] | None,
    ) = None,
    into: Into = None,
    whisker: Whisker = None,
    debug: Debug = False,
):
    """Measure plucked whiskers in micrographs.

    Gives length, base radius, tip radius and cone length of each, with standard errors, and the
    mean of several. See docs/calibrate_geometry.md.
    """
    from pipeline.app.calibrate_geometry import run_geometry

    scale, target = (pixels_per_mm, scale_bar_mm), _target(into, whisker)
    leave(run_geometry(images, scale, out, mass_ug or (), target, typer.echo))


@calibrate.command()
def ringdown(
    results: Results,
    out: Out,
    frames: option(
        list[str] | None,
        "VIDEO:WHISKER:FRAME",
        "First free frame after a slip; repeat the option for every slip.  "
        "[default: the slips that `run` found]",
    ) = None,
    follicle: option(
        str,
        "HOW",
        "How the follicle holds the base: fixed, pinned, or a rotational "
        "stiffness in units of E I/L (at the base).",
    ) = "fixed",
    into: Into = None,
    whisker: Whisker = None,
    debug: Debug = False,
):
    """Measure Young's modulus and damping from slips.

    A whisker rings after slipping past the pole; the frequency gives Young's modulus. See
    docs/calibrate_ringdown.md.
    """
    from pipeline.app.calibrate_ringdown import run_ringdown

    if into is not None:
        _target(into, whisker)
    leave(run_ringdown(results, out, frames or (), follicle, into, whisker, typer.echo))


@calibrate.command()
def dust(
    results: Results,
    out: Out,
    whisker: option(
        str | None, "NAME", "Whisker with the particle.  [default: the only one]", "--whisker"
    ) = None,
    at_mm: number(
        "Rough distance of the particle from the follicle [mm].  [default: found]"
    ) = None,
    debug: Debug = False,
):
    """Measure follicle motion from dust on a whisker.

    Gives how far the follicle moves in and out of the face, and whether bending moves it. See
    docs/calibrate_dust.md.
    """
    from pipeline.app.calibrate_dust import run_dust

    leave(run_dust(results, out, whisker, at_mm, typer.echo))


@calibrate.command()
def views(
    first: argument(
        Path, "RESULTS", "Results of `run` of the view from above.", callback=up_to_date
    ),
    second: argument(
        Path, "RESULTS2", "Results of `run` of the second view.", callback=up_to_date
    ),
    points: option(Path, "CSV", "CSV file of points that both views show."),
    out: Out,
    whisker: option(
        str | None, "NAME", "Name of the whisker.  [default: the only one]", "--whisker"
    ) = None,
    debug: Debug = False,
):
    """Measure elevation from two views at right angles.

    Also gives the errors of path length and force in a single view. The views may be in two
    videos, or side by side in one. See docs/calibrate_views.md.
    """
    from pipeline.app.calibrate_views import run_views

    leave(run_views(first, second, points, out, whisker, typer.echo))


def _target(into, whisker):
    """Where results go, (session.toml, whisker's name), checked before any work; or None."""
    from pipeline.session.edit import check_whisker

    if into is None and whisker is None:
        return None
    if into is None or whisker is None:
        raise ValueError(
            "--into and --whisker: expected both or neither; give the session.toml and the name "
            "of the whisker in it"
        )
    check_whisker(into, whisker)
    return into, whisker
