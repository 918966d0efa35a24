"""The command line: one command per file, no numerical library before a command runs."""

from damperfit.cli.main import main

__all__ = ["main"]
