"""Rendered whisker videos with known truth: `render_session` makes them, `PRESETS` names them."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(
    __name__,
    submod_attrs={
        "encode": ["write_video"],
        "micrograph": ["Micrograph", "random_micrograph"],
        "presets": ["PRESETS", "Trial", "make_trial"],
        "render": ["Renderer"],
        "scene": ["Camera", "Codec", "Face", "Hair", "Lights", "Pole", "Scene"],
        "session": ["RenderError", "render_session", "render_trial"],
    },
)
