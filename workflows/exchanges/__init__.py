"""Our files tested with other programs, a module per kind; `workflows/exchange.py` runs all."""
