"""How much of what is found on real recordings is chance.

    python workflows/real_draws.py VIDEO:left VIDEO:top --labels whiskers_by_eye.json

Where two whiskers look alike, a change of the picture that no eye sees decides which line is
followed, and all names behind it may depend on that. So each video is processed several times,
forwards and backwards, each time with new noise of SD 0.5 grey levels in every pixel. The table
has the mean over these draws and, in brackets, the least and the most. Its columns are those of
`real_recordings.py`; lines of up to 60 px are not judged. All frames of a video are held in
memory.
"""

import sys
from pathlib import Path

import measuring
import numpy as np
import pages
import real_angles
import real_directions
import real_lines
from changed_pictures import frames_of, noise
from real_recordings import labels_for, parser_of, processed, settings_for

UNSEEN_SD = 0.5  # grey levels
HEADER = ["video", "direction", "clear", "faint", "wrong / frame", "known", "names agree"]
FORMS = "{:.1%}", "{:.1%}", "{:.2f}", "{:.1%}", "{:.1%}"


def unseen_noise(frames, draws: int, seed: int):
    """Yield the frames so many times, each time with noise that no eye sees."""
    rng = np.random.default_rng(seed)
    for _ in range(draws):
        yield noise(UNSEEN_SD)(frames, rng)


def both_directions(frames, settings, labelled) -> tuple[list[float], list[float]]:
    """Figures of the columns, forwards and backwards; NaN where there is nothing to count."""
    forwards = processed(frames, settings).lines
    backwards = processed(np.ascontiguousarray(frames[::-1]), settings).lines
    backwards = real_directions.turned_back(backwards, len(frames))
    pairs = real_directions.pairs_of_lines(forwards, backwards)
    agree, known = real_directions.names_agree(forwards, backwards, pairs)
    share = agree / known if known else np.nan
    return [*_figures(forwards, labelled), np.nan], [*_figures(backwards, labelled), share]


def _figures(lines, labelled) -> list[float]:
    """Shares of clear and of faint whiskers found, wrong lines a frame, share of known lines."""
    score = real_lines.score(labelled, real_lines.lines_of(lines))
    values = *score.found.values(), score.wrong, lines.confidence >= real_angles.KNOWN
    return [float(np.mean(each)) if len(each) else np.nan for each in values]


def cells(draws) -> list[str]:
    """Each figure's mean, least and most, of draws (draws, figures)."""
    ends = np.mean(draws, axis=0), np.min(draws, axis=0), np.max(draws, axis=0)
    return [pages.cell_and_ends(form, *each) for form, *each in zip(FORMS, *ends, strict=True)]


def rows_of(video: Path, face: str, labelled, args) -> list[list[str]]:
    """The rows of one video."""
    settings = settings_for(video, face, args.scale, args.frames_per_second)
    noisy = unseen_noise(frames_of(video), args.draws, args.seed)
    draws = np.array([both_directions(each, settings, labelled) for each in noisy])
    directions = zip(("forwards", "backwards"), draws.swapaxes(0, 1), strict=True)
    return [[video.stem, direction, *cells(each)] for direction, each in directions]


def arguments(argv=None):
    """The command line's arguments."""
    parser = parser_of(__doc__)
    parser.add_argument("--draws", type=int, default=6, help="of the noise")
    measuring.add_seed(parser, "of the noise")
    parser.add_argument("--scale", default="16", help="pixels per mm")
    return parser.parse_args(argv)


def main(argv=None) -> int:
    """Print the table."""
    measuring.limit_threads()
    args = arguments(argv)
    labels = labels_for(args.labels, [video for video, _ in args.videos])
    rows = []
    for video, face in args.videos:
        rows += rows_of(video, face, labels.get(video.stem, ()), args)
    said = f"{args.scale} px/mm, {args.draws} draws of the noise from seed {args.seed}."
    pages.publish(f"{said}\n\n{pages.table(HEADER, rows)}", args.write, "real draws")
    return 0


if __name__ == "__main__":
    sys.exit(main())
