"""`whiskerforce calibrate ringdown`: slips in, Young's modulus and damping out."""

from pipeline.app.case_by_case import each
from pipeline.calibrate.ringdown import check_frame_rate, fit_slip, pool, whisker_of
from pipeline.calibrate.ringdown_files import write_into, write_ringdown
from pipeline.calibrate.slips import find_slips, named_slips
from pipeline.errors import counted
from pipeline.tables.own_files import origins

DIMENSIONS = ("length", "cone_length", "base_radius", "density")  # on which the modulus depends


def run_ringdown(results, out, places, follicle, into, name, say) -> list[str]:
    """Fit all slips, write the results, then the session; nothing where no slip can be fitted.

    Returns why slips were left out, each in a sentence.

    Parameters
    ----------
    places : what --frames names, or empty: the slips that `run` found
    follicle : "fixed", "pinned" or a number, as text
    into, name : a session.toml to write to, or None; the whisker's name, or None for the only one
    say : prints a line
    """
    boundary = _boundary(follicle)
    slips = named_slips(results, places) if places else find_slips(results)
    slips = _of_one_whisker(slips, name)
    settings = slips[0].video.settings
    whisker = whisker_of(settings, slips[0].whisker)
    check_frame_rate(settings.recording.frames_per_second, whisker, boundary)
    origins(out, ["ringdown.csv"], {s.video.whisker_made_of(s.whisker) for s in slips})
    fits, faults = each(
        slips,
        lambda slip: _fit(slip, slips[0], boundary),
        lambda fit: f"{fit.slip}: {_sentence(fit, fit.youngs_modulus(whisker, boundary))}",
        say,
        lambda slip: f"{slip}: ",
        none=f"{results}: {counted(len(slips), 'slip')}, and none can be fitted",
    )
    together = pool(fits, whisker, boundary)
    write_ringdown(out, fits, together, whisker, boundary)
    _say_pooled(together, follicle, say)
    say(f"tables and figure: {out}")
    if into:
        say(write_into(into, name, together))
    return faults


def _boundary(follicle):
    """The follicle's end as `whiskermodel.modes` takes it."""
    if follicle in ("fixed", "pinned"):
        return follicle
    try:
        stiffness = float(follicle)
    except ValueError:
        stiffness = -1.0
    if not stiffness > 0:
        raise ValueError(
            f"--follicle {follicle}: expected fixed, pinned, or its torsional stiffness in units "
            "of E I0/L, a number above 0"
        )
    return stiffness


def _of_one_whisker(slips, name):
    """The slips of whisker `name`, or of the only one; ValueError otherwise."""
    names = sorted({slip.whisker for slip in slips})
    if name is None and len(names) > 1:
        raise ValueError(
            f"slips of several whiskers ({', '.join(names)}), each with a Young's modulus of its "
            "own: name one with --whisker"
        )
    own = [slip for slip in slips if name in (None, slip.whisker)]
    if not own:
        raise ValueError(f"--whisker {name}: no slip of it; there are slips of {', '.join(names)}")
    return own


def _fit(slip, first, boundary):
    """Fit a slip, ValueError where it is another whisker's than the first slip."""
    own, other = (whisker_of(each.video.settings, each.whisker) for each in (slip, first))
    if any(getattr(own, key) != getattr(other, key) for key in DIMENSIONS):
        raise ValueError(
            f"the whisker has other dimensions in {slip.video.name} than in {first.video.name}: "
            "calibrate with the results of one session at a time"
        )
    return fit_slip(slip, boundary)


def _sentence(each, modulus):
    """Frequency, damping and Young's modulus, of a slip or of all, in words."""
    low, value, high = (1e-9 * part for part in (modulus.low, modulus.value, modulus.high))
    return (
        f"{each.angular_frequency} rad/s, damping {each.damping} 1/s, "
        f"E {value:.4g} ({low:.4g} to {high:.4g}) GPa"
    )


def _say_pooled(together, follicle, say):
    count = counted(together.n, "slip")
    say(f"{count}, {follicle} follicle: {_sentence(together, together.youngs_modulus)}")
    say(
        "  with the whisker's dimensions as in session.toml: 1 % of length is 4 % of E, 1 % of "
        "base radius 2 %"
    )
