"""The command `whiskerforce`, and `python -m pipeline`."""

import os
import signal

from pipeline.runtime.interrupts import INTERRUPTED


def main() -> None:
    """Import the command, during which Ctrl-C ends it at once and silently, and run it."""
    for number in (signal.SIGINT, signal.SIGTERM):  # until the command listens
        signal.signal(number, lambda *_: os._exit(INTERRUPTED))
    from pipeline.app import cli

    cli.main()


if __name__ == "__main__":
    main()
