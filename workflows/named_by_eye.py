"""Whether names stay with the whiskers that a person has followed by eye through a real video.

    python workflows/named_by_eye.py VIDEO TRACKS.csv --config session.toml --draws 6

TRACKS.csv has a row per point: `track`, `frame`, `x_px`, `y_px` (a point on the whisker in the
middle of its length), and `sure`: 1 where the person has no doubt that it is the same whisker as
in the track's frame before. The video is processed as `whiskerforce run` does. In every sure
frame, the name looked at is that of the line through the point.

A name is exchanged where the line carries one name and, the next time that it is known as surely,
another. The table lists the tracks of which a name is exchanged or no line is found; the next
lines add all up, for names of several confidences; the last ones tell how many names of a range of
confidences are those that their tracks mostly have. With `--draws`, the video is processed so many
times, each time with new noise that no eye sees (`real_draws.py`), and only sums are printed: the
mean and, in brackets, the least and the most.

`tests/data/test_video2_by_eye.csv` are such tracks of `test_video2.mp4` of cxrodgers/WhiskiWrap
(face left, about 8 px/mm), made from the raw frames without a look at the program's lines.
"""

import argparse
import sys
from pathlib import Path

import measuring
import numpy as np
import pages
import pandas as pd
from changed_pictures import frames_of
from real_draws import unseen_noise

from pipeline.run import analyse
from pipeline.session.session_file import read_session

COLUMNS = ("track", "frame", "x_px", "y_px", "sure")
REACH_PX = 2.0  # from the point, a line passes through it
AS_NEAR_PX = 1.0  # a line that is farther by less is as likely meant: not a new name
CONFIDENCES = (0.0, 0.5, 0.7, 0.9)
RANGES = (0.0, 0.3, 0.5, 0.6, 0.7, 0.9)  # of confidences, from each to the next one


def read_tracks(path) -> pd.DataFrame:
    """The sure points of a person's tracks, by track and frame.

    Raises ValueError where a column is missing.
    """
    table = pd.read_csv(path, dtype={"track": str})
    missing = [name for name in COLUMNS if name not in table]
    if missing:
        raise ValueError(f"{path}: expected the columns {', '.join(COLUMNS)}; no {missing[0]}")
    sure = table[table["sure"] == 1]
    return sure.sort_values(["track", "frame"], kind="stable", ignore_index=True)


def named_along(tracks: pd.DataFrame, chunks) -> pd.DataFrame:
    """The tracks with `name` and `confidence` of the line through every point.

    tracks : as of `read_tracks`; chunks : `Centrelines` of the whole video

    No name and confidence 0 where there is no such line.
    """
    rows = {}
    for chunk in chunks:
        for row, frame in enumerate(chunk.frame):
            rows.setdefault(int(frame), []).append((chunk, row))
    names, confidences = [], []
    for _, track in tracks.groupby("track"):
        last = ""
        for frame, x, y in track[["frame", "x_px", "y_px"]].itertuples(index=False):
            through = _through(rows.get(frame, ()), x, y)
            name, sure = _chosen(through, last)
            last = name or last
            names.append(name)
            confidences.append(sure)
    return tracks.assign(name=names, confidence=confidences)


def _through(rows, x, y):
    """(distance [px], name, confidence) of all lines through a point, the nearest first."""
    found = []
    for chunk, row in rows:
        points = slice(chunk.offsets[row], chunk.offsets[row + 1])
        away = _distance(chunk.x_px[points] - x, chunk.y_px[points] - y)
        if away <= REACH_PX:
            found.append((away, chunk.names[chunk.whisker[row]], float(chunk.confidence[row])))
    return sorted(found)


def _chosen(through, last):
    """Name and confidence of the nearest line, or of one as near that was meant before."""
    if not through:
        return "", 0.0
    near = [each for each in through if each[0] < through[0][0] + AS_NEAR_PX]
    same = [each for each in near if each[1] == last]
    return (same or near)[0][1:]


def _distance(x, y) -> float:
    """Distance from the origin to the polygon through the points x, y."""
    if len(x) < 2:
        return np.inf
    dx, dy = np.diff(x), np.diff(y)
    part = np.clip(-(x[:-1] * dx + y[:-1] * dy) / np.maximum(dx**2 + dy**2, 1e-9), 0, 1)
    return float(np.hypot(x[:-1] + part * dx, y[:-1] + part * dy).min())


def exchanges(track: pd.DataFrame, least: float) -> list[str]:
    """Where names of at least that confidence are exchanged, as "frame name → frame name"."""
    known = track[(track["name"] != "") & (track["confidence"] >= least)]
    name, frame = known["name"].to_numpy(), known["frame"].to_numpy()
    return [
        f"{frame[k]} {name[k]} → {frame[k + 1]} {name[k + 1]}"
        for k in np.flatnonzero(name[1:] != name[:-1])
    ]


def exchanges_by_track(named: pd.DataFrame) -> dict:
    """Track → confidence → its `exchanges`."""
    tracks = named.groupby("track")
    return {name: {least: exchanges(t, least) for least in CONFIDENCES} for name, t in tracks}


def sums(named: pd.DataFrame, found: dict) -> np.ndarray:
    """By confidence: share of frames with such a name, tracks with exchanges; (confidences, 2).

    `found` : of `exchanges_by_track`
    """
    out = []
    for least in CONFIDENCES:
        known = (named["name"] != "") & (named["confidence"] >= least)
        out.append((known.mean(), sum(bool(each[least]) for each in found.values())))
    return np.array(out)


def usual_shares(named: pd.DataFrame) -> np.ndarray:
    """By RANGES: share of the names that are their track's, which has it most surely, (ranges,).

    NaN where there are none.
    """
    named = named[named["name"] != ""]
    sums = named.groupby(["track", "name"])["confidence"].sum()
    usual = {track: name for track, name in sums.groupby(level="track").idxmax()}
    is_usual = (named["name"] == named["track"].map(usual)).to_numpy(float)
    of = np.searchsorted(RANGES, named["confidence"], "right") - 1
    count = np.bincount(of, minlength=len(RANGES))
    with np.errstate(invalid="ignore"):
        return np.bincount(of, is_usual, minlength=len(RANGES)) / count


def _usual_lines(shares) -> list[str]:
    """A line per range of confidences, of the shares in words."""
    ends = zip(RANGES, (*RANGES[1:], 1.0), shares, strict=True)
    return [
        f"confidence {least} to {most}: {share} of the names are the track's usual one"
        for least, most, share in ends
    ]


def report(named: pd.DataFrame) -> str:
    """The table of the tracks with exchanges or without a line in some frames, and the sums."""
    rows, of_all = [], exchanges_by_track(named)
    for name, track in named.groupby("track"):
        found = of_all[name]
        without = int((track["name"] == "").sum())
        if found[0.0] or without:
            span = f"{track['frame'].iloc[0]}–{track['frame'].iloc[-1]}"
            known = [str(len(found[least])) for least in CONFIDENCES]
            rows.append([name, span, str(without), *known, ", ".join(found[0.5])])
    header = [f"exchanges ≥ {least}" for least in CONFIDENCES]
    table = pages.table(["track", "frames", "no line", *header, "those ≥ 0.5"], rows)
    tracks, seen = named["track"].nunique(), named["name"] != ""
    said = [f"{tracks} tracks, {len(named)} sure frames, {seen.mean():.1%} with a line"]
    for least, (share, exchanged) in zip(CONFIDENCES, sums(named, of_all), strict=True):
        said.append(
            f"confidence ≥ {least}: {share:.1%} of the frames, names exchanged in "
            f"{exchanged:.0f} tracks, {100 * exchanged / tracks:.1f} of 100"
        )
    said += _usual_lines(pages.cell("{:.1%}", share) for share in usual_shares(named))
    return "\n".join([table, "", *said])


def report_of_draws(draws: list[pd.DataFrame], seed: int) -> str:
    """Means of the sums of several draws, with the least and the most."""
    found = np.array([sums(named, exchanges_by_track(named)) for named in draws])
    ends = zip(CONFIDENCES, found.mean(axis=0), found.min(axis=0), found.max(axis=0), strict=True)
    tracks = draws[0]["track"].nunique()
    said = [f"{tracks} tracks, {len(draws)} draws of the noise from seed {seed}"]
    for least, *each in ends:
        share, exchanged = zip(*each, strict=True)
        said.append(
            f"confidence ≥ {least}: {pages.cell_and_ends('{:.1%}', *share)} of the frames, "
            f"names exchanged in {pages.cell_and_ends('{:.1f}', *exchanged)} tracks"
        )
    usual = np.array([usual_shares(named) for named in draws])
    ends = zip(usual.mean(axis=0), usual.min(axis=0), usual.max(axis=0), strict=True)
    said += _usual_lines(pages.cell_and_ends("{:.1%}", *each) for each in ends)
    return "\n".join(said)


def main(argv=None) -> int:
    """Print the table of a video and a person's tracks."""
    measuring.limit_threads()
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("video", type=Path)
    parser.add_argument("tracks", type=Path, help="CSV of a person's tracks")
    parser.add_argument("--config", type=Path, help="session.toml; else the one beside the video")
    parser.add_argument("--draws", type=int, help="of noise that no eye sees")
    measuring.add_seed(parser, "of the noise")
    args = parser.parse_args(argv)
    tracks = read_tracks(args.tracks)
    settings = read_session(args.config or args.video.parent / "session.toml")

    def named_in(video):
        chunks = []
        analyse(video, settings, keep=chunks.append)
        return named_along(tracks, chunks)

    if args.draws:
        noisy = unseen_noise(frames_of(args.video), args.draws, args.seed)
        print(report_of_draws([named_in(frames) for frames in noisy], args.seed))
    else:
        print(report(named_in(args.video)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
