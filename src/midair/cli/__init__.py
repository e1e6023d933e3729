"""The command line: what a person types."""

from midair.cli.app import app, main, run

__all__ = ["app", "main", "run"]
