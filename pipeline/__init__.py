"""From a video of whiskers to contacts, forces and base moments."""

from importlib import import_module

__version__ = "0.1.0"

_FROM = {  # what users call, and the types that travel between the rooms
    "analyse": "pipeline.run",
    "Analysis": "pipeline.run",
    "read_session": "pipeline.session",
    "Settings": "pipeline.session",
    "Recording": "pipeline.session",
    "Parameters": "pipeline.session",
    "open_video": "pipeline.video",
    "Video": "pipeline.video",
    "StaticScene": "pipeline.detection",
    "PoleTrack": "pipeline.detection",
    "Line": "pipeline.detection",
    "Centrelines": "pipeline.tables",
    "Stations": "pipeline.kinematics",
    "Kinematics": "pipeline.kinematics",
    "Touch": "pipeline.contacts",
}
__all__ = list(_FROM)


def __getattr__(name):
    """Import public names when they are used: importing them all takes a second."""
    if name not in _FROM:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    if _FROM[name] == "pipeline.run":
        from pipeline.runtime.numba_cache import prepare_cache

        prepare_cache()
    return getattr(import_module(_FROM[name]), name)


def __dir__():
    return sorted([*_FROM, "__version__"])
