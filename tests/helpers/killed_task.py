"""A task whose process dies, in a file that a worker process loads quickly."""

import os

from pipeline.tables.result_exchange import draft


def killed(task, report):
    """As when the memory runs out, in the middle of a video."""
    with draft(task.folder) as new:
        (new / "frames.parquet").write_text("half a ta")
        (new / ".whiskerforce-x.part.parquet").touch()
        os._exit(9)
