"""A program whose worker processes compute without end, in a file that they load quickly."""

import os
import sys
import time
from pathlib import Path

from pipeline.runtime.workers import run_tasks


def endless(folder, report):
    """Say which process this is, by a file's name; then be busy."""
    (folder / f"{os.getpid()}").touch()
    while True:
        time.sleep(0.01)


if __name__ == "__main__":
    sys.path[0] = str(Path(__file__).parent)
    from endless_tasks import endless as task  # workers find it by this name

    run_tasks(task, [Path(sys.argv[1])] * 2, print, 2)
