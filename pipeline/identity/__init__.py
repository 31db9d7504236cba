"""Which line is which whisker, over a whole video."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(
    __name__,
    submod_attrs={
        "assign": ["assign_identities"],
        "unnamed": ["Unnamed"],
    },
)
