"""What changes of the picture do to what is found on real recordings.

    python workflows/changed_pictures.py VIDEO:left VIDEO:top --labels whiskers_by_eye.json

Each video is processed as it is, and again with each of `CHANGES`, with only the frame rate, the
face's side (after the colon) and the scale given; these are changed with the picture. The lines
are then turned back to where they lie in the picture as it is, and compared with the whiskers
followed by eye there (`real_lines.py`), so that all rows judge the same whiskers by the same
distances. Of every second frame, only labels of even frames count. Turned by 7°, corners leave
the picture, and the ends of some whiskers with them.

Noise is drawn from a seed that is printed: `--seed` makes the same, `--only` leaves out other
changes.

The columns are those of `real_recordings.py`; lines of up to 60 px are not judged. All frames of
a video are held in memory, as they are and changed: the program is for pieces of some hundred
frames.
"""

import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import measuring
import numpy as np
import pages
import real_recordings

from pipeline.video import open_video
from synthetic.encode import video_suffix, write_video
from synthetic.scene import Codec

HEADER = [
    "video", "change", "clear", "faint", "wrong / frame", "distance", "lines / frame", "known",
]  # fmt: skip
LARGER, SMALLER = 1.5, 0.7
SLANT = 7.0  # degrees, anticlockwise
FLICKER = 0.06  # of the light
FLICKER_RATE = 0.37  # cycles a frame
TOWARDS = {"left": (-1, 0), "right": (1, 0), "top": (0, -1), "bottom": (0, 1)}  # x, y


# What is done to pictures --------------------------------------------------------------------


def frames_of(video) -> np.ndarray:
    """All frames of a video, uint8 (frames, height, width)."""
    with open_video(video) as source:
        return np.stack(list(source.frames()))


def grey(values) -> np.ndarray:
    """Grey levels, rounded, within what eight bits hold."""
    return np.clip(np.rint(values), 0, 255).astype(np.uint8)


def unchanged(frames, rng):
    """The frames as they are."""
    return frames


def each(change) -> Callable:
    """What changes a video frame by frame, out of what changes one frame."""
    return lambda frames, rng: np.stack([change(frame) for frame in frames])


def gamma(exponent: float) -> Callable:
    """A camera's curve: below 1, dark parts are lifted."""
    return each(lambda frame: grey(255 * (frame / 255) ** exponent))


def noise(sd: float) -> Callable:
    """Noise of this SD [grey levels] in every pixel."""
    return lambda frames, rng: np.stack(
        [grey(frame + rng.normal(0, sd, frame.shape)) for frame in frames]
    )


def resized(factor: float) -> Callable:
    """Frames so many times as large."""
    how = cv2.INTER_CUBIC if factor > 1 else cv2.INTER_AREA
    return each(lambda frame: cv2.resize(frame, None, fx=factor, fy=factor, interpolation=how))


def h264(crf: int) -> Callable:
    """Frames as H.264 of this constant rate factor; an odd last row or column is left out."""

    def encoded(frames, rng):
        height, width = (size // 2 * 2 for size in frames.shape[1:])
        codec = Codec("h264", crf=crf)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / f"video{video_suffix(codec)}"
            write_video(path, frames[:, :height, :width], codec)
            return frames_of(path)

    return encoded


def flickering(frames, rng):
    """Light that rises and falls."""
    light = 1 + FLICKER * np.sin(2 * np.pi * FLICKER_RATE * np.arange(len(frames)))
    return np.stack([grey(frame * level) for frame, level in zip(frames, light, strict=True)])


def slanted(frame):
    """A frame turned by `SLANT` about its middle; beyond its border, the border goes on."""
    size = frame.shape[::-1]
    return cv2.warpAffine(
        frame, slant(*size), size, flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE
    )


# Where that moves points ---------------------------------------------------------------------


def slant(width, height) -> np.ndarray:
    """(2, 3) of a turn by `SLANT` about the middle of the picture."""
    return cv2.getRotationMatrix2D(((width - 1) / 2, (height - 1) / 2), SLANT, 1.0)


def enlarged(factor: float) -> Callable:
    """(2, 3) of enlarging. Pixels are areas: the outer edge of the first stays, not its centre."""
    shift = (factor - 1) / 2
    return lambda width, height: np.array([[factor, 0, shift], [0, factor, shift]])


def stays(width, height) -> np.ndarray:
    """(2, 3) of nothing that moves."""
    return np.eye(2, 3)


# The changes ---------------------------------------------------------------------------------


@dataclass(frozen=True)
class Change:
    """One way to change a video.

    name : in the table
    pictures : from frames (n, height, width), uint8, and a random generator: the frames changed
    moves : from width and height of the frames as they are: (2, 3), which with x, y, 1 of a point
        [px] in the picture as it is gives x, y in the changed one
    every : which frames are left: 2 is every second
    """

    name: str
    pictures: Callable = unchanged
    moves: Callable = stays
    every: int = 1


CHANGES = (
    Change("as it is"),
    Change("mirrored", each(np.fliplr), lambda w, h: np.array([[-1, 0, w - 1], [0, 1, 0]])),
    Change("upside down", each(np.flipud), lambda w, h: np.array([[1, 0, 0], [0, -1, h - 1]])),
    Change("turned by 90°", each(np.rot90), lambda w, h: np.array([[0, 1, 0], [-1, 0, w - 1]])),
    Change("turned by 7°", each(slanted), slant),
    Change("half the light", each(lambda frame: grey(0.5 * frame))),
    Change("gamma 0.6", gamma(0.6)),
    Change("gamma 1.6", gamma(1.6)),
    Change("less contrast: 100 + 0.4 × grey", each(lambda frame: grey(100 + 0.4 * frame))),
    Change("noise of SD 4", noise(4)),
    Change("noise of SD 8", noise(8)),
    Change("blur of SD 1.2 px", each(lambda frame: cv2.GaussianBlur(frame, (0, 0), 1.2))),
    Change("1.5 times as large", resized(LARGER), enlarged(LARGER)),
    Change("0.7 times as large", resized(SMALLER), enlarged(SMALLER)),
    Change("H.264, crf 23", h264(23)),
    Change("H.264, crf 28", h264(28)),
    Change("light flickers by 6 %", flickering),
    Change("every second frame", every=2),
)
BY_NAME = {change.name: change for change in CHANGES}


def changed(frames, change: Change, seed: int) -> np.ndarray:
    """Frames (n, height, width), uint8, after a change; noise from the seed."""
    return change.pictures(frames[:: change.every], np.random.default_rng(seed))


def side_after(face: str, moves) -> str:
    """The side of the changed picture that shows what was on the side `face`."""
    towards = moves[:, :2] @ TOWARDS[face]
    return max(TOWARDS, key=lambda side: np.dot(towards, TOWARDS[side]))


def scale_after(scale: float, moves) -> float:
    """Pixels per mm of the changed picture."""
    return scale * np.sqrt(abs(np.linalg.det(moves[:, :2])))


def turned_back(lines, moves, every: int):
    """`Centrelines` of a changed video, with places and frame numbers of the video as it is."""
    points = np.stack([lines.x_px, lines.y_px]) - moves[:, 2:]
    x, y = np.linalg.solve(moves[:, :2], points)
    return replace(lines, x_px=x, y_px=y, frame=lines.frame * every)


# The table -----------------------------------------------------------------------------------


def row_of(frames, change: Change, face: str, labelled, args) -> list[str]:
    """What is found after a change: the columns from the change on."""
    height, width = frames.shape[1:]
    moves = change.moves(width, height)
    rate = args.frames_per_second / change.every
    scale = str(scale_after(args.scale, moves))
    settings = real_recordings.settings_for(None, side_after(face, moves), scale, rate)
    run = real_recordings.processed(changed(frames, change, args.seed), settings)
    run = replace(run, lines=turned_back(run.lines, moves, change.every))
    seen = [label for label in labelled if label.frame % change.every == 0]
    lines, known, *found, _cpu = real_recordings.line_row(run, seen)
    return [change.name, *found, lines, known]


def rows_of(video: Path, face: str, labelled, args) -> list[list[str]]:
    """The table's rows of one video."""
    frames = frames_of(video)
    rows = []
    for name in args.only:
        rows.append([video.stem, *row_of(frames, BY_NAME[name], face, labelled, args)])
        print(" | ".join(rows[-1]), file=sys.stderr, flush=True)
    return rows


def arguments(argv=None):
    """The command line's arguments."""
    parser = real_recordings.parser_of(__doc__)
    parser.add_argument("--scale", type=float, default=16.0, help="pixels per mm")
    measuring.add_seed(parser, "of the noise")
    parser.add_argument(
        "--only", nargs="+", choices=BY_NAME, default=list(BY_NAME), metavar="CHANGE",
        help=f"some of: {'; '.join(BY_NAME).replace('%', '%%')}",
    )  # fmt: skip
    return parser.parse_args(argv)


def main(argv=None) -> int:
    """Print the table of all videos and changes."""
    measuring.limit_threads()
    args = arguments(argv)
    labels = real_recordings.labels_for(args.labels, [video for video, _ in args.videos])
    rows = []
    for video, face in args.videos:
        rows += rows_of(video, face, labels.get(video.stem, ()), args)
    said = f"{args.scale:g} px/mm as it is; the noise is drawn from seed {args.seed}."
    pages.publish(f"{said}\n\n{pages.table(HEADER, rows)}", args.write, "changed pictures")
    return 0


if __name__ == "__main__":
    sys.exit(main())
