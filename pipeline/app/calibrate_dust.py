"""`whiskerforce calibrate dust`: a particle on the whisker in, the follicle's motion out."""

from pipeline.app.case_by_case import each, one_whisker
from pipeline.calibrate.dust_files import pooled_slope, write_dust
from pipeline.calibrate.follicle_motion import measure_follicle_motion
from pipeline.convert.results import read_results
from pipeline.errors import counted
from pipeline.tables.own_files import origins


def run_dust(results, out, whisker, at_mm, say) -> list[str]:
    """Follow the particle through all videos and write the results; nothing where none has one.

    Returns why videos were left out, each in a sentence.

    Parameters
    ----------
    results : folder of `whiskerforce run`
    whisker : its name, or None for the only one
    at_mm : about where the particle sits, from the follicle; None: found
    say : prints a line
    """
    if at_mm is not None and not 0 < at_mm < 100:
        raise ValueError(f"--at-mm {at_mm}: expected a distance from the follicle in mm, above 0")
    videos = read_results(results)
    name = one_whisker(videos, whisker, "the whisker that the particle sits on, one")
    made_of = {video.whisker_made_of(name) for video in videos}
    origins(out, ["dust.csv"], made_of)
    advice = (
        "if there is one, give --at-mm, its rough distance from the follicle"
        if at_mm is None
        else f"is --at-mm {at_mm:g} about where it sits, and is it in focus?"
    )
    motions, faults = each(
        videos,
        lambda video: measure_follicle_motion(video, name, at_mm),
        _sentence,
        say,
        lambda video: f"{video.name}, whisker {name}: ",
        none=f"{results}: {counted(len(videos), 'video')}, and in none can a particle be "
        f"followed: {advice}",
    )
    write_dust(out, motions, made_of)
    say(slope_sentence(pooled_slope(motions)))
    say(f"tables and figures: {out}")
    return faults


def _sentence(motion):
    contacts = motion.contacts["radial_range_mm"].dropna()
    within = f", by up to {contacts.max():.2f} mm in a contact" if len(contacts) else ""
    return (
        f"{motion.video}, whisker {motion.whisker}: particle {motion.particle_mm:.2f} mm from the "
        f"follicle; the follicle moves in and out by {motion.radial_range_mm:.2f} mm{within}"
    )


def slope_sentence(slope) -> str:
    """What the contacts say about whether bending moves the follicle."""
    if slope is None:
        return "too few contacts to say whether bending moves the follicle"
    numbers = (
        f"{counted(slope.n, 'contact')}: {1e3 * slope.slope:.2f} ({1e3 * slope.low:.2f} to "
        f"{1e3 * slope.high:.2f}) µm per 1/m of curvature change, correlation {slope.r:.2f} "
        f"({slope.r_low:.2f} to {slope.r_high:.2f})"
    )
    if slope.high < 0:
        return f"{numbers}: bending pushes the follicle into the face"
    if slope.low > 0:
        return f"{numbers}: the follicle comes out of the face as the whisker bends"
    return f"{numbers}: no sign that bending moves the follicle"
