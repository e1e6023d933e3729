"""Readers and writers for file formats of other programs, one module each."""

from .pat_file import load_board as load_board
from .pose_csv import load_palm_path as load_palm_path
from .pose_csv import save_palm_path as save_palm_path
