"""Other programs' files, in and out: one file per format."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(
    __name__, submod_attrs={"results": ["VideoResults", "read_results"]}
)
