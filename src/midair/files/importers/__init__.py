"""Readers and writers for file formats of other programs, one module each."""

from .pat_file import load_board as load_board
