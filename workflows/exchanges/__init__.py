"""Our files beside other programs, a module per kind; `workflows/exchange.py` runs all."""
