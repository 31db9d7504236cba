"""Rendered whisker videos with known truth."""
