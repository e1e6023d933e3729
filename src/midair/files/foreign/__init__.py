"""Formats of other programs, one file each."""

from midair.files.foreign.csv_file import read_csv, write_csv
from midair.files.foreign.mat_file import read_mat, write_mat
from midair.files.foreign.mcap_file import read_mcap
from midair.files.foreign.npy_file import read_npy
from midair.files.foreign.npz_file import read_npz, write_npz
from midair.files.foreign.pat_file import load_board
from midair.files.foreign.sound_file import read_sound
from midair.files.foreign.tdms_file import read_tdms
from midair.files.foreign.wav_file import read_wav, write_wav
from midair.files.foreign.xdf_file import read_xdf

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
