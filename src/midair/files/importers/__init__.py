"""Readers and writers for file formats of other programs, one module each."""

from .csv_file import load_palm_path as load_palm_path
from .csv_file import save_palm_path as save_palm_path
