"""One NumPy array in a file, as written by `numpy.save`."""

import math
from pathlib import Path

import numpy as np

from midair.errors import BrokenFileError
from midair.files.importers.named_arrays import from_arrays
from midair.files.opened_take import Format, ImportOptions, OpenedTake


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
