"""Touches: when, how strong, and what they do at the base."""
