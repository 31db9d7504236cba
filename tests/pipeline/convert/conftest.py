"""Results made by hand, as the formats' writers take them."""

import pandas as pd
import pytest
from results_folder import CONTACTS, make_results

from pipeline.convert.results import read_results
from pipeline.tables.columns import CONTACT_COLUMNS
from pipeline.tables.files import write_csv


@pytest.fixture
def videos(tmp_path):
    """The finished videos of a small results folder."""
    videos = read_results(make_results(tmp_path / "results"))
    for video in videos:
        own = pd.DataFrame([c for c in CONTACTS if c["video"] == video.name])
        write_csv(video.folder / "contacts.csv", own, CONTACT_COLUMNS)
    return videos
