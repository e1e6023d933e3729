"""MATLAB files: `samples`, `rate`, `unit` and midair's header, or one array of another program (v4 to v7.3).

SciPy's compiled reader crashes on some damaged files, so those of version 5 (up to v7) are read here; structures and
cells are not. Layout: "MAT-File Format" (MathWorks), Level 5: a header of 128 bytes, then elements, each a tag (type,
length) and data padded to 8 bytes; short ones keep their data in the tag. Compressed elements are zlib streams with a
checksum.
"""

import math
import struct
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from itertools import islice
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from midair.errors import BrokenFileError, FileError, MismatchError
from midair.files.atomic import atomic_file, check_disk_space, reason
from midair.files.importers.header import header_of, parse_header, recording_from
from midair.files.native import open_hdf5
from midair.files.opened_take import Format, FormatLoss, ImportedData, ImportOptions, OpenedTake, calibration_lost
from midair.files.size_limits import check_expansion, inflated, max_expanded_size
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
    numbers = {name: each for name, each in arrays.items() if isinstance(each, np.ndarray) and each.dtype.kind in "fiu"}
    names = [name for name, array in numbers.items() if array.ndim in (1, 2, 3) and array.size > 1]
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


_NUMBERS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
_CLASSES = {6: "f8", 7: "f4", 8: "i1", 9: "u1", 10: "i2", 11: "u2", 12: "i4", 13: "u4", 14: "i8", 15: "u8"}
_TEXT = {1: "latin-1", 2: "latin-1", 4: "utf-16", 16: "utf-8", 17: "utf-16", 18: "utf-32"}
_MOST = 10_000
_MATRIX, _COMPRESSED, _CHAR, _COMPLEX = 14, 15, 4, 0x08


class _Element(NamedTuple):
    kind: int
    data: bytes


def is_mat5(start: bytes) -> bool:
    """True if the first 128 bytes are those of such a file."""
    return len(start) >= 128 and start[124:128] in (b"\x00\x01IM", b"\x01\x00MI")


def read_mat5(path: Path) -> dict[str, Any]:
    """Read the arrays by name; structures, cells and other classes become empty objects."""
    data = path.read_bytes()
    order = "<" if data[126:128] == b"IM" else ">"
    arrays: dict[str, Any] = {}
    room = max_expanded_size(path)
    for number, element in enumerate(_elements(data[128:], order, path)):
        if number == _MOST:
            raise BrokenFileError(f"{path}: expected at most {_MOST} arrays, got more; the file is damaged")
        held = element
        if element.kind == _COMPRESSED:
            unpacked = inflated(path, element.data, room)
            room -= len(unpacked)
            held = next(_elements(unpacked, order, path))
        if held.kind == _MATRIX and held.data:
            name, array = _matrix(held.data, order, path)
            arrays[name] = array
    return arrays


def _elements(data: bytes, order: str, path: Path) -> Iterator[_Element]:
    place = 0
    while place + 8 <= len(data):
        kind, length = struct.unpack_from(order + "II", data, place)
        # Short element: the upper half of the type is the length, the rest of the tag is the data.
        if kind >> 16:
            kind, length, place = kind & 0xFFFF, kind >> 16, place + 4
            end = place + 4
        else:
            place += 8
            # Compressed elements are not padded.
            end = place + (length if kind == _COMPRESSED else length + -length % 8)
        if place + length > len(data) or place + length > end:
            raise BrokenFileError(
                f"{path}: expected {length} bytes at {place}, got {len(data) - place}; it is truncated"
            )
        yield _Element(kind=kind, data=data[place : place + length])
        place = end
    if place < len(data):
        raise BrokenFileError(f"{path}: expected whole elements, got {len(data) - place} bytes at the end")


def _matrix(data: bytes, order: str, path: Path) -> tuple[str, Any]:
    # Flags, dimensions, name, real and imaginary part; further elements belong to structures.
    parts = list(islice(_elements(data, order, path), 5))
    if len(parts) < 3 or len(parts[0].data) != 8:
        raise BrokenFileError(f"{path}: expected flags, dimensions and a name of an array, got {len(parts)} parts")
    word = struct.unpack(order + "II", parts[0].data)[0]
    shape = tuple(int(length) for length in np.frombuffer(parts[1].data, order + "i4"))
    name = parts[2].data.decode("latin-1")
    kind, complex_numbers = word & 0xFF, bool(word >> 8 & _COMPLEX)
    if kind == _CHAR and len(parts) > 3:
        part = parts[3]
        spelled = _TEXT.get(part.kind, "latin-1")
        wide = spelled in ("utf-16", "utf-32")
        return name, np.array([part.data.decode(f"{spelled}-{'le' if order == '<' else 'be'}" if wide else spelled)])
    if kind not in _CLASSES or len(parts) < 4:
        return name, np.empty(0, object)
    real = _numbers(parts[3], shape, _CLASSES[kind], order, path)
    # The imaginary part is not read; the complex type prevents use of the real part alone.
    return name, real.astype(complex) if complex_numbers else real


def _numbers(part: _Element, shape: tuple[int, ...], dtype: str, order: str, path: Path) -> NDArray[Any]:
    if part.kind not in _NUMBERS or min(shape, default=0) < 0:
        raise BrokenFileError(f"{path}: expected numbers of shape {shape}, got type {part.kind}")
    numbers = np.frombuffer(part.data, order + _NUMBERS[part.kind])
    if numbers.size != math.prod(shape):
        raise BrokenFileError(f"{path}: expected {math.prod(shape)} numbers, got {numbers.size}; it is damaged")
    return numbers.reshape(shape, order="F").astype(dtype)


def write_frames(file: BinaryIO, name: str, samples: NDArray[Any]) -> None:
    """Write float64, shape (frame, ...), as a compressed element."""
    length, shape = samples.size * 8, samples.shape
    letters = name.encode("ascii")
    parts = [
        struct.pack("=IIII", 6, 8, 6, 0),
        struct.pack("=II", 5, 4 * len(shape)) + _padded(np.array(shape, np.int32).tobytes()),
        struct.pack("=II", 1, len(letters)) + _padded(letters),
        struct.pack("=II", 9, length),
    ]
    begin, packer = file.tell(), zlib.compressobj()
    head = b"".join(parts)
    file.write(struct.pack("=II", _COMPRESSED, 0))
    file.write(packer.compress(struct.pack("=II", _MATRIX, len(head) + length) + head))
    for place in np.arange(math.prod(shape[1:])).reshape(shape[1:]).ravel(order="F"):
        file.write(packer.compress(np.ascontiguousarray(samples.reshape(len(samples), -1)[:, place]).tobytes()))
    file.write(packer.flush())
    end = file.tell()
    file.seek(begin)
    file.write(struct.pack("=II", _COMPRESSED, end - begin - 8))
    file.seek(end)


def _padded(data: bytes) -> bytes:
    return data + bytes(-len(data) % 8)


def write_mat(recording: Recording, path: Path, calibration: Calibration | None) -> tuple[FormatLoss, ...]:
    """Write a v5 file of less than 4 GiB: samples, shape (frame, row, column), rate in Hz, unit, and the header."""
    if recording.samples.nbytes >= 2**32:
        raise FileError(f"{path}: a MAT v5 array holds less than 4 GiB, got {recording.samples.nbytes}; save to .h5")
    rest = {"rate": recording.rate, "unit": recording.unit, "midair": header_of(recording)}
    with atomic_file(path) as partial:
        scipy.io.savemat(str(partial), rest, appendmat=False, do_compression=True)
        small = partial.read_bytes()
        with partial.open("wb") as file:
            file.write(small[:128])
            write_frames(file, "samples", recording.samples)
            file.write(small[128:])
    return calibration_lost(calibration, "MAT")


def read_mat(path: Path, given: ImportOptions) -> OpenedTake:
    """Read a MATLAB file of midair, or the only array of frames of another program."""
    with path.open("rb") as file:
        start = file.read(128)
    if is_mat5(start):
        return from_arrays(read_mat5(path), "MAT", path, given)
    if start.startswith(b"MATLAB 7.3"):
        return from_arrays(_version_73(path), "MAT v7.3", path, given)
    if 0 not in start[:4]:  # present in every version 4 file; SciPy's compiled reader crashes on other damaged files
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
