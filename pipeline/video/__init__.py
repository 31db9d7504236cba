"""Any input → grey frames."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(
    __name__,
    submod_attrs={
        "base": ["Video"],
        "changed": ["Changed", "Negative", "Steadied"],
        "open": ["find_videos", "open_video"],
    },
)
