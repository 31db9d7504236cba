"""HDF5 files: texts in them; written whole or not at all."""

import contextlib
import io

import numpy as np

from pipeline.convert.optional import library
from pipeline.tables.whole_files import whole_file


@contextlib.contextmanager
def whole_hdf5(path, extra="formats"):
    """Yield an `h5py.File` in memory, which replaces `path` when the block succeeds.

    On a full disk HDF5 would fail again as the program ends, and crash it.
    """
    held = io.BytesIO()
    with library("h5py", extra).File(held, "w") as file:
        yield file
    with whole_file(path) as temporary:
        temporary.write_bytes(held.getbuffer())


def texts_in(dataset) -> tuple[str, ...]:
    """The texts of a dataset, which h5py gives as bytes or as they are."""
    return tuple(v.decode() if isinstance(v, bytes) else str(v) for v in np.ravel(dataset[()]))
