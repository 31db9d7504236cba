"""A video backwards, and whether names and links found in it are those found forwards."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import real_lines
from real_angles import KNOWN
from scipy.optimize import linear_sum_assignment

from pipeline.identity.tracked_lines import row_before
from pipeline.video import open_video
from synthetic.encode import video_suffix, write_video
from synthetic.scene import Codec

LOSSLESS = Codec("ffv1")
EVERY = 8  # points, about 1 px apart, of the shorter line that are compared with the longer one


def write_backwards(video, folder) -> Path:
    """Write the video's frames in reverse order, grey and without loss; return the file's path.

    All frames are held in memory at once.
    """
    path = Path(folder) / f"{Path(video).stem}{video_suffix(LOSSLESS)}"
    with open_video(video) as source:
        write_video(path, reversed(list(source.frames())), LOSSLESS)
    return path


def turned_back(lines, n_frames: int):
    """`Centrelines` of a video backwards, with the frame numbers of the video forwards."""
    return replace(lines, frame=n_frames - 1 - lines.frame)


def names_agree(forwards, backwards, pairs) -> tuple[int, int]:
    """Lines known in both of two `Centrelines` whose names agree, and how many are known in both.

    Names of the one are those of the other that most of these lines bear, one to one.

    pairs : as of `pairs_of_lines`
    """
    known = (forwards.confidence[pairs[:, 0]] >= KNOWN) & (
        backwards.confidence[pairs[:, 1]] >= KNOWN
    )
    one, other = pairs[known].T
    counts = np.zeros((len(forwards.names), len(backwards.names)), int)
    np.add.at(counts, (forwards.whisker[one], backwards.whisker[other]), 1)
    return int(counts[linear_sum_assignment(counts, maximize=True)].sum()), len(one)


def links_agree(forwards, backwards, pairs) -> tuple[int, int]:
    """How many links of the one of two `Centrelines` the other has, too, and of how many.

    A link is two lines of neighbouring frames that bear one name, known or not. Only those count
    whose lines have both been found in the other one as well.

    pairs : as of `pairs_of_lines`
    """
    there = np.full(len(forwards.frame), -1)
    there[pairs[:, 0]] = pairs[:, 1]
    before = row_before(forwards.frame, forwards.whisker)
    now = np.flatnonzero(before >= 0)
    linked = np.column_stack([there[before[now]], there[now]])
    one, other = linked[(linked >= 0).all(axis=1)].T
    return int((backwards.whisker[one] == backwards.whisker[other]).sum()), len(one)


def pairs_of_lines(one, other) -> np.ndarray:
    """Rows (pairs, 2) of two `Centrelines` that are the same line, one to one in every frame."""
    pairs = [np.empty((0, 2), int)]
    for frame in np.intersect1d(one.frame, other.frame):
        rows = [np.flatnonzero(each.frame == frame) for each in (one, other)]
        shares = np.array([[_same(one.row(i), other.row(j)) for j in rows[1]] for i in rows[0]])
        chosen = np.array(linear_sum_assignment(shares, maximize=True))
        chosen = chosen[:, shares[tuple(chosen)] >= real_lines.FOUND]
        pairs.append(np.column_stack([rows[0][chosen[0]], rows[1][chosen[1]]]))
    return np.concatenate(pairs)


def _same(one, other) -> float:
    """Share of the shorter of two lines that lies along the longer one."""
    short, long = sorted((one.astype(float), other.astype(float)), key=len)
    if len(short) < 2:
        return 0.0
    return (real_lines.distance(short[::EVERY], long) <= real_lines.NEAR_PX).mean()
