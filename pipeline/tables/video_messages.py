"""The messages about a video, as a list and as one cell of videos.csv."""

BETWEEN = " | "
NO_POLE = "no pole of "  # begins the sentence on a video in which none was found


def as_cell(sentences) -> str:
    """The sentences as one text; empty ones are left out.

    >>> as_cell(["no pole", "", "no forces: no length_mm; give it"])
    'no pole | no forces: no length_mm; give it'
    """
    return BETWEEN.join(filter(None, sentences))


def sentences_of(message: str) -> list[str]:
    """The sentences of such a text.

    >>> sentences_of("no pole | no forces: no length_mm; give it")
    ['no pole', 'no forces: no length_mm; give it']
    """
    return [each for each in message.split(BETWEEN) if each]


def missing_pole(message: str) -> str:
    """The sentence that no pole was found, '' if there is none.

    >>> missing_pole("no pole of 0.5 mm (12 px) found, so no contacts; check it | no forces")
    'no pole of 0.5 mm (12 px) found, so no contacts; check it'
    """
    return next((each for each in sentences_of(message) if each.startswith(NO_POLE)), "")


def in_brief(sentence: str) -> str:
    """A sentence on a missing pole without what was seen in its place; others as they are.

    >>> in_brief("no pole of 0.5 mm (12 px) found, so no contacts; check it")
    'no pole of 0.5 mm (12 px) found, so no contacts'
    """
    return sentence.partition("; ")[0] if sentence.startswith(NO_POLE) else sentence
