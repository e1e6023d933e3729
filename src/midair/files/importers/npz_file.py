"""NumPy archives: `samples`, `rate`, `unit` and midair's header, or one array of another program."""

import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from midair.files.atomic import atomic_file, check_disk_space
from midair.files.decompression_limits import check_expansion
from midair.files.format_loss import FormatLoss, calibration_lost
from midair.files.importers.header import header_of
from midair.files.importers.named_arrays import from_arrays
from midair.files.opened_take import Format, ImportOptions, OpenedTake
from midair.model import Calibration, Recording
from midair.streaming import blocks


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
