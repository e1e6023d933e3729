"""MATLAB files: `samples`, `rate`, `unit` and midair's header, or one array of another program (v4 to v7.3)."""

from pathlib import Path
from typing import Any

import numpy as np

from midair.errors import BrokenFileError, FileError
from midair.files.atomic import atomic_file, reason
from midair.files.importers.header import header_of
from midair.files.importers.mat5 import is_mat5, read_mat5, write_frames
from midair.files.importers.named_arrays import from_arrays
from midair.files.native import open_plain
from midair.files.opened_take import Format, FormatLoss, ImportOptions, OpenedTake, calibration_lost
from midair.model import Calibration, Recording


def write_mat(recording: Recording, path: Path, calibration: Calibration | None) -> tuple[FormatLoss, ...]:
    """Write a v5 file of less than 4 GiB: samples, shape (frame, row, column), rate in Hz, unit, and the header."""
    from scipy.io import savemat

    if recording.samples.nbytes >= 2**32:
        raise FileError(f"{path}: a MAT v5 array holds less than 4 GiB, got {recording.samples.nbytes}; save to .h5")
    rest = {"rate": recording.rate, "unit": recording.unit, "midair": header_of(recording)}
    with atomic_file(path) as partial:
        savemat(str(partial), rest, appendmat=False, do_compression=True)
        small = partial.read_bytes()
        with partial.open("wb") as file:
            file.write(small[:128])
            write_frames(file, "samples", recording.samples)
            file.write(small[128:])
    return calibration_lost(calibration, "MAT")


def read_mat(path: Path, given: ImportOptions) -> OpenedTake:
    """Read a MATLAB file of midair, or the only array of frames of another program."""
    from scipy.io import loadmat
    from scipy.io.matlab import MatReadError

    with path.open("rb") as file:
        start = file.read(128)
    if is_mat5(start):
        return from_arrays(read_mat5(path), "MAT", path, given)
    if start.startswith(b"MATLAB 7.3"):
        return from_arrays(_version_73(path), "MAT v7.3", path, given)
    if 0 not in start[:4]:  # present in every version 4 file; SciPy's compiled reader crashes on other damaged files
        raise BrokenFileError(f"{path}: expected a MATLAB file, got one that begins with {start[:12]!r}")
    try:
        arrays: dict[str, Any] = loadmat(str(path), appendmat=False)
    except MatReadError as wrong:
        raise BrokenFileError(f"{path}: expected a MATLAB file, got other bytes ({reason(wrong)})") from wrong
    return from_arrays({name: array for name, array in arrays.items() if not name.startswith("__")}, "MAT", path, given)


def _version_73(path: Path) -> dict[str, Any]:
    """Numeric arrays in an HDF5 file of MATLAB, which reverses their axes."""
    import h5py

    with open_plain(path) as file:
        found = {name: item for name, item in file.items() if isinstance(item, h5py.Dataset)}
        return {name: np.transpose(item[()]) for name, item in found.items() if item.dtype.kind in "fiu"}


MAT = Format(name="MAT", read=read_mat, write=write_mat, memory=3)
