"""How whiskerforce does on real recordings: against whiskers followed by eye, and time reversed.

    python workflows/real_recordings.py VIDEO:left VIDEO:top --scales 12,16,25,init \\
        --labels whiskers_by_eye.json --backwards

Each video is processed as `whiskerforce run` does, with only the frame rate, the face's side
(after the colon) and the scale given; the scale `init` stands for the session.toml that
`whiskerforce init` writes for this video, unchanged. `--backwards` processes the frames in reverse
order, too, from a lossless copy. Videos in which no run finds a line are named below the tables.
The first table is of lines and names:

- *lines / frame*: all lines, over all frames. *known*: those of them with a confidence ≥ 0.5.
- *clear*, *faint* (with `--labels`, in the frames followed by eye; the format is in
  `real_lines.py`): whiskers found. 60 % of the whisker beyond its first 15 px lie within 2.5 px
  of one line. Lines of up to 60 px are left out here and in the next two.
- *wrong / frame*: lines of which less than half lies within 2.5 px of what was followed by eye.
  What lies in ignored polygons is not judged, nor is a line with less than 30 px outside of them.
- *distance*: median [px] from the whisker by eye to the line, where it is within 2.5 px.
- *CPU*: time per frame [ms] of decoding, following, naming and measuring. Start-up is left out:
  scene, templates, and compilation, for which the first video is first processed once more.
- *names agree*: of the lines known in both directions, those with the same name. Lines of the two
  are the same where 60 % of the shorter lies within 2.5 px of the other; names are paired one to
  one so that most agree.
- *links*: of two lines of neighbouring frames that bear one name forwards, known or not, and are
  both found backwards, those that bear one name there. One exchange of two names is two of
  thousands of links, but changes many names: links tell two versions of the program apart
  that names do not.

A second table is of base angles, forwards:

- *known*: lines known by name (confidence ≥ 0.5), to which all figures refer.
- *base*, *visible*, *first 40 px*: jitter [degrees] of `base_angle_deg`, of `visible_angle_deg`
  and of the slope of the first 40 px of the same centrelines. It is the median size of second
  differences over frames that follow each other, pooled over whiskers, and includes what the
  whisker really does within three frames; *slow*: in the half of the frames in which the visible
  part turns least; *of one frame*: SD of the error that is another one in every frame,
  1.4826/√70 of the median size of fourth differences, in which little of a whisker's motion is
  left.
- *steps*: of more than 10° from one frame to the next, per 1000; *smooth*: those where the
  centreline itself does not jump (its first 40 px turn by less than 10°); *alone*: those with
  which the visible part does not turn at least half as far. In the others it moves along: the
  whisker's own motion, or a name that has gone over to another line.
- *resting*: part of the neighbouring frames, in the slow half, whose difference lies within 1.96
  standard errors of the difference; 0.95 at least is wanted.
"""

import argparse
import sys
import tempfile
import time
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path

import measuring
import numpy as np
import pages
import pandas as pd
import real_angles
import real_directions
import real_lines

from pipeline.app.init import findings, look_at
from pipeline.run import analyse
from pipeline.session.session_file import settings_from
from pipeline.tables import Centrelines

SIDES = ("left", "right", "top", "bottom")
INIT = "init"  # in the place of a scale
HEADER = [
    "video", "face", "px/mm", "direction", "lines / frame", "known", "clear", "faint",
    "wrong / frame", "distance", "CPU", "names agree", "links",
]  # fmt: skip


@dataclass(frozen=True)
class Run:
    """What was found in one video: lines, frames table, number of frames, CPU time a frame [s]."""

    lines: Centrelines
    frames: pd.DataFrame
    n_frames: int
    cpu: float


class FollowingClock:
    """CPU time [s] from the first frame that is followed until all lines have names.

    It is a `progress` of `pipeline.run.analyse`.
    """

    def __init__(self):
        self.begun = self.ended = np.nan

    def __call__(self, step):
        """Note the time at the steps that begin and end what is measured."""
        if step.stage == "following" and step.done == 1:
            self.begun = time.process_time()
        elif step.stage == "forces":
            self.ended = time.process_time()


def processed(video: Path, settings) -> Run:
    """Process a video as `whiskerforce run` does."""
    chunks, clock = [], FollowingClock()
    found = analyse(video, settings, keep=chunks.append, progress=clock)
    after_the_first = max(found.n_frames - 1, 1)
    cpu = (clock.ended - clock.begun) / after_the_first
    return Run(measuring.join_chunks(chunks), found.frames, found.n_frames, cpu)


def settings_for(video: Path, face: str, scale: str, frames_per_second: float):
    """The settings of a scale, or those that `whiskerforce init` writes."""
    if scale == INIT:
        with ExitStack() as opened:
            return settings_from(findings({video.name: look_at(video, opened)})[0])
    recording = {"frames_per_second": frames_per_second, "pixels_per_mm": float(scale)}
    return settings_from({"recording": recording | {"face": face}})


def line_row(run: Run, labelled) -> list[str]:
    """One row of the first table, from the lines on to the CPU."""
    lines = run.lines
    known = lines.confidence >= real_angles.KNOWN
    return [
        pages.cell("{:.1f}", len(lines) / max(run.n_frames, 1)),
        pages.cell("{:.0%}", known.mean() if len(known) else np.nan),
        *real_lines.score(labelled, real_lines.lines_of(lines)).cells(),
        pages.cell("{:.1f}", 1e3 * run.cpu),
    ]


def agreement(forwards, backwards) -> list[str]:
    """Names and links of the two directions that agree, as cells."""
    pairs = real_directions.pairs_of_lines(forwards, backwards)
    names = real_lines.of(*real_directions.names_agree(forwards, backwards, pairs))
    agree, links = real_directions.links_agree(forwards, backwards, pairs)
    return [names, pages.cell("{:.1%}", agree / links if links else np.nan)]


def rows_of(video: Path, settings, labelled, backwards: Path | None):
    """Rows of the first table, with their directions, and the run forwards.

    backwards : the same video in reverse order; None: forwards alone
    """
    run = processed(video, settings)
    rows = [["forwards", *line_row(run, labelled), "–", "–"]]
    if backwards is not None:
        other = processed(backwards, settings)
        other = replace(other, lines=real_directions.turned_back(other.lines, other.n_frames))
        row = [*line_row(other, labelled), *agreement(run.lines, other.lines)]
        rows.append(["backwards", *row])
    return rows, run


def tables_of(video: Path, face: str, labelled, args):
    """Rows of both tables for one video, all scales."""
    lines, angles = [], []
    with tempfile.TemporaryDirectory() as folder:
        reverse = real_directions.write_backwards(video, folder) if args.backwards else None
        for scale in args.scales:
            settings = settings_for(video, face, scale, args.frames_per_second)
            number = f"{settings.recording.pixels_per_mm:g}"
            named = f"{INIT}: {number}" if scale == INIT else number
            rows, run = rows_of(video, settings, labelled, reverse)
            side = settings.recording.face
            lines += [[video.stem, side, named, *row] for row in rows]
            angles.append(real_angles.angle_row(video.stem, named, run.frames, run.lines))
            for row in (*lines[-len(rows) :], angles[-1]):
                print(" | ".join(row), file=sys.stderr, flush=True)
    return lines, angles


def tables_text(lines: list[list[str]], angles: list[list[str]]) -> str:
    """Both tables; a video in which no run found a line gets a sentence instead of rows."""
    runs: dict[str, list[str]] = {}
    for video, _, _, _, _, known, *_ in lines:
        runs.setdefault(video, []).append(known)
    empty = {video: len(known) for video, known in runs.items() if set(known) == {"–"}}
    tables = [
        pages.table(header, [row for row in rows if row[0] not in empty])
        for header, rows in ((HEADER, lines), (real_angles.HEADER, angles))
    ]
    said = [f"No line was found in any of the {n} runs of {video}." for video, n in empty.items()]
    return "\n\n".join([*tables, *said])


def video_and_face(text: str) -> tuple[Path, str]:
    """A video and the side with the face, of VIDEO:SIDE."""
    path, _, face = text.rpartition(":")
    if face not in SIDES or not path:
        raise argparse.ArgumentTypeError(
            f"{text!r}: expected VIDEO:SIDE, with the face's side {', '.join(SIDES)}"
        )
    return Path(path), face


def scales(text: str) -> list[str]:
    """Scales [px/mm], and `init`, of a list with commas."""
    for each in (given := text.split(",")):
        try:
            good = each == INIT or float(each) > 0
        except ValueError:
            good = False
        if not good:
            raise argparse.ArgumentTypeError(
                f"{each!r}: expected pixels per mm or {INIT}, with commas between them"
            )
    return given


def labels_for(path: Path | None, videos) -> dict:
    """The labelled frames by the video's stem; none without a file of labels.

    Raises ValueError where the file has labels of none of the videos.
    """
    if path is None:
        return {}
    labels = real_lines.read_labels(path)
    stems = [video.stem for video in videos]
    if not set(stems) & set(labels):
        raise ValueError(
            f"{path}: labels of {', '.join(labels)}, expected some of {', '.join(stems)}; "
            "give videos under the names that they had when they were labelled"
        )
    return labels


def parser_of(doc) -> argparse.ArgumentParser:
    """The options that all tables of real recordings have; `doc` is that of the script."""
    parser = argparse.ArgumentParser(description=doc.split("\n\n")[0])
    parser.add_argument("videos", type=video_and_face, nargs="+", metavar="VIDEO:SIDE")
    parser.add_argument("--labels", type=Path, help="JSON of whiskers followed by eye")
    parser.add_argument("--frames-per-second", type=float, default=1000.0)
    parser.add_argument("--write", type=Path, help="a Markdown file to put the tables into")
    return parser


def arguments(argv=None):
    """The command line's arguments."""
    parser = parser_of(__doc__)
    parser.add_argument(
        "--scales", type=scales, default="12,16,25", help=f"pixels per mm, or {INIT}"
    )
    parser.add_argument("--backwards", action="store_true", help="process them backwards, too")
    return parser.parse_args(argv)


def main(argv=None) -> int:
    """Print the tables of all videos and scales."""
    measuring.limit_threads()
    args = arguments(argv)
    labels = labels_for(args.labels, [video for video, _ in args.videos])
    video, face = args.videos[0]
    processed(video, settings_for(video, face, args.scales[0], args.frames_per_second))  # compiles
    lines, angles = [], []
    for video, face in args.videos:
        rows = tables_of(video, face, labels.get(video.stem, ()), args)
        lines, angles = lines + rows[0], angles + rows[1]
    pages.publish(tables_text(lines, angles), args.write, "real recordings")
    return 0


if __name__ == "__main__":
    sys.exit(main())
