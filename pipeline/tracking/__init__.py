"""Lines from frame to frame."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(
    __name__,
    submod_attrs={
        "given_lengths": ["GivenLengths"],
        "line_ends": ["tips_seen"],
        "registry": ["find_templates", "templates_of"],
        "seen_lengths": ["SeenLength", "odd_length"],
        "stationary_whiskers": ["behind_whiskers"],
        "track_video": ["CHUNK_FRAMES", "sample_lines", "track"],
        "options": ["options_for"],
        "whiskers": [
            "WhiskerSet",
            "whisker_set_of",
            "find_whisker_set",
            "nominal_whisker",
            "template_frames",
            "tracing_options",
        ],
    },
)
