"""From a video of whiskers to contacts, forces and base moments."""

__version__ = "0.1.0"

__all__ = ["analyse", "read_session"]


def __getattr__(name):
    """Bring in the public functions when they are asked for: importing them all takes a second."""
    if name == "analyse":
        from pipeline.runtime.numba_cache import prepare_cache

        prepare_cache()
        from pipeline.run import analyse

        return analyse
    if name == "read_session":
        from pipeline.session.session_file import read_session

        return read_session
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
