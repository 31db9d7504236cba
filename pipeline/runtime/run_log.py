"""run.log in a results folder: what happened in each run, with times."""

import contextlib
from datetime import UTC, datetime
from pathlib import Path

LOG_FILE = "run.log"


class RunLog:
    """Lines added to a results folder's run.log at once, so that a killed run leaves its story.

    Where the file cannot be written, the run goes on without it.
    """

    def __init__(self, folder):
        self.path = Path(folder) / LOG_FILE

    def write(self, text: str) -> None:
        """Add lines, each with the time."""
        now = datetime.now(UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")
        lines = "".join(f"{now}  {line}\n" for line in text.splitlines())
        with contextlib.suppress(OSError), open(self.path, "a", encoding="utf-8") as file:
            file.write(lines)

    def record(self, event, names) -> None:
        """Add a line for an event of `pipeline.runtime.workers`."""
        if event.kind == "start":
            self.write(f"{names[event.task]}: started")
        elif event.kind == "done":
            self.write(f"{names[event.task]}: {event.value.line()}")
            self.write(getattr(event.value, "details", ""))
