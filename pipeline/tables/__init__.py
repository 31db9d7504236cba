"""Columns declared once; files, each whole or not at all."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(
    __name__,
    submod_attrs={
        "centrelines": ["Centrelines", "read_centrelines"],
        "columns": [
            "CONTACT_COLUMNS",
            "EVIDENCE_COLUMNS",
            "FRAME_COLUMNS",
            "VIDEO_COLUMNS",
            "as_table",
            "with_units",
            "empty_table",
        ],
        "evidence": ["read_evidence", "write_evidence"],
        "files": ["read_csv", "read_frames", "write_csv", "write_frames"],
        "whole_files": ["read_json"],
    },
)
