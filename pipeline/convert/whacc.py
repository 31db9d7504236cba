"""Contacts of WhACC (hireslab/whacc): frame by frame, all videos of a session in one HDF5 file.

`full_file_names` are the videos, `frame_nums` how many frames each has, `file_name_nums` the
trial's number in every frame. `labels` are a person's: 1 touch, 0 none, −1 where nobody looked.
`yhat` is what WhACC predicts; where `in_range` is known, it counts only while the pole is within
reach. There is one whisker.
"""

from datetime import UTC, datetime
from pathlib import Path, PureWindowsPath
from typing import NamedTuple

import numpy as np

from pipeline.contacts.corrections import (
    CONTACT,
    CORRECTIONS_FILE,
    FREE,
    Verdict,
    read_corrections,
    table_of,
    write_corrections,
)
from pipeline.convert.hdf5 import texts_in, whole_hdf5
from pipeline.convert.optional import library
from pipeline.convert.results import trial_number
from pipeline.errors import InputError, counted, in_words
from pipeline.tables.known_names import in_short

TOUCH, NONE, UNKNOWN = 1, 0, -1
KEYS = "labels", "yhat", "in_range"  # a number per frame


class Labels(NamedTuple):
    """A video's name without its suffix, and int8 (frames,) of TOUCH, NONE, UNKNOWN."""

    video: str
    touch: np.ndarray


def read_whacc(path) -> list[Labels]:
    """Read the contacts of every video; a person's `labels` come before WhACC's own `yhat`.

    Raises
    ------
    InputError
        Where it is something else, or damaged.
    """
    h5py = library("h5py", "formats")
    try:
        with h5py.File(path) as file:
            names = texts_in(file["full_file_names"])
            counts = np.ravel(file["frame_nums"][()]).astype(np.int64)
            given = {key: np.ravel(file[key][()]).astype(float) for key in KEYS if key in file}
    except (OSError, KeyError, ValueError, TypeError, AttributeError) as error:
        raise _fault(path, error) from None
    total = int(counts.sum())
    if not {"labels", "yhat"} & set(given) or len(names) != len(counts) or (counts < 0).any():
        raise _fault(path, f"{len(names)} names, {len(counts)} counts of frames, no labels")
    for key, values in given.items():
        if len(values) != total:
            raise _fault(path, f"{len(values)} {key}, {total} frames")
    parts = np.split(_touch(given, total), np.cumsum(counts)[:-1])
    return [Labels(PureWindowsPath(n).stem, part) for n, part in zip(names, parts, strict=True)]


def _touch(given, total) -> np.ndarray:
    """TOUCH, NONE or UNKNOWN of every frame: a person's labels, else WhACC's prediction."""
    touch = _known(given.get("labels"), total)
    predicted = _known(given.get("yhat"), total)
    within_reach = given.get("in_range", np.full(total, np.nan))
    if (within_reach == 1).any():
        predicted[within_reach == 0] = NONE
    return np.where(touch == UNKNOWN, predicted, touch)


def _known(values, total):
    """Numbers as WhACC's own page shows them: touch above one half, −1 (and NaN) unknown."""
    touch = np.full(total, UNKNOWN, np.int8)
    if values is not None:
        known = np.isfinite(values) & (values >= 0)
        touch[known] = np.where(values[known] > 0.5, TOUCH, NONE)
    return touch


def corrections_of(touch, whisker: str):
    """Labels as a table of corrections: a verdict per stretch, none where nobody looked."""
    edges = np.flatnonzero(np.diff(touch)) + 1
    starts, stops = np.append(0, edges), np.append(edges, len(touch))
    verdicts = {TOUCH: CONTACT, NONE: FREE}
    now = datetime.now(UTC).isoformat(timespec="seconds")
    spans = [(int(a), int(b)) for a, b in zip(starts, stops, strict=True)]
    return table_of(
        Verdict(whisker, verdicts[int(touch[a])], a, b, a, b, now, "WhACC")
        for a, b in spans
        if b > a and touch[a] != UNKNOWN
    )


def take_contacts(path, videos, whisker: str = "") -> list[Path]:
    """Write WhACC's contacts beside the results of its videos, as corrections; return the files.

    Parameters
    ----------
    path : the HDF5 file
    videos : `VideoResults`; those of which the file knows nothing stay as they are
    whisker : whose contacts they are; empty: the only one

    Raises
    ------
    InputError
        Where no video is in both, one has other corrections already or several whiskers.
    """
    known = _by_name(path, ((labels.video, labels) for labels in read_whacc(path)))
    both = _by_name(path, ((name, v) for v in videos if (name := _known_as(v, known))))
    if not both:
        raise InputError(
            f"{path}: knows {', '.join(known)}, the results are of "
            f"{', '.join(v.name for v in videos)}: no video is in both; `run` or import them first"
        )
    tables = [(v, _checked(v, known[name], whisker, path)) for name, v in both.items()]
    for video, corrections in tables:
        if not (video.folder / CORRECTIONS_FILE).exists():
            write_corrections(video.folder, corrections)
    return [video.folder / CORRECTIONS_FILE for video in both.values()]


def _known_as(video, names) -> str:
    """The name that results or their video have among these names, "" if neither is there."""
    return next((n for n in (video.name, PureWindowsPath(video.path).stem) if n in names), "")


def _by_name(path, pairs) -> dict:
    """The pairs as a dictionary; InputError where two have the same name."""
    found = {}
    for name, each in pairs:
        if name in found:
            raise InputError(
                f"{path}: {name} is the name of two videos, there or among the results: it cannot "
                "be told whose contacts these are; give it results and labels of one session only"
            )
        found[name] = each
    return found


def _checked(video, labels, whisker, path):
    """The corrections of one video, if they can be taken, or were by an import that was killed."""
    if whisker not in video.whiskers and (whisker or len(video.whiskers) != 1):
        given = f"--whisker {whisker}: " if whisker else ""
        raise InputError(
            f"{given}{video.folder}: has whiskers {in_short(video.whiskers)}; say whose contacts "
            f"{path} holds with --whisker"
        )
    if len(labels.touch) != video.n_frames:
        raise InputError(
            f"{path}: has {counted(len(labels.touch), 'frame')} of {video.name}, its results "
            f"{video.n_frames}: these are not of the same video, or one is cut off; name the file "
            "that was made of this video, or run the whole video"
        )
    corrections = corrections_of(labels.touch, whisker or video.whiskers[0])
    there, when = video.folder / CORRECTIONS_FILE, "saved_at"
    if there.exists() and not (
        read_corrections(video.folder).drop(columns=when).equals(corrections.drop(columns=when))
    ):
        raise InputError(
            f"{there}: holds corrections already, which WhACC's would replace; move it away first"
        )
    return corrections


def write_whacc(path, videos) -> Path:
    """Write the contacts of all videos, of any whisker, as WhACC's file; return its path."""
    counts = np.array([v.n_frames for v in videos])
    labels = _most_in_frame(videos, "in_contact")
    names = [Path(v.path).with_name(v.name + Path(v.path).suffix).name for v in videos]
    trials = trial_numbers([v.name for v in videos])
    values = {
        "full_file_names": np.array([name.encode() for name in names], "S"),
        "frame_nums": counts,
        "file_name_nums": np.repeat(trials, counts),
        "trial_nums_and_frame_nums": np.stack([trials, counts]),
        "in_range": np.ones(len(labels)),
        "labels": labels,
        "yhat": labels.astype(int),
        "yhat_proba": np.nan_to_num(_most_in_frame(videos, "contact_probability")),
    }
    with whole_hdf5(path) as file:
        for name, value in values.items():
            file.create_dataset(name, data=value)
    return Path(path)


def _most_in_frame(videos, column) -> np.ndarray:
    """Greatest value of any whisker in each frame of all videos, 0 where there is no whisker."""

    def most(video):
        values = video.frames[column].astype(float).groupby(video.frames["frame"]).max()
        return values.reindex(range(video.n_frames), fill_value=0)

    return np.concatenate([most(video) for video in videos])


def trial_numbers(names) -> np.ndarray:
    """The number at the end of each name, as WhACC finds it; 1, 2, 3, … unless all differ."""
    numbers = [number for number in map(trial_number, names) if number is not None]
    return np.array(numbers) if len(set(numbers)) == len(names) else 1 + np.arange(len(names))


def _fault(path, error) -> InputError:
    reason = in_words(error)[:120]
    return InputError(
        f"{path}: cannot be read as WhACC's file ({reason}): expected HDF5 with full_file_names, "
        "frame_nums and labels or yhat; copy it again, or let WhACC predict again"
    )
