"""The command line: arguments, tables, exit codes; no mathematics.

Exit codes: 0, every check passed; 1, a check found a violation; 2, bad input, with one message and no traceback; 3, the
machine or the cluster failed.
"""

from pinbound.cli.app import app, main

__all__ = ["app", "main"]
