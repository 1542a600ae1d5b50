"""The command line: one file a command."""

from luenberger.cli.application import app, main

__all__ = ["app", "main"]
