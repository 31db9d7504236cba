"""The session.toml that holds for a video, and what is left to be done in it."""

import re
import shlex
from pathlib import Path

from pipeline.errors import InputError
from pipeline.session.inputs import Input
from pipeline.session.session_file import SettingsError, read_session
from pipeline.video.open import find_videos

SETTINGS_NAME = "session.toml"
MISNAMED = (SETTINGS_NAME, f"{SETTINGS_NAME}.txt", f"{SETTINGS_NAME}.toml", "session.txt")
PREVIEW_NAME = "session_preview.png"
GUESS = "GUESS"  # in the comment of a value that `init` does not know
GUESSED = re.compile(rf"^(\w+) = .*#.*\b{GUESS}\b", re.MULTILINE)


def session_of(each: Input, config=None) -> Path:
    """The session.toml for an input: `config`, or the nearest one.

    That is: in a folder of images, beside the video, or above it up to the folder that the
    user named; of a link, there first, and then where it leads. InputError where there is none.
    """
    found = Path(config) if config is not None else _session_beside(each)
    if found is None:
        folder = each.path.absolute().parent
        if find_videos([folder]) == [folder]:  # what another program has tracked
            raise InputError(
                f"no session.toml in {folder}; copy the one of the recording there, or give it "
                "with --config"
            )
        check_settings_name(folder)
        raise InputError(
            f"no session.toml in {folder}, beside the videos; {_advice(each.path.parent)}"
        )
    return found


def _advice(folder) -> str:
    """How to get settings for the videos in a folder that has none."""
    parents = folder.absolute().parents
    above = next((p for p in parents if (p / SETTINGS_NAME).is_file()), None)
    if above is not None:
        return (
            f"that in {above} holds for them where that folder is run; to run only these, give it "
            f"with --config {shlex.quote(str(above / SETTINGS_NAME))}"
        )
    return (
        f"give one with --config, or let `whiskerforce init {shlex.quote(str(folder))}` write one"
    )


def check_settings_name(folder) -> None:
    """InputError where a file was meant to be session.toml, but has capitals or another ending."""
    if (Path(folder) / SETTINGS_NAME).exists():
        return
    for file in sorted(Path(folder).iterdir()):
        if file.is_file() and file.name.casefold() in MISNAMED:
            raise InputError(
                f"no session.toml in {folder}, but {file.name}: rename it to session.toml (to "
                "see the ends of names in Windows, let the Explorer show file name extensions)"
            )


def _session_beside(each: Input) -> Path | None:
    """The session.toml nearest to an input, up to the folder that the user named, if any."""
    for path, root in (
        (each.path.absolute(), each.root.absolute()),
        (each.path.resolve(), each.root.resolve()),
    ):
        places = [path, path.parent] if path.is_dir() else [path.parent]
        places += [p for p in path.parents if p == root or root in p.parents]
        for folder in places:
            if (folder / SETTINGS_NAME).is_file():
                return folder / SETTINGS_NAME
    return None


def has_session_of(inputs, out, config=None) -> bool:
    """Whether `out` has the session.toml that a person wrote for some of the inputs."""
    target = Path(out) / SETTINGS_NAME
    given = [config, *(_session_beside(each) for each in inputs if not each.fault)]
    there = target.is_file()
    return there and any(target.samefile(each) for each in given if each is not None)


def settings_of(inputs, config=None) -> dict:
    """Settings of each input without a fault, by its path; every file is read once.

    InputError or SettingsError with all that is wrong, before anything is processed.
    """
    read, problems, settings = {}, [], {}
    for each in inputs:
        if each.fault:
            continue
        try:
            session = session_of(each, config)
            if session not in read:
                read[session] = None
                read[session] = read_session(session)
            settings[each.path] = read[session]
        except (InputError, SettingsError) as error:
            problems.append(str(error))
    if problems:
        raise InputError("\n".join(dict.fromkeys(problems)))
    return settings


def guesses_left(inputs, config=None) -> list[str]:
    """A sentence on each session.toml in use in which values are still marked as a guess."""
    sessions = dict.fromkeys(session_of(each, config) for each in inputs if not each.fault)
    said = []
    for path in sessions:
        keys = GUESSED.findall(path.read_text(encoding="utf-8-sig"))
        if keys:
            said.append(
                f"{path}: {', '.join(keys)}: still marked as a {GUESS}; measure or check these "
                "values, then delete the word"
            )
    return said
