"""What the tests of the page have in common."""

import contextlib

from promises.stand_in import drawn_quickly

from pipeline.app import batch
from pipeline.curate.results import Results
from pipeline.runtime.progress import Progress
from pipeline.tables import files
from pipeline.tables.columns import CONTACT_COLUMNS

FRAMES = 240  # of each video
PATIENCE_S = 20  # for an answer of the page, on a busy machine


def process(videos, results, **options):
    with drawn_quickly():
        summary = batch.run([videos], results, progress=Progress, **options)
    assert not summary.of("failed")


@contextlib.contextmanager
def opened(folder):
    results = Results(folder)
    try:
        yield results
    finally:
        results.close()


def contacts_of(folder, video=None):
    return files.read_csv(
        folder / (f"{video}/contacts.csv" if video else "contacts.csv"), CONTACT_COLUMNS
    )


def edges(contacts):
    return list(zip(contacts["onset_frame"], contacts["offset_frame"], strict=True))
