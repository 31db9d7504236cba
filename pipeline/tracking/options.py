"""The tracker's lengths in pixels, from the scale and the whiskers' own lengths."""

import numpy as np

from pipeline.detection.tracing_options import TracingOptions
from pipeline.session.parameters import Parameters
from pipeline.session.recording import Recording

LONGER, LONGER_PX = 1.03, 4  # than its given length a line may be
# Chosen: pixels per mm that a length along a line counts at least; least length of a line that is
# looked for; where lengths are given, it must be so much of the shortest whisker, but no more [m]
FEWEST_PER_MM, SHORTEST_PX, SHORTEST_GIVEN_PX = 12.5, 40.0, 30.0
PART, PART_M = 0.35, 5e-3


def options_for(
    recording: Recording, lengths_m=(), hidden_m=(), *, params: Parameters
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

    def along(length_mm):
        return max(length_mm / 1e3 * scale, length_mm * FEWEST_PER_MM)

    visible = [(a - b) * scale for a, b in zip(lengths_m, hidden_m, strict=True)]
    longest = [LONGER * length + LONGER_PX for length in visible]
    if visible:
        shortest = max(min(PART_M * scale, PART * min(visible)), SHORTEST_GIVEN_PX)
    else:
        shortest = max(own.shortest_line_mm / 1e3 * scale, SHORTEST_PX)
    return TracingOptions(
        spacing_px=along(own.knot_spacing_mm),
        shortest_px=shortest,
        base_gap_px=along(own.base_gap_mm),
        bridge_px=int(along(own.bridge_mm)),
        longest_px=max(longest, default=np.inf),
        visible_px=tuple(longest),
        hidden_px=tuple(scale * h for h in hidden_m),
        pixels_per_m=scale,
        frames_per_second=recording.frames_per_second,
        snout=recording.snout,
        params=params,
    )
