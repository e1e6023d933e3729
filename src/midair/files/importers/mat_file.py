"""MATLAB and NumPy files: the only array of frames, or `samples`, beside `rate` and `unit`.

SciPy reads and writes MATLAB's versions 4 to 7; version 7.3 is HDF5. Fields of structs and cells are arrays with a path
as name, S.data or trials.0. A number fs, srate or the like beside the array is its rate, a vector of times its stamps.
"""

import zipfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from midair.errors import BrokenFileError, FileError, MismatchError, ShapeError
from midair.files.atomic import atomic_file, reason
from midair.files.importers.text_table import WORDS
from midair.files.native.hdf5 import open_hdf5
from midair.files.opened_take import Format, FormatLoss, ImportedData, ImportOptions
from midair.files.size_limits import check_expansion
from midair.model import Recording, SensorGrid
from midair.recordings import is_clock


def from_arrays(arrays: Mapping[str, Any], form: str, given: ImportOptions) -> ImportedData:
    """The recording in the only one of named arrays that can hold frames, or in the array `field`."""
    flat = dict(_flattened(arrays))
    name = _chosen(flat, given)
    samples, report = _time_first(np.asarray(flat[name], np.float64), name, given)
    # A neighbour in the same struct is nearer than one beside the struct.
    folder, _, _ = name.rpartition(".")
    near: dict[str, NDArray[Any]] = {}
    for place in ("", folder):
        near |= {
            key.rpartition(".")[2]: np.ravel(each) for key, each in flat.items() if key.rpartition(".")[0] == place
        }
    facts = {key.lower().replace("_", ""): each for key, each in near.items() if each.size == 1}
    rates = {float(each[0]) for key, each in facts.items() if key in WORDS["rates"] and each.dtype.kind in "fiu"}
    if len(rates) > 1:
        raise MismatchError(f"expected one rate, got {', '.join(f'{rate:g} Hz' for rate in sorted(rates))}")
    rate = next(iter(rates), None)
    clocks = {key: each for key, each in near.items() if is_clock(key) and each.size == len(samples)}
    clock, stamps = next(iter(clocks.items()), ("time [s]", None))
    if stamps is not None and stamps.dtype.kind in "mM":
        clock, stamps = "time [s]", (stamps - stamps[0]) / np.timedelta64(1, "s")
    units = [str(facts[key][0]) for key in ("unit", "units") if key in facts and facts[key].dtype.kind == "U"]
    return ImportedData(
        samples=samples,
        form=form,
        rate=rate if stamps is None else None,
        stamps=stamps,
        clock=clock,
        nominal=rate,
        units=tuple(units[:1]) * int(np.prod(samples.shape[1:])),
        settings={"array": name},
        simulated=bool(near.get("simulated", np.zeros(1)).any()),
        report=report,
    )


def _flattened(value: Any, name: str = "") -> Iterator[tuple[str, Any]]:
    """Arrays, numbers and texts of nested structs and cells, with paths as names."""
    if isinstance(value, np.ndarray) and value.dtype == object:
        value = list(value.flat)
    if isinstance(value, Mapping):
        inside = [(str(key), each) for key, each in value.items()]
    elif isinstance(value, list):
        inside = [(str(key), each) for key, each in enumerate(value)]
    else:
        yield name, value
        return
    for key, each in inside:
        yield from _flattened(each, f"{name}.{key}" if name else key)


def _chosen(arrays: Mapping[str, Any], given: ImportOptions) -> str:
    """Name of the array of frames: the chosen one, or "samples" or "data", or the only one."""
    numbers = {name: each for name, each in arrays.items() if isinstance(each, np.ndarray) and each.dtype.kind in "fiu"}
    names = [name for name, array in numbers.items() if array.ndim in (1, 2, 3) and array.size > 1]
    found = ", ".join(f"{name} {np.shape(array)}" for name, array in list(arrays.items())[:12]) or "nothing"
    if given.field is not None:
        if given.field not in names:
            raise MismatchError(f"expected an array of frames called {given.field!r}, got {found}")
        return given.field
    names = [name for name in names if not is_clock(name.rpartition(".")[2])] or names
    usual = [[name for name in names if name.rpartition(".")[2] == each] for each in ("samples", "data")]
    for only in (*usual, [name for name in names if numbers[name].ndim > 1], names):
        if len(only) == 1:
            return only[0]
    raise BrokenFileError(
        f"expected one array of numbers, or one called samples or data, or its name as field, got {found}"
    )


def _time_first(
    samples: NDArray[np.float64], name: str, given: ImportOptions
) -> tuple[NDArray[np.float64], tuple[str, ...]]:
    """Samples with the axis of time first: the one beside which the layout fits, or else the longer one."""
    shape = samples.shape
    if samples.ndim == 1 or samples.size == max(shape):
        return samples.reshape(-1, 1), (f"Array {name} {shape} was taken as one channel of {samples.size} frames.",)
    sensor = given.sensor or SensorGrid()
    wanted = (sensor.count,) if samples.ndim == 2 else sensor.shape
    fits = [axis for axis, rest in ((0, shape[1:]), (-1, shape[:-1])) if rest == wanted]
    if len(fits) != 1 and not given.transpose:
        if shape[0] == shape[-1]:
            raise ShapeError(
                f"expected an array with one longest axis, got {name} {shape}, whose first or last may be time",
                parameters={"transpose": "transpose=True for the last", "sensor": "sensor=SensorGrid(...)"},
            )
        fits = [0 if shape[0] > shape[-1] else -1]
    if not given.transpose and fits[0] == 0:
        return samples, ()
    moved = np.moveaxis(samples, -1, 0)
    return moved, (f"Array {name} {shape} was turned: its last axis is time, {len(moved)} frames.",)


def read_npy(path: Path, given: ImportOptions) -> ImportedData:
    """Read an array of frames, which has no other information; objects are not loaded, because they could run code."""
    # Mapped, because NumPy would allocate what a damaged header announces.
    array = np.load(path, mmap_mode="r", allow_pickle=False)
    return from_arrays({path.stem: array}, "NPY", given)


NPY = Format(name="NPY", read=read_npy, memory=2)


def _content(recording: Recording) -> dict[str, Any]:
    content = {"samples": recording.samples, "rate": recording.rate, "unit": recording.unit}
    return {**content, "simulated": recording.provenance.simulated}


def write_npz(recording: Recording, path: Path) -> tuple[FormatLoss, ...]:
    """Write the samples, shape (frame, row, column), their rate in Hz and unit, and whether they are simulated."""
    with atomic_file(path) as partial, partial.open("wb") as file:
        np.savez(file, **_content(recording))
    return ()


def read_npz(path: Path, given: ImportOptions) -> ImportedData:
    """Read an archive of arrays; objects could run code and are not loaded."""
    arrays: dict[str, Any] = {}
    with zipfile.ZipFile(path) as packed:
        # At most the stated size of a member is read.
        check_expansion(path, sum(member.file_size for member in packed.infolist()))
    with path.open("rb") as file, np.load(file, allow_pickle=False) as archive:
        for name in archive.files:
            arrays[name] = archive[name]
    return from_arrays(arrays, "NPZ", given)


NPZ = Format(name="NPZ", read=read_npz, write=write_npz, memory=3)


def write_mat(recording: Recording, path: Path) -> tuple[FormatLoss, ...]:
    """Write a v5 file of less than 4 GiB, with the content of `write_npz`."""
    if recording.samples.nbytes >= 2**32:
        raise FileError(f"{path}: a MAT v5 array holds less than 4 GiB, got {recording.samples.nbytes}; save to .h5")
    with atomic_file(path) as partial:
        scipy.io.savemat(str(partial), _content(recording), appendmat=False, do_compression=True)
    return ()


def read_mat(path: Path, given: ImportOptions) -> ImportedData:
    """Read a MATLAB file."""
    with path.open("rb") as file:
        start = file.read(128)
    if start.startswith(b"MATLAB 7.3"):
        return from_arrays(_version_73(path), "MAT v7.3", given)
    # A file of version 4 has a 0 in its first four bytes; SciPy crashes on some other files.
    if start[124:128] not in (b"\x00\x01IM", b"\x01\x00MI") and 0 not in start[:4]:
        raise BrokenFileError(f"expected a MATLAB file, got one that begins with {start[:12].decode('latin-1')!r}")
    try:
        arrays: dict[str, Any] = scipy.io.loadmat(str(path), appendmat=False, simplify_cells=True)
    except scipy.io.matlab.MatReadError as wrong:
        raise BrokenFileError(f"expected a MATLAB file, got other bytes ({reason(wrong)})") from wrong
    return from_arrays({name: array for name, array in arrays.items() if not name.startswith("__")}, "MAT", given)


def _version_73(path: Path) -> dict[str, Any]:
    """Numeric arrays in an HDF5 file of MATLAB, which reverses their axes."""
    import h5py

    with open_hdf5(path) as file:
        found: dict[str, Any] = {}

        def visit(name: str, item: object) -> None:
            if isinstance(item, h5py.Dataset) and item.dtype.kind in "fiu" and not name.startswith("#refs#"):
                found[name.replace("/", ".")] = np.transpose(item[()])

        file.visititems(visit)
        return found


MAT = Format(name="MAT", read=read_mat, write=write_mat, memory=3)
