"""Settings as Python code gives them: `Settings`, a file, a dictionary, or none."""

import os
from collections.abc import Mapping
from pathlib import Path

from pipeline.errors import InputError, VideoError
from pipeline.session.input_settings import session_of
from pipeline.session.inputs import Input
from pipeline.session.schema import Settings
from pipeline.session.session_file import read_session, settings_from


def settings_given(settings, video=None) -> Settings:
    """Return the `Settings` that are meant.

    Parameters
    ----------
    settings : `Settings`, path of a session.toml, dictionary of its content, or None: the
        session.toml beside the video
    video : path of the video, or something else than a path

    Raises
    ------
    SettingsError, InputError
        If they cannot be used, or there are none.
    VideoError
        If they would lie beside a video that does not exist.
    """
    if isinstance(settings, Settings):
        return settings
    if isinstance(settings, Mapping):
        return settings_from(dict(settings), "settings")
    if isinstance(settings, (str, os.PathLike)):
        return read_session(settings)
    if settings is not None:
        raise InputError(
            "settings: expected `Settings`, the path of a session.toml or a dictionary of its "
            f"content, got {type(settings).__name__}"
        )
    if not isinstance(video, (str, Path)):
        raise InputError("no settings: give `Settings`, or the path of a session.toml")
    path = Path(video)
    if not path.exists():
        raise VideoError(path, "does not exist; check the name")
    return read_session(session_of(Input(path, path if path.is_dir() else path.parent)))
