"""What `calibrate` and `export` share: one case after the other, and which whisker is meant."""

from pipeline.errors import InputError, VideoError, with_advice
from pipeline.tables.known_names import in_short


def one_whisker(videos, wanted, which="one") -> str:
    """The whisker of that name in some videos, or the only one where no name is given.

    which : what it must be, in words, for the message

    Raises ValueError where it is not there, or is not clear.
    """
    names = list(dict.fromkeys(name for video in videos for name in _names_in(video)))
    names = names or list(videos[0].whiskers)  # or the reason why they cannot be read
    if wanted is None and len(names) == 1:
        return names[0]
    if wanted is None or wanted not in names:
        given = "--whisker" if wanted is None else f"--whisker {wanted}"
        raise ValueError(f"{given}: expected {which} of {in_short(names)}")
    return wanted


def _names_in(video) -> tuple[str, ...]:
    """Names of a video's whiskers; none where its tables are damaged, as measuring it will say."""
    try:
        return video.whiskers
    except (ValueError, OSError):
        return ()


def each(cases, measure, sentence, say, label=lambda case: "", *, none):
    """Measure all cases that can be; return the measurements, and why others are left out.

    A case is left out where it cannot be measured, or its video or tables cannot be read.

    measure : called with a case
    sentence : a measurement in words
    say : prints a line, for every case
    label : of a case, what stands before the reason for leaving it out
    none : what the error says where no case can be measured

    Raises
    ------
    InputError
        Where arguments cannot be used, or no case can be measured.
    """
    measured, faults = [], []
    for case in cases:
        try:
            measured.append(measure(case))
        except InputError:
            raise
        except (ValueError, VideoError, OSError) as error:
            faults.append(f"{label(case)}{with_advice(error)}")
            say(f"left out: {faults[-1]}")
        else:
            say(sentence(measured[-1]))
    if not measured:
        raise InputError(f"{none}; the first: {faults[0]}")
    return measured, faults
