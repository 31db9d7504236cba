"""Folders that take long to make, made once for all processes of a test run."""

import os
from contextlib import contextmanager

from filelock import FileLock


@contextmanager
def made_once(tmp_path_factory, name):
    """Give a folder, and whether it is to be filled; whoever comes meanwhile waits.

    What is in it may be read and copied, but not changed.
    """
    if "PYTEST_XDIST_WORKER" not in os.environ:
        yield tmp_path_factory.mktemp(name), True
        return
    folder = tmp_path_factory.getbasetemp().parent / name  # of all processes
    with FileLock(folder.with_suffix(".lock")):
        whole = folder.with_suffix(".whole")
        folder.mkdir(exist_ok=True)
        yield folder, not whole.exists()
        whole.touch()
