"""`whiskerforce calibrate views`: two views in, elevation, projection error and force out."""

import numpy as np

from pipeline.app.case_by_case import each, one_whisker
from pipeline.calibrate.two_views import ViewsError, fit_views, read_points
from pipeline.calibrate.views import measure_views
from pipeline.calibrate.views_files import write_views
from pipeline.convert.results import read_results
from pipeline.tables.own_files import origins


def run_views(first, second, points, out, whisker, say) -> list[str]:
    """Put two views together and write what they show; nothing where they do not match.

    Returns why videos were left out, each in a sentence.

    Parameters
    ----------
    first, second : folders of `whiskerforce run`, of the view from above and of the other
    points : CSV file of points seen in both
    whisker : its name, or None for the only one
    say : prints a line
    """
    pairs = _pairs(read_results(first), read_results(second), first, second)
    name = one_whisker([video for video, _ in pairs], whisker)
    made_of = {video.whisker_made_of(name) for video, _ in pairs}
    origins(out, ["views.csv"], made_of)
    scales = [_scale(video) for video in next(pair for pair in pairs if all(pair))]
    views = _fitted(points, scales[0])
    say(
        f"second view: {views.second_scale:.2f} ± {views.second_se:.2f} pixels per mm; matched "
        f"points agree to {views.rms_px:.2f} px"
    )
    measured, faults = each(
        pairs,
        lambda pair: _measured(pair, scales, second, views, name),
        _sentence,
        say,
        none=f"{first}: no video can be put together with {second}",
    )
    write_views(out, views, measured, made_of)
    say(f"tables and figure: {out}")
    return faults


def _fitted(points, first_scale):
    """How the views lie to each other by a file of points, which an error names."""
    given = read_points(points)
    try:
        return fit_views(given, first_scale)
    except ViewsError as error:
        raise ViewsError(f"--points {points}: {error}") from None


def _scale(video) -> float:
    return video.settings.recording.pixels_per_mm


def _measured(pair, scales, second, views, name):
    """The views of a pair of videos, whose scales must be those of the first pair [px/mm]."""
    from pipeline.run import analyse_lines

    video, other = pair
    if other is None:
        raise ViewsError(
            f"{video.name}: no video of that name in {second}; run it, or name it like the first "
            "view's"
        )
    for view, scale in zip(pair, scales, strict=True):
        if _scale(view) != scale:
            raise ViewsError(
                f"{view.folder}: has {_scale(view):g} pixels per mm, the first video {scale:g}: "
                "put together the views of one session at a time"
            )
    return measure_views(video, other, views, name, analyse_lines)


def _pairs(ours, theirs, first, second):
    """Each of our videos with that of theirs of the same name, or None; or one with one."""
    if len(ours) == len(theirs) == 1:
        return [(ours[0], theirs[0])]
    known = {video.name: video for video in theirs}
    pairs = [(video, known.get(video.name)) for video in ours]
    if not any(other for _, other in pairs):
        raise ViewsError(
            f"{first} and {second}: no video has the same name in both ({ours[0].name}, … and "
            f"{theirs[0].name}, …); name the two views' videos alike"
        )
    return pairs


def _sentence(measured):
    touching = measured.frames[measured.frames["in_contact"]].dropna(subset=["true_path_mm"])
    if not len(touching):
        return f"{measured.video}, whisker {measured.whisker}: no contact in both views"
    elevation, error = touching["elevation_deg"], touching["projection_error_percent"]
    effect = measured.contacts["force_effect_percent"].median()
    force = f", force in its own plane {effect:+.1f} %" if np.isfinite(effect) else ""
    return (
        f"{measured.video}, whisker {measured.whisker}: {len(touching)} contact frames, elevation "
        f"{elevation.min():.1f} to {elevation.max():.1f}°, path short by {error.median():.2f} % "
        f"(99 % below {error.quantile(0.99):.2f} %){force}"
    )
