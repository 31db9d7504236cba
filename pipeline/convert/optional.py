"""Libraries that only some formats need."""

import importlib

from pipeline.errors import InputError


def library(name: str, extra: str):
    """Import a library of the extra; InputError with what to install where it is not there."""
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise InputError(
            f"{name} is needed for this format and cannot be imported ({error}); "
            f'pip install "whiskerforce[{extra}]"'
        ) from None
