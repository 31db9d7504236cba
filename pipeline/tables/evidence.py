"""What `forces.estimate_forces` measured, kept beside the tables.

Contacts and forces are recomputed from it when a person corrects contacts; the video is not
needed.
"""

from pathlib import Path

import pandas as pd

from pipeline.tables.columns import EVIDENCE_COLUMNS
from pipeline.tables.files import read_rows, write_rows

EVIDENCE_FILE = "evidence.parquet"


def write_evidence(folder, evidence: pd.DataFrame) -> None:
    """Write the evidence of a video (EVIDENCE_COLUMNS, SI units) into its folder."""
    write_rows(Path(folder) / EVIDENCE_FILE, evidence, EVIDENCE_COLUMNS)


def read_evidence(folder) -> pd.DataFrame:
    """Read the evidence as `write_evidence` left it.

    Raises
    ------
    FileNotFoundError, ValueError
        Where there is none, or it is damaged.
    """
    return read_rows(Path(folder) / EVIDENCE_FILE, EVIDENCE_COLUMNS).to_pandas()
