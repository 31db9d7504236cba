"""`python -m pipeline` is the command `whiskerforce`."""

from pipeline.app.cli import main

main()
