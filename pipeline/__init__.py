"""From a video of whiskers to contacts, forces and base moments.

What users call, and the types that travel between the rooms, are listed in `__init__.pyi`; they
are imported when they are used, for importing them all takes a second.
"""

import lazy_loader

__version__ = "0.1.0"

_attribute, _names, __all__ = lazy_loader.attach_stub(__name__, __file__)
_COMPILED = ("analyse", "analyse_lines")


def __getattr__(name):
    """Import a public name; before numeric code, drop what was compiled of other versions."""
    if name in _COMPILED:
        from pipeline.runtime.numba_cache import prepare_cache

        prepare_cache()
    return _attribute(name)


def __dir__():
    return sorted([*_names(), "__version__"])
