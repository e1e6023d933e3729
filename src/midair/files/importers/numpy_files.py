"""Arrays of NumPy: one in a file (NPY) or an archive of several (NPZ), of midair or of another program."""

import math
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from midair.errors import BrokenFileError
from midair.files.atomic import atomic_file, check_disk_space
from midair.files.importers.header import header_of
from midair.files.importers.named_arrays import from_arrays
from midair.files.opened_take import Format, FormatLoss, ImportOptions, OpenedTake, calibration_lost
from midair.files.size_limits import check_expansion
from midair.model import Calibration, Recording
from midair.streaming import blocks


def read_npy(path: Path, given: ImportOptions) -> OpenedTake:
    """Read an array of frames, which has no other information; objects are not loaded, because they could run code."""
    with path.open("rb") as file:
        version = np.lib.format.read_magic(file)
        read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, _, kind = read(file)
        announced, there = math.prod(shape) * kind.itemsize, path.stat().st_size - file.tell()
        if announced != there and not kind.hasobject:
            # NumPy would allocate the memory before it reads the file.
            raise BrokenFileError(
                f"{path}: expected {announced} bytes according to its header, got {there}; copy the file again"
            )
        file.seek(0)
        array = np.load(file, allow_pickle=False)
    return from_arrays({path.stem: array}, "NPY", path, given)


NPY = Format(name="NPY", read=read_npy, memory=2)


def write_npz(recording: Recording, path: Path, calibration: Calibration | None) -> tuple[FormatLoss, ...]:
    """Write the samples, shape (frame, row, column), their rate in Hz and unit, and the header."""
    rest = {"rate": recording.rate, "unit": recording.unit, "midair": header_of(recording)}
    with atomic_file(path) as partial:
        check_disk_space(partial.parent, recording.samples.nbytes, path)
        with zipfile.ZipFile(partial, "w", allowZip64=True) as archive:
            with archive.open("samples.npy", "w", force_zip64=True) as file:
                shape = recording.samples.shape
                np.lib.format.write_array_header_1_0(file, {"descr": "<f8", "fortran_order": False, "shape": shape})
                for block in blocks(recording.samples):
                    file.write(block.tobytes())
            for name, value in rest.items():
                with archive.open(f"{name}.npy", "w") as file:
                    np.lib.format.write_array(file, np.array(value), allow_pickle=False)
    return calibration_lost(calibration, "NPZ")


def read_npz(path: Path, given: ImportOptions) -> OpenedTake:
    """Read an archive of midair, or the only array of frames of another; objects could run code and are not loaded."""
    arrays: dict[str, Any] = {}
    with zipfile.ZipFile(path) as packed:
        # At most the stated size of a member is read.
        check_expansion(path, sum(member.file_size for member in packed.infolist()))
    with path.open("rb") as file, np.load(file, allow_pickle=False) as archive:
        for name in archive.files:
            arrays[name] = archive[name]
    return from_arrays(arrays, "NPZ", path, given)


NPZ = Format(name="NPZ", read=read_npz, write=write_npz, memory=3)
