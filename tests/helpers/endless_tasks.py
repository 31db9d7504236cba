"""A program whose worker processes compute without end, in a file that they load quickly.

They are those of `run_tasks`, or of a pool as the measuring programs have it.
"""

import os
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

from pipeline.runtime.workers import end_with_parent, run_tasks


def endless(folder, report):
    """Say which process this is, by a file's name; then be busy."""
    (folder / f"{os.getpid()}").touch()
    while True:
        time.sleep(0.01)


if __name__ == "__main__":
    sys.path[0] = str(Path(__file__).parent)
    from endless_tasks import endless as task  # workers find it by this name

    folders = [Path(sys.argv[1])] * 2
    if sys.argv[2] == "pool":
        with ProcessPoolExecutor(2, get_context("spawn"), end_with_parent) as pool:
            list(pool.map(task, folders, [print] * 2))
    else:
        run_tasks(task, folders, print, 2)
