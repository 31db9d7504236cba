"""What can go wrong with an input, in words that help."""

import errno
import os
from collections import Counter
from pathlib import Path

NO_ROOM = "make room on that disk and run again; what is finished is kept"
TOO_LARGE = "that disk, or the system, takes no file so large: choose another place"
GONE = "if a disk, folder or file was removed, put it back, and run again"
TOO_LONG = "shorten that name, or the name of what it is made of, and run again"
NOT_ALLOWED = "change its permissions, or choose another place, and run again"
ADVICE = {  # by the system's number of an error
    errno.ENOSPC: NO_ROOM,
    getattr(errno, "EDQUOT", errno.ENOSPC): NO_ROOM,
    errno.EFBIG: TOO_LARGE,
    errno.ENOENT: GONE,
    errno.ENAMETOOLONG: TOO_LONG,
    errno.EACCES: NOT_ALLOWED,
    errno.EPERM: NOT_ALLOWED,
    errno.EROFS: NOT_ALLOWED,
}


class VideoError(Exception):
    """An input that cannot be read (on); the message names it, what is wrong and what to do.

    Attributes
    ----------
    path : str, the file or folder
    problem : str, the message without the path
    frame : int or None, how many frames from the start could be read and are usable
    """

    def __init__(self, path, problem: str, frame: int | None = None):
        self.path = str(path)
        self.problem = problem
        self.frame = frame
        super().__init__(f"{path}: {problem}")

    def __reduce__(self):
        """Travel between processes: Exception would pass the message as the only argument."""
        return type(self), (self.path, self.problem, self.frame)


class CorrectionsError(ValueError):
    """A corrections.csv that is no table of corrections; the message names file and line."""

    def __init__(self, problem: str):
        self.problem = problem
        super().__init__(f"{problem}; correct the file, or delete it")

    def __reduce__(self):
        """Travel between processes without the advice being added again."""
        return type(self), (self.problem,)


class InputError(ValueError):
    """Unusable arguments; the message names them and says what to do."""


def counted(number: int, thing: str) -> str:
    """How many of something there are, in words.

    >>> counted(1, "frame"), counted(2, "frame")
    ('1 frame', '2 frames')
    """
    return f"{number} {thing}{'' if number == 1 else 's'}"


def some_of(words, most: int = 5) -> str:
    """Words with commas between them; of many, the first ones and how many more.

    >>> some_of(["a", "b"]), some_of("abcdefg")
    ('a, b', 'a, b, c, d, e and 2 more')
    """
    more = len(words) - most
    return ", ".join(words[:most]) + (f" and {more} more" if more > 0 else "")


def need_folder(path, expected: str) -> None:
    """InputError where `path` is no folder."""
    path = Path(path)
    if not path.is_dir():
        what = "a file, not a folder" if path.exists() else "no such folder"
        raise InputError(f"{path}: {what}; give {expected}")


def need_content(folder, expected: str) -> None:
    """InputError where `folder` is one with nothing in it, hidden files apart."""
    folder = Path(folder)
    if folder.is_dir() and all(entry.name.startswith(".") for entry in folder.iterdir()):
        raise InputError(f"{folder}: is an empty folder: expected {expected} in it")


def need_distinct(values, problem: str) -> None:
    """InputError where one of `values` is there twice; `problem` says so, {} stands for it."""
    for value, count in Counter(values).items():
        if count > 1:
            raise InputError(problem.format(value))


def in_words(error: Exception | str) -> str:
    """The message of an error in one line; the system's without its number.

    >>> in_words(ValueError("of two\\nlines"))
    'of two lines'
    """
    return " ".join((why(error) if isinstance(error, OSError) else str(error)).split())


def lacks_memory(words: str) -> bool:
    """Whether the words of an error, with its type, are those of too little memory."""
    known = "MemoryError", "Insufficient memory", "failed to map segment"  # last: of a library
    return any(each in words for each in known)


def why(error: OSError) -> str:
    """What the system says is wrong, in words and without its number.

    >>> why(FileExistsError(17, "File exists", "notes.txt"))
    'notes.txt is a file, not a folder'
    >>> why(OSError(errno.ENOSPC, "Error writing bytes to file. Detail: [errno 28] No space left"))
    'No space left on device'
    """
    place = f"{error.filename}" if error.filename is not None else ""
    if isinstance(error, (FileExistsError, NotADirectoryError)):
        above = Path(place), *Path(place).parents
        place = next((each for each in above if each.is_file()), place)
        return f"{place} is a file, not a folder".strip()
    known = error.errno in errno.errorcode  # libraries add words of their own
    words = os.strerror(error.errno) if known else error.strerror or str(error)
    return f"{place}: {words}" if place else words


def renamed(error: OSError, path) -> OSError:
    """The system's error with the path that a person knows; some libraries' own take no other.

    >>> why(renamed(OSError(errno.ENOSPC, "", "part.mp4"), "film.mp4"))
    'film.mp4: No space left on device'
    """
    return OSError(error.errno, error.strerror or str(error), str(path))


def with_advice(error: Exception) -> str:
    """The message of an error in one line; the system's with what to do.

    >>> with_advice(PermissionError(errno.EACCES, "", "a.toml"))
    'a.toml: Permission denied; change its permissions, or choose another place, and run again'
    >>> with_advice(FileNotFoundError(errno.ENOENT, "", "a.csv")).partition("; ")[2]
    'if a disk, folder or file was removed, put it back, and run again'
    >>> with_advice(OSError(errno.ENAMETOOLONG, "", "film_profile.csv")).partition("; ")[2]
    'shorten that name, or the name of what it is made of, and run again'
    """
    advice = ADVICE.get(getattr(error, "errno", None))
    return f"{in_words(error)}; {advice}" if advice else in_words(error)
