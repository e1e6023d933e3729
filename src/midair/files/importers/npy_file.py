"""One NumPy array in a file of its own, as `numpy.save` writes it."""

import math
from pathlib import Path

import numpy as np

from midair.errors import BrokenFileError
from midair.files.importers.named_arrays import from_arrays
from midair.files.opened_take import Format, ImportOptions, OpenedTake


def read_npy(path: Path, given: ImportOptions) -> OpenedTake:
    """The recording in an array of frames; the file says nothing else of it.

    Objects are not loaded: they could run programs.

    Raises
    ------
    BrokenFileError
        If the file is damaged, was cut, or does not hold numbers that can be frames.
    InputError
        Its leaf, if the file does not say enough or a number cannot be used.
    """
    with path.open("rb") as file:
        version = np.lib.format.read_magic(file)
        read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, _, kind = read(file)
        announced, there = math.prod(shape) * kind.itemsize, path.stat().st_size - file.tell()
        if announced != there and not kind.hasobject:
            # NumPy would take the memory first and look at the file later.
            raise BrokenFileError(
                f"{path}: expected {announced} bytes, as its header says, got {there}; copy the file again"
            )
        file.seek(0)
        array = np.load(file, allow_pickle=False)
    return from_arrays({path.stem: array}, "NPY", path, given)


NPY = Format(name="NPY", read=read_npy, memory=2)
