"""The command line: what a person types."""

from midair.cli.app import app, load, main, run

__all__ = ["app", "load", "main", "run"]
