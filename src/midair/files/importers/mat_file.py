"""MATLAB and NumPy files: `samples`, `rate`, `unit` and midair's header, or one array of another program.

SciPy reads and writes MATLAB's versions 4 to 7; version 7.3 is HDF5.
"""

import math
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from midair.errors import BrokenFileError, FileError, MismatchError
from midair.files.atomic import atomic_file, check_disk_space, reason
from midair.files.importers.header import header_of, own_take
from midair.files.native.hdf5 import open_hdf5
from midair.files.opened_take import Format, FormatLoss, ImportedData, ImportOptions, OpenedTake
from midair.files.size_limits import check_expansion
from midair.model import Recording


def from_arrays(arrays: Mapping[str, Any], form: str, path: Path, given: ImportOptions) -> OpenedTake:
    """The recording in named arrays of midair, or in the only array of frames of another program."""
    if "midair" in arrays:
        return _own(arrays, path, given)
    name = _chosen(arrays, path, given)
    samples = np.asarray(arrays[name], np.float64)
    report: tuple[str, ...] = ()
    if samples.ndim == 1 or samples.shape[0] == 1:
        report = (f"Array {name} {samples.shape} was taken as one channel of {samples.size} frames.",)
        samples = samples.reshape(-1, 1)
    return ImportedData(samples=samples, form=form, settings={"array": name}, report=report).resolve(given, path)


def _chosen(arrays: Mapping[str, Any], path: Path, given: ImportOptions) -> str:
    """Name of the array of frames: the chosen one, or "samples", or the only one."""
    numbers = {name: each for name, each in arrays.items() if isinstance(each, np.ndarray) and each.dtype.kind in "fiu"}
    names = [name for name, array in numbers.items() if array.ndim in (1, 2, 3) and array.size > 1]
    found = ", ".join(f"{name} {np.shape(array)}" for name, array in arrays.items()) or "nothing"
    if given.field is not None:
        if given.field not in names:
            raise MismatchError(f"{path}: expected an array of frames called {given.field!r}, got {found}")
        return given.field
    for only in (["samples"] if "samples" in names else [], [name for name in names if arrays[name].ndim > 1], names):
        if len(only) == 1:
            return only[0]
    raise BrokenFileError(
        f"{path}: expected one array of numbers with axes (frame, channel) or (frame, row, column), or one called "
        f"samples, or the name of one as field, got {found}"
    )


def _own(arrays: Mapping[str, Any], path: Path, given: ImportOptions) -> OpenedTake:
    take = own_take(_text(arrays["midair"]), np.asarray(arrays["samples"], np.float64), given, path)
    for name in ("rate", "unit"):
        have = _text(arrays[name]) if name == "unit" else np.asarray(arrays[name]).item()
        if have != (stated := getattr(take.recording, name)):
            raise BrokenFileError(f"{path}: {name} was edited: expected {stated} as in the header, got {have}")
    return take


def _text(array: Any) -> str:
    value: NDArray[Any] = np.asarray(array)
    if value.dtype.kind != "U" or value.size != 1:
        raise BrokenFileError(f"expected one piece of text, got {value.dtype} of shape {value.shape}")
    return str(value.reshape(-1)[0])


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


def write_npz(recording: Recording, path: Path) -> tuple[FormatLoss, ...]:
    """Write the samples, shape (frame, row, column), their rate in Hz and unit, and the header."""
    header = header_of(recording)
    with atomic_file(path) as partial:
        check_disk_space(partial.parent, recording.samples.nbytes, path)
        with partial.open("wb") as file:
            np.savez(file, samples=recording.samples, rate=recording.rate, unit=recording.unit, midair=header)
    return ()


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


def write_mat(recording: Recording, path: Path) -> tuple[FormatLoss, ...]:
    """Write a v5 file of less than 4 GiB: samples, shape (frame, row, column), rate in Hz, unit, and the header."""
    if recording.samples.nbytes >= 2**32:
        raise FileError(f"{path}: a MAT v5 array holds less than 4 GiB, got {recording.samples.nbytes}; save to .h5")
    rest = {"rate": recording.rate, "unit": recording.unit, "midair": header_of(recording)}
    with atomic_file(path) as partial:
        scipy.io.savemat(str(partial), {"samples": recording.samples, **rest}, appendmat=False, do_compression=True)
    return ()


def read_mat(path: Path, given: ImportOptions) -> OpenedTake:
    """Read a MATLAB file of midair, or the only array of frames of another program."""
    with path.open("rb") as file:
        start = file.read(128)
    if start.startswith(b"MATLAB 7.3"):
        return from_arrays(_version_73(path), "MAT v7.3", path, given)
    # A file of version 4 has a 0 in its first four bytes; SciPy crashes on some other files.
    if start[124:128] not in (b"\x00\x01IM", b"\x01\x00MI") and 0 not in start[:4]:
        raise BrokenFileError(f"{path}: expected a MATLAB file, got one that begins with {start[:12]!r}")
    try:
        arrays: dict[str, Any] = scipy.io.loadmat(str(path), appendmat=False)
    except scipy.io.matlab.MatReadError as wrong:
        raise BrokenFileError(f"{path}: expected a MATLAB file, got other bytes ({reason(wrong)})") from wrong
    return from_arrays({name: array for name, array in arrays.items() if not name.startswith("__")}, "MAT", path, given)


def _version_73(path: Path) -> dict[str, Any]:
    """Numeric arrays in an HDF5 file of MATLAB, which reverses their axes."""
    import h5py

    with open_hdf5(path) as file:
        found = {name: item for name, item in file.items() if isinstance(item, h5py.Dataset)}
        return {name: np.transpose(item[()]) for name, item in found.items() if item.dtype.kind in "fiu"}


MAT = Format(name="MAT", read=read_mat, write=write_mat, memory=3)
