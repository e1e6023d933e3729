"""Formats of other programs, one file each."""

from midair.files.importers.csv_file import read_csv, write_csv
from midair.files.importers.mat_file import read_mat, write_mat
from midair.files.importers.mcap_file import read_mcap
from midair.files.importers.npy_file import read_npy
from midair.files.importers.npz_file import read_npz, write_npz
from midair.files.importers.pat_file import load_board
from midair.files.importers.sound_file import read_sound
from midair.files.importers.tdms_file import read_tdms
from midair.files.importers.wav_file import read_wav, write_wav
from midair.files.importers.xdf_file import read_xdf

__all__ = [
    "load_board",
    "read_csv",
    "read_mat",
    "read_mcap",
    "read_npy",
    "read_npz",
    "read_sound",
    "read_tdms",
    "read_wav",
    "read_xdf",
    "write_csv",
    "write_mat",
    "write_npz",
    "write_wav",
]
