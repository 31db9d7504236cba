"""Dynamic base moment of every contact: steady and vibrational, from the model."""

import pandas as pd

from pipeline.records import Recording


def add_base_moments(
    contacts: pd.DataFrame, frames: pd.DataFrame, whiskers: dict, recording: Recording
) -> pd.DataFrame:
    """Fill `steady_peak_nN_m` and `vibration_…` (waits for whiskermodel.response)."""
    return contacts
