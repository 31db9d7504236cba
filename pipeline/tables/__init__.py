"""Columns declared once; files, each whole or not at all."""
