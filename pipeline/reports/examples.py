"""Which contacts the report shows: from many videos, those whose frames are quickest to decode.

In a compressed video, decoding a frame begins at the key frame before it, so that a peak shortly
after a key frame costs little. The choice is not biased, since key frames do not depend on
touches.
"""

import numpy as np
import pandas as pd

from pipeline.errors import VideoError
from pipeline.numerics.runs import evenly
from pipeline.video.open import open_video

MOST_WEIGHED = 50  # contacts of one kind, evenly chosen
SURELY, FEWEST = 1, 3  # contacts of every flag, and examples, that are shown whatever it takes
MOST_DECODED, MOST_SHARE = 100, 0.02  # frames of all videos, for them and to show more than these


class Effort:
    """Number of frames that must be decoded to show contacts, besides those shown anyway.

    Parameters
    ----------
    contacts : with `video` and `peak_frame`; they are spoken of by their labels
    inputs : name of a video → {"path": …, "frames": …}, as in run.json
    """

    def __init__(self, contacts: pd.DataFrame, inputs: dict):
        self._inputs = inputs
        frames = sum(each.get("frames", 0) for each in inputs.values())
        self._left = max(MOST_DECODED, MOST_SHARE * frames)
        self._video = contacts["video"].to_dict()
        self._number = contacts["peak_frame"].astype(int).to_dict()
        self._start, self._reached = {}, {}

    def weigh(self, labels) -> None:
        """Find from where on these contacts' videos must be decoded."""
        of_video = {}
        for label in dict.fromkeys(labels):
            if label not in self._start:
                of_video.setdefault(self._video[label], []).append(label)
        for video, own in of_video.items():
            numbers = [self._number[label] for label in own]
            path = self._inputs.get(video, {}).get("path")
            self._start |= dict(zip(own, _starts(path, numbers), strict=True))

    def of(self, label) -> int:
        """Number of frames to be decoded for one more contact."""
        return max(self._number[label] - self._reached.get(self._group(label), -1), 0)

    def take(self, label) -> None:
        """Show a contact."""
        self._left -= self.of(label)
        group = self._group(label)
        self._reached[group] = max(self._reached.get(group, -1), self._number[label])

    def affords(self, label) -> bool:
        """Whether the frames of this contact may be decoded, too, without exceeding the limit."""
        return self.of(label) <= self._left

    def _group(self, label):
        group = self._video[label], self._start[label]
        self._reached.setdefault(group, self._start[label] - 1)
        return group

    def in_first_videos(self, labels, n: int) -> list:
        """Those of the contacts that are in the same videos as the first `n`."""
        videos = {self._video[label] for label in labels[:n]}
        return [label for label in labels if self._video[label] in videos]

    def quickest(self, labels):
        """The one that takes the least; the first of equals."""
        return min(labels, key=self.of)


def _starts(path, numbers):
    """Where reading towards frames begins; the frames themselves if the video cannot be read."""
    try:
        if path is not None:
            with open_video(path) as video:
                return video.starts(numbers)
    except (VideoError, OSError):
        pass  # the report says nothing of it: no picture will be there
    return numbers


def choose_flagged(flagged, n: int, each: int, effort: Effort) -> list:
    """Choose up to `n` flagged contacts: one of every flag, then a second one, …

    Parameters
    ----------
    flagged : for every flag, the contacts that have it
    each : no more of one flag than that
    """
    flagged = [_few(effort.in_first_videos(own, each)) for own in flagged]
    effort.weigh(label for own in flagged for label in own)
    chosen = []
    for turn in range(each):
        for own in flagged:
            left = [label for label in own if label not in chosen]
            if not left or len(own) - len(left) > turn or len(chosen) == n:
                continue
            best = effort.quickest(left)
            if turn < SURELY or effort.affords(best):
                effort.take(best)
                chosen.append(best)
    return chosen


def choose_examples(contacts: pd.DataFrame, n: int, effort: Effort, shown=()) -> list:
    """Choose up to `n` contacts, of as many videos as possible.

    Those that are `shown` anyway are chosen only where there are too few others. Returned are
    labels of `contacts`: the first one of every video, the second, …
    """
    wanted = contacts["video"].iloc[_in_turn(contacts)[:n]].value_counts(sort=False)
    chosen = []
    for video, count in wanted.items():
        own = contacts.index[contacts["video"] == video]
        left = _few([label for label in own if label not in shown])
        effort.weigh(left)
        lacking = max(count - len(left), 0)
        chosen += [label for label in own if label in shown][:lacking]
        for _ in range(count - lacking):
            best = effort.quickest(left)
            if len(chosen) < FEWEST or effort.affords(best):
                effort.take(best)
                chosen.append(best)
                left.remove(best)
    chosen = contacts.loc[contacts.index.isin(chosen)]
    return list(chosen.index[_in_turn(chosen)])


def _in_turn(contacts):
    """Places of the first contact of every video, of the second, …"""
    return np.argsort(contacts.groupby("video").cumcount().to_numpy(), kind="stable")


def _few(labels) -> list:
    """Up to MOST_WEIGHED of them, evenly chosen."""
    return [labels[k] for k in evenly(len(labels), MOST_WEIGHED)]
