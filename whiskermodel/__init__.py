"""Whisker mechanics: statics, modes, response. Needs only numpy and scipy."""
