"""Processes, progress, timing, and compiled code kept on disk."""
