"""What `contact.measure_touch` measured, kept beside the tables.

From it contacts and forces are made anew when a person corrects contacts, without the video.
"""

from pathlib import Path

import pandas as pd

from pipeline.records import EVIDENCE_COLUMNS, as_table
from pipeline.tables import whole_file

EVIDENCE_FILE = "evidence.parquet"


def write_evidence(folder, evidence: pd.DataFrame) -> None:
    """Write the evidence of a video (records.EVIDENCE_COLUMNS, SI units) into its folder."""
    evidence = as_table(evidence, EVIDENCE_COLUMNS)
    with whole_file(Path(folder) / EVIDENCE_FILE) as temporary:
        evidence.to_parquet(temporary, index=False, compression="zstd")


def read_evidence(folder) -> pd.DataFrame:
    """Read the evidence as `write_evidence` left it.

    Raises
    ------
    FileNotFoundError
        Where there is none.
    """
    return pd.read_parquet(Path(folder) / EVIDENCE_FILE)
