"""The messages about a video, as a list and as one cell of videos.csv."""

BETWEEN = " | "


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
