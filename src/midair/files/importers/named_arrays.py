"""Named arrays: what NPZ and MAT files have in common, and the files of NumPy, one array (NPY) or an archive (NPZ)."""

import math
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from midair.errors import BrokenFileError, MismatchError
from midair.files.atomic import atomic_file, check_disk_space
from midair.files.importers.header import header_of, parse_header, recording_from
from midair.files.opened_take import Format, FormatLoss, ImportedData, ImportOptions, OpenedTake, calibration_lost
from midair.files.size_limits import check_expansion
from midair.model import Calibration, Recording
from midair.streaming import blocks


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
    names = [name for name, array in arrays.items() if _frames(array)]
    found = ", ".join(f"{name} {np.shape(array)}" for name, array in arrays.items()) or "nothing"
    if given.stream is not None:
        if given.stream not in names:
            raise MismatchError(f"{path}: expected an array of frames called {given.stream!r}, got {found}")
        return given.stream
    for only in (["samples"] if "samples" in names else [], [name for name in names if arrays[name].ndim > 1], names):
        if len(only) == 1:
            return only[0]
    raise BrokenFileError(
        f"{path}: expected one array of numbers with axes (frame, channel) or (frame, row, column), or one called "
        f"samples, or the name of one as stream, got {found}"
    )


def _own(arrays: Mapping[str, Any], path: Path, given: ImportOptions) -> OpenedTake:
    header = parse_header(_text(arrays["midair"]), path)
    samples = np.asarray(arrays["samples"], np.float64)
    for name, stated in (("rate", header["rate_hz"]), ("unit", header["unit"])):
        have = _text(arrays[name]) if name == "unit" else np.asarray(arrays[name]).item()
        if have != stated:
            raise BrokenFileError(f"{path}: {name} was edited: expected {stated} as in the header, got {have}")
    recording = recording_from(header, samples, path)
    given.check(recording, path)
    return OpenedTake(recording=recording)


def _frames(array: Any) -> bool:
    """True for more than one real number with one to three axes."""
    return isinstance(array, np.ndarray) and array.dtype.kind in "fiu" and array.ndim in (1, 2, 3) and array.size > 1


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
