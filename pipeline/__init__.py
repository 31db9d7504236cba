"""From a video of whiskers to contacts, forces and base moments.

What users call, and the types that travel between the rooms, are listed in `__init__.pyi`; they
are imported when they are used, for importing them all takes a second.
"""

import lazy_loader

__version__ = "0.1.0"

__getattr__, _names, __all__ = lazy_loader.attach_stub(__name__, __file__)


def __dir__():
    return sorted([*_names(), "__version__"])
