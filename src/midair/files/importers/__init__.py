"""Formats of other programs, one file each."""

from midair.files.importers.pat_file import load_board

__all__ = ["load_board"]
