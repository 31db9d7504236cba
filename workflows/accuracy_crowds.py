"""How a crowd of whiskers fares: faces with a dozen untrimmed whiskers a side, for accuracy.py.

Each video is processed with all whiskers in its settings, and as a new user would: with frame
rate, scale and the face's side alone. Then the names are the program's own; each name stands for
the true whisker that most of its known lines lie on, one to one. Figures:

- *whiskers found*: whiskers and frames of which lines cover FOUND of the visible length, of those
  of which at least SEEN_PX can be seen.
- *false lines*: lines on no whisker; *known*: those labelled as known (confidence ≥ KNOWN).
- *centreline RMS*: distance of all visible points of lines on a whisker, across it.
- *known by name*: lines on a whisker whose confidence is ≥ KNOWN. All that follows is of these.
- *wrong name*: those on another whisker than the one that their name stands for. *exchanges*: how
  often a name goes from one whisker to another, per 1000 lines.
- *base angle*: median and 95th percentile of the error's size, beside the truth of the whisker
  that the line lies on; *coverage*: those whose 95 % interval holds the truth.
"""

from typing import NamedTuple

import measuring
import numpy as np
import pages
import pandas as pd
from accuracy_figures import covered
from over_videos import with_range
from scipy.optimize import linear_sum_assignment

from pipeline.run import analyse
from pipeline.session.session_file import settings_from
from synthetic.scoring import line_scoring

CROWDS = ("dense_row", "mouse_face_on_top", "rat_both_sides")
FOUND = 0.6  # part of a whisker's visible length
SEEN_PX = 20.0
KNOWN = 0.5
GIVEN, ALONE = "all whiskers", "face and scale"  # what the settings hold


class Crowd(NamedTuple):
    """One video of a crowd beside its truth: `measuring.line_table`, parts of `LineScores`."""

    lines: pd.DataFrame
    whiskers: pd.DataFrame
    distance_px: np.ndarray
    frames: int

    @classmethod
    def of(cls, video: measuring.Measured):
        """What was measured already."""
        return cls(video.lines, video.scores.whiskers, video.scores.distance_px, video.n_frames)


def bare_settings(settings):
    """Frame rate, scale and the face's side of a session, and nothing else."""
    known = settings.recording
    kept = ("frames_per_second", "pixels_per_mm", "face")
    return settings_from({"recording": {key: getattr(known, key) for key in kept}})


def crowd(path, session, settings) -> Crowd:
    """Process a rendered video and put its lines beside the truth."""
    video, chunks = measuring.RenderedVideo.of(path, session), []
    analysis = analyse(path, settings, keep=chunks.append)
    traced = measuring.join_chunks(chunks)
    scores = line_scoring.score_lines(traced, video.lines())
    lines = measuring.line_table(scores, traced, analysis.frames, video.frames())
    return Crowd(lines, scores.whiskers, scores.distance_px, analysis.n_frames)


def known_lines(each: Crowd) -> pd.DataFrame:
    """Known lines on a whisker, with the whisker that their name stands for, as `meant`."""
    lines = each.lines
    known = lines[(lines["nearest"] != "") & (lines["confidence"] >= KNOWN)]
    counts = pd.crosstab(known["whisker"], known["nearest"])
    pairs = linear_sum_assignment(counts.to_numpy(), maximize=True)
    meant = {counts.index[i]: counts.columns[j] for i, j in zip(*pairs, strict=True)}
    return known.assign(meant=known["whisker"].map(meant).fillna(""))


def exchanges(known: pd.DataFrame) -> np.ndarray:
    """Whether a name goes to another whisker, for all known lines but each name's first."""
    ordered = known.sort_values(["whisker", "frame"], kind="stable")
    same = ordered["whisker"].eq(ordered["whisker"].shift())
    moved = ordered["nearest"].ne(ordered["nearest"].shift())
    return moved[same].to_numpy(float)


def samples_of(each: Crowd) -> dict[str, np.ndarray]:
    """What a video adds to the figures."""
    lines, known = each.lines, known_lines(each)
    seen = each.whiskers[each.whiskers["visible_px"] >= SEEN_PX]
    false = lines[lines["nearest"] == ""]
    sure = false[false["confidence"] >= KNOWN]

    def per_frame(table):
        return np.bincount(table["frame"], minlength=each.frames).astype(float)

    return {
        "found": (seen["covered"] >= FOUND).to_numpy(float),
        "false": per_frame(false),
        "false_known": per_frame(sure),
        "distance": each.distance_px,
        "known": (lines.loc[lines["nearest"] != "", "confidence"] >= KNOWN).to_numpy(float),
        "wrong": (known["nearest"] != known["meant"]).to_numpy(float),
        "exchanges": exchanges(known),
        "angle": np.abs(known["angle_error_deg"].to_numpy(float)),
        "angle_covered": covered(known["angle_error_deg"], known["base_angle_se_deg"]),
    }


FIGURES = {  # name: sample, statistic, format
    "whiskers found": ("found", np.mean, "{:.1%}"),
    "false lines / frame": ("false", np.mean, "{:.3f}"),
    "false, known / frame": ("false_known", np.mean, "{:.3f}"),
    "centreline RMS [px]": ("distance", line_scoring.rms, "{:.3f}"),
    "known by name": ("known", np.mean, "{:.1%}"),
    "wrong name": ("wrong", np.mean, "{:.2%}"),
    "exchanges / 1000": ("exchanges", lambda each: 1000 * np.mean(each), "{:.2f}"),
    "base angle, median [°]": ("angle", np.median, "{:.2f}"),
    "base angle, 95 % [°]": ("angle", lambda each: np.quantile(each, 0.95), "{:.2f}"),
    "base angle, coverage": ("angle_covered", np.nanmean, "{:.1%}"),
}


def both_samples(video: measuring.Measured, path, session, settings) -> dict[str, dict]:
    """Samples of what was measured, and of a run with face and scale alone, by what was given."""
    alone = crowd(path, session, bare_settings(settings))
    return {GIVEN: samples_of(Crowd.of(video)), ALONE: samples_of(alone)}


def crowds_text(crowds: dict[str, list[dict]]) -> str:
    """The table of all crowds, by preset what `both_samples` gives; "" where there is none."""
    rows = [
        [preset, given, str(len(videos)), *_cells([each[given] for each in videos])]
        for preset, videos in crowds.items()
        if all(videos)
        for given in (GIVEN, ALONE)
    ]
    if not rows:
        return ""
    table = pages.table(["preset", "given", "videos", *FIGURES], rows)
    return f"\n\n### Crowds, in brackets the range over videos\n\n{table}"


def _cells(videos) -> list[str]:
    """Each figure of some videos' samples, with the range from video to video."""
    cells = []
    for sample, statistic, form in FIGURES.values():
        found = with_range([each[sample] for each in videos], statistic)
        cells.append(pages.cell_and_ends(form, *found))
    return cells
