"""The command line: arguments, processes, exit status."""
