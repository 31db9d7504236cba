"""Touches: when, how strong, and what they do at the base."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(
    __name__,
    submod_attrs={
        "analysis": ["Touch", "TouchOptions", "analyse_touch", "find_touches", "no_touches"],
        "corrections": ["apply", "read_corrections", "write_corrections"],
    },
)
