"""The command line: arguments, processes, exit status; no science."""
