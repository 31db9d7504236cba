"""A task whose process dies, in a file that a worker process loads quickly."""

import json
import os


def killed(task, report):
    """As when the memory runs out, in the middle of a video."""
    task.folder.mkdir()
    state = {"path": str(task.path), "status": "begun"}
    (task.folder / "run.json").write_text(json.dumps(state))
    (task.folder / ".x.part.parquet").touch()
    os._exit(9)
