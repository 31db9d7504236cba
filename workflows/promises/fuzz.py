"""Contents changed at random, led by which lines of our own code they reach."""

import sys
from collections.abc import Callable, Iterator

from promises.bad_video import DAMAGED_BY

TOKENS = (
    b"nan", b"inf", b"-1", b"0", b"1e308", b"99999999999999999999", b"true", b'""', b"[]", b"{}",
    b"null", b"[[", b"]]", b"=", b",", b"\n", b'"', b"\xff", b"\x00", b"\xef\xbb\xbf", b"C2",
    b"..", b"=1+1", b"<b>", b"frame", b"[recording]", b"[advanced.forces]", b"'", b"\\", b"1,5",
)  # fmt: skip
KEPT = 200  # contents that are changed further


def changed(content: bytes, rng) -> bytes:
    """Damage a content as a disk would, or as a person who edits it would."""
    if not content:
        return TOKENS[rng.integers(len(TOKENS))]
    if rng.integers(3) == 0:
        return bytes(DAMAGED_BY[rng.integers(len(DAMAGED_BY))](bytearray(content), rng))
    at = rng.integers(len(content))
    token = TOKENS[rng.integers(len(TOKENS))]
    if rng.integers(2):  # in place of a word
        words = content.replace(b",", b" ").split()
        return content.replace(words[rng.integers(len(words))], token, 1) if words else token
    return content[:at] + token + content[at:]


def led_by_coverage(content, read: Callable, count, rng, folders) -> Iterator[tuple]:
    """Yield (content, what came of reading it) for so many changed contents.

    Contents that reach new lines of files in `folders` are changed further.
    """
    corpus, reached = [content], set()
    for _ in range(count):
        parent = corpus[rng.integers(len(corpus))]
        new = changed(parent, rng)
        lines = set()
        answer = _traced(read, new, lines, folders)
        if lines - reached and len(corpus) < KEPT:
            reached |= lines
            corpus.append(new)
        yield new, answer


def _traced(read, content, lines, folders):
    """Call `read`, and note the lines that it reaches."""

    def trace(frame, event, _):
        name = frame.f_code.co_filename
        if not any(folder in name for folder in folders):
            return None
        lines.add((name, frame.f_lineno))
        return trace

    before = sys.gettrace()
    sys.settrace(trace)
    try:
        return read(content)
    finally:
        sys.settrace(before)
