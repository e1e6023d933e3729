"""Readers and writers for file formats of other programs, one module each."""

from midair.files.importers.pat_file import load_board

__all__ = ["load_board"]
