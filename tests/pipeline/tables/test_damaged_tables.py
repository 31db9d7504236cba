"""Tables whose files were damaged where no checksum protects them."""

import contextlib

import numpy as np
import pandas as pd
import pytest

from pipeline.tables import files
from pipeline.tables.columns import FRAME_COLUMNS, as_table


def test_a_list_of_contents_that_speaks_of_nothing_is_no_empty_table(tmp_path):
    """Zeros over the end of a parquet file, where it lists what it holds."""
    path = tmp_path / "frames.parquet"
    files.write_frames(path, as_table(pd.DataFrame({"frame": range(50)}), FRAME_COLUMNS))
    content = path.read_bytes()
    footer = len(content) - 8 - int.from_bytes(content[-8:-4], "little")
    wrong = 0
    for at in np.linspace(footer, len(content) - 60, 80).astype(int):
        path.write_bytes(content[:at] + bytes(60) + content[at + 60 :])
        with contextlib.suppress(ValueError):
            wrong += len(files.read_rows(path)) != 50
    assert wrong == 0
    path.write_bytes(content)
    assert files.check_parquet(path, FRAME_COLUMNS, thorough=True) == 50


def test_a_row_of_too_many_values_is_named(tmp_path):
    path = tmp_path / "contacts.csv"
    path.write_text("frame\n1\n2,3\n")
    with pytest.raises(ValueError, match=r"contacts\.csv: line 3: expected 1 values, found 2"):
        files.read_csv(path, FRAME_COLUMNS[:1])
