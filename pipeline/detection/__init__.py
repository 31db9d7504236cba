"""Lines in one frame, each to a part of a pixel."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(
    __name__,
    submod_attrs={
        "image_model": ["ImageModel"],
        "line": ["Line", "Workspace"],
        "static_scene": ["PoleTrack", "StaticScene"],
        "tracing_options": ["TracingOptions"],
    },
)
