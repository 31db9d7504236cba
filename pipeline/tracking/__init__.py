"""Lines from frame to frame."""
