"""What the `calibrate` commands share: which whisker is meant, and one case after the other."""

from pipeline.tables.known_names import in_short


def one_whisker(videos, wanted, which="one") -> str:
    """The whisker of that name in some videos, or the only one where no name is given.

    which : what it must be, in words, for the message

    Raises ValueError where it is not there, or is not clear.
    """
    names = list(dict.fromkeys(name for video in videos for name in video.whiskers))
    if wanted is None and len(names) == 1:
        return names[0]
    if wanted is None or wanted not in names:
        given = "--whisker" if wanted is None else f"--whisker {wanted}"
        raise ValueError(f"{given}: expected {which} of {in_short(names)}")
    return wanted


def each(cases, measure, refusal, sentence, say, label=lambda case: ""):
    """Measure all cases that can be; return the measurements, and why others are left out.

    measure : called with a case; raises `refusal`, an exception, where it cannot be measured
    sentence : a measurement in words
    label : what stands before a refusal, of a case
    say : prints a line, for every case
    """
    measured, faults = [], []
    for case in cases:
        try:
            measured.append(measure(case))
        except refusal as error:
            faults.append(f"{label(case)}{error}")
            say(f"left out: {faults[-1]}")
        else:
            say(sentence(measured[-1]))
    return measured, faults
