"""The tracker's lengths in pixels, from the scale and the whiskers' own lengths."""

import numpy as np

from pipeline.detection.tracing_options import TracingOptions
from pipeline.session.parameters import DEFAULTS
from pipeline.session.recording import Recording

LONGER, LONGER_PX = 1.03, 4  # than its given length a line may be


def options_for(
    recording: Recording, lengths_m=(), hidden_m=(), params=DEFAULTS
) -> TracingOptions:
    """Derive the tracker's lengths from the scale and, where known, the whiskers' own lengths.

    Parameters
    ----------
    recording : frame rate, scale, and where the snout is, if known
    lengths_m, hidden_m : follicle-to-tip lengths of the expected whiskers and their parts
        hidden in the fur [m]; empty where unknown
    params : `Parameters` of all rooms
    """
    scale, own = recording.pixels_per_m, params.tracking
    visible = [(a - b) * scale for a, b in zip(lengths_m, hidden_m, strict=True)]
    longest = [LONGER * length + LONGER_PX for length in visible]
    if visible:
        shortest = max(min(5e-3 * scale, 0.35 * min(visible)), 30.0)
    else:
        shortest = max(own.shortest_line_mm / 1e3 * scale, 40.0)
    return TracingOptions(  # however few pixels a millimetre has, so many are needed
        spacing_px=max(own.knot_spacing_mm / 1e3 * scale, 8.0),
        shortest_px=shortest,
        base_gap_px=max(own.base_gap_mm / 1e3 * scale, 25.0),
        bridge_px=int(max(own.bridge_mm / 1e3 * scale, 15)),
        longest_px=max(longest, default=np.inf),
        visible_px=tuple(longest),
        hidden_px=tuple(scale * h for h in hidden_m),
        pixels_per_m=scale,
        frames_per_second=recording.frames_per_second,
        snout=recording.snout,
        params=params,
    )
