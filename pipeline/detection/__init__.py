"""Lines in one frame, each to a part of a pixel."""
