"""Read and write groups of HDF5 files according to the schema.

Dimensions are those of netCDF: each axis is a dataset that others refer to, so that xarray, ncdump and MATLAB find axes
and units. Files use the layout of HDF5 1.10, which has checksums of metadata; each chunk of data has the Fletcher-32 of
HDF5.
"""

from collections.abc import Generator, Mapping, Sequence
from contextlib import contextmanager
from io import FileIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, cast

import numpy as np
from rich.filesize import decimal

from midair import ram
from midair.errors import BrokenFileError, InputError, UnknownFormatError
from midair.files.atomic import atomic_file, check_disk_space, disk_errors, parse_errors, sync
from midair.files.native.schema import BLOCK, FLAGS, FORMAT, PACKED, TABLE, Entry, Kind, Made, built
from midair.streaming import LazyFrames
from midair.validation import check_finite

if TYPE_CHECKING:
    import os

    import h5py
    from typing_extensions import Buffer

LAYOUT = ("v110", "v110")
"""Oldest and newest version of the HDF5 file format in use."""


@contextmanager
def new_file(path: "str | os.PathLike[str]", *, room: int = 0, recording: bool = False) -> "Generator[h5py.File]":
    """Create an HDF5 file of about `room` bytes atomically, as `atomic_file` with `recording`."""
    with atomic_file(path, recording=recording) as partial:
        check_disk_space(partial.parent, room, path)
        with _written(partial, "w") as file:
            yield file


@contextmanager
def changed_file(path: Path) -> "Generator[h5py.File]":
    """Open an HDF5 file that nothing else has open, to add to it, without a lock; FileError if it fails."""
    with disk_errors(path, "written"):
        with _written(path, "r+") as file:
            yield file
        sync(path)


@contextmanager
def _written(path: Path, mode: Literal["w", "r+"]) -> "Generator[h5py.File]":
    import h5py

    with _RetryingFile(path, mode) as output:
        try:
            with h5py.File(output, mode, libver=LAYOUT) as file:
                yield file
        finally:
            if output.refused is not None:
                raise output.refused  # the error of the disk, not that of HDF5


@contextmanager
def open_hdf5(path: Path) -> "Generator[h5py.File]":
    """Open an HDF5 file of any program to read, without a lock."""
    import h5py

    try:
        file = h5py.File(path, "r", locking=False)
    except OSError as wrong:
        if "truncated file" in str(wrong):
            raise BrokenFileError("damaged, its end is missing; use a copy") from wrong
        # HDF5 opens a file twice in a program only with the same locks; xarray and h5netcdf open it with HDF5's own.
        if "file locking" not in str(wrong):
            raise
        file = h5py.File(path, "r")
    with file:
        yield file


def write_group(group: "h5py.Group", kind: Kind, values: Mapping[str, Any], *, frames: int | None = None) -> None:
    """Write the values that the schema lists for `kind`; coordinates first, because other datasets refer to them.

    An axis without coordinates counts from 0, and time from 0 s. With `frames`, values per frame have room for so many;
    `write_frames` writes those that come later.
    """
    lengths = {
        axis: length
        for entry in TABLE[kind]
        if entry.name in values
        for axis, length in zip(entry.dimensions or (), np.shape(values[entry.name]), strict=True)
    }
    counted = [entry.name for entry in TABLE[kind] if entry.counts and entry.name in lengths]
    values = {**{axis: np.arange(lengths[axis]) for axis in counted}, **values}
    if "rate_hz" in values:
        values["time"] = np.arange(frames or lengths["time"]) / values["rate_hz"]
    entries = [entry for entry in TABLE[kind] if entry.name in values]
    unit = str(values.get("unit", ""))
    for entry in entries:
        if entry.dimensions is None:
            value = values[entry.name]
            group.attrs[entry.name] = fixed_text(value) if entry.dtype == "text" else np.dtype(entry.dtype).type(value)
    for entry in sorted(entries, key=lambda entry: not entry.coordinate):
        if entry.dimensions is not None:
            _create(group, entry, values[entry.name], entry.unit.format(unit=unit), frames)


def write_frames(group: "h5py.Group", values: Mapping[str, np.ndarray], first: int) -> None:
    """Write values of some frames, from frame `first` on."""
    for name, block in values.items():
        _put(stored_dataset(group, name), first, block)


def read_group(group: "h5py.Group", kind: Kind, path: Path, *, streamed: bool = False) -> dict[str, Any]:
    """Read the values that the schema lists for `kind`, and check types, axes, units, lengths and times.

    With `streamed`, datasets with several numbers per frame are lazy. Raises InputError if the others do not fit into
    memory, with the length that would.
    """
    check_kind(group, kind)
    present = _present(group, kind)
    values = {entry.name: _attribute(group, entry) for entry in present if entry.dimensions is None}
    stored = [entry for entry in present if entry.dimensions is not None]
    if "rate_hz" in values and not streamed:
        _check_fits([stored_dataset(group, entry.name) for entry in stored], values["rate_hz"])
    for entry in stored:
        unit = entry.unit.format(unit=values.get("unit", ""))
        values[entry.name] = _dataset(group, entry, unit, path, streamed=streamed)
    _check_lengths(stored, values)
    if "rate_hz" in values:
        _check_time(values["time"], values["rate_hz"])
    return values


def read_part(file: "h5py.File", kind: Kind, made: type[Made], path: Path) -> Made | None:
    """The object in a file of its own kind or in a group of another; None if there is no such group."""
    if kind_of(file) != f"midair {kind}" and kind not in file:
        return None
    group = file if kind_of(file) == f"midair {kind}" else cast("h5py.Group", file[kind])
    return built(made, kind, read_group(group, kind, path))


def _check_fits(datasets: "Sequence[h5py.Dataset]", rate: float) -> None:
    # Reading keeps the numbers as stored, as float64, and as a checked copy.
    needed, free = 24 * max(int(np.prod(each.shape, dtype=np.int64)) for each in datasets), ram.available_memory()
    if free is not None and needed > free:
        seconds = max(_shape(each)[0] for each in datasets) / rate
        raise InputError(
            f"expected {decimal(needed)} of free memory for {seconds:.4g} s at {rate:g} Hz, got "
            f"{decimal(free)}; {seconds * free / needed:.3g} s would fit: take a part of it, or a lower rate"
        )


def _check_time(time: np.ndarray, rate: float) -> None:
    """Raise BrokenFileError if a time differs from frame / rate by more than a thousandth of a frame."""
    right = np.abs(time * rate - np.arange(len(time))) < 1e-3
    if not right.all():
        wrong = int(np.argmin(right))
        raise BrokenFileError(
            f"expected frame i at i / {rate:g} Hz, got frame {wrong} at {time[wrong]:g} s; the file is damaged "
            "or its rate was edited"
        )


def check_kind(group: "h5py.Group", kind: Kind) -> None:
    """Raise if `group` is of another kind than `kind`, or was written by a newer midair."""
    have = kind_of(group)
    if have != f"midair {kind}":
        advice = "; solve it first (midair solve)" if (kind, have) == ("drive", "midair recording") else ""
        found = have or "an HDF5 file of another program"
        raise BrokenFileError(f"expected a midair {kind}, got {found}{advice}")
    version = group.attrs.get("format")
    if not isinstance(version, int | np.integer) or version < 1:
        raise BrokenFileError(f"expected a whole number from 1 on as format, got {version!r}")
    if version > FORMAT:
        raise UnknownFormatError(f"expected format {FORMAT}, got {version}, of a newer midair; update midair")


def stored_dataset(group: "h5py.Group", name: str) -> "h5py.Dataset":
    """The dataset `name` of a group; raises BrokenFileError if there is none."""
    import h5py

    item: Any = group.get(name)
    if not isinstance(item, h5py.Dataset):
        raise BrokenFileError(f"expected a dataset {name}, got {'nothing' if item is None else item!r}")
    return item


def plain_text(value: object) -> str:
    """A text attribute as str; empty for anything else."""
    if isinstance(value, bytes):
        return value.decode("utf-8", "replace")
    return value if isinstance(value, str) else ""


def kind_of(group: "h5py.Group") -> str:
    """The kind of a group, such as "midair recording"; empty if not stated."""
    return plain_text(group.attrs.get("kind"))


def _create(group: "h5py.Group", entry: Entry, value: Any, unit: str, frames: int | None) -> None:
    # float32 data are stored as such where the schema allows it; all others in the type of the schema.
    data = np.asarray(value)
    kind = np.dtype("f4" if entry.single and data.dtype == "f4" else entry.dtype)
    axes, shape = entry.dimensions or (), data.shape
    if frames is not None and axes[:1] == ("time",):
        shape = (frames, *shape[1:])
    row = int(np.prod(shape[1:], dtype=int)) * kind.itemsize
    chunk = (max(1, min(shape[0], BLOCK if entry.packed else 65536 // max(row, 1))), *shape[1:])
    if entry.packed:
        # Neighbours in time are alike, so deflate needs a quarter less for numbers that lie side by side in time.
        shape, chunk, axes = shape[::-1], chunk[::-1], axes[::-1]
    dataset = group.create_dataset(
        entry.name,
        shape=shape,
        dtype=kind,
        chunks=chunk,
        fletcher32=True,
        shuffle=entry.packed and kind.itemsize > 1,
        compression=1 if entry.packed else None,
    )
    _put(dataset, 0, data)
    dataset.attrs["units"] = fixed_text(unit)
    dataset.attrs["long_name"] = fixed_text(entry.what)
    if names := FLAGS.get(entry.name):  # as in the CF conventions
        dataset.attrs["flag_values"] = np.arange(len(names), dtype="i1")
        dataset.attrs["flag_meanings"] = fixed_text(" ".join(names))
    if entry.coordinate:
        dataset.make_scale(entry.name)
        return
    if axes[-2:] == ("row", "column"):
        dataset.attrs["coordinates"] = fixed_text("y x")
    for index, axis in enumerate(axes):
        dataset.dims[index].attach_scale(group[axis])


def fixed_text(value: str) -> Any:
    """`value` as text of fixed length, which the checksums of metadata cover, unlike text of variable length."""
    import h5py

    try:
        encoded = value.encode()
    except UnicodeEncodeError as wrong:
        raise InputError(f"expected text that UTF-8 can hold, got {value!r}") from wrong
    if b"\0" in encoded:
        raise InputError(f"expected text without a null character, got {value!r}")
    return np.array(encoded, h5py.string_dtype("utf-8", max(1, len(encoded))))


def _present(group: "h5py.Group", kind: Kind) -> list[Entry]:
    """Entries of a group; raises if a required one is missing, or one of an optional part whose others are there."""
    present = [entry for entry in TABLE[kind] if entry.name in (group.attrs if entry.dimensions is None else group)]
    beside = {entry.part: entry for entry in reversed(present) if entry.part}
    for entry in TABLE[kind]:
        if entry in present:
            continue
        if entry.required:
            raise BrokenFileError(f"expected {entry.name} in a midair {kind}, found none; the file is damaged")
        if entry.part in beside and not beside[entry.part].required:
            other = beside[entry.part].name
            raise BrokenFileError(f"expected {entry.name} beside {other}, found none; the file is damaged")
    return present


def _attribute(group: "h5py.Group", entry: Entry) -> Any:
    value = group.attrs[entry.name]
    if entry.dtype == "text" and isinstance(value, bytes | str):
        return plain_text(value)
    if isinstance(value, np.generic) and value.dtype == entry.dtype and np.isfinite(value):
        return value.item()
    raise BrokenFileError(f"expected {entry.name} to be finite {entry.dtype}, got {value!r}")


def _dataset(group: "h5py.Group", entry: Entry, unit: str, path: Path, *, streamed: bool) -> "np.ndarray | LazyFrames":
    dataset = stored_dataset(group, entry.name)
    axes = entry.dimensions or ()
    stored = axes[::-1] if entry.packed else axes
    spelled = f"{entry.name}: expected {entry.dtype} with axes ({', '.join(stored)}) in {unit}"
    single = entry.single and dataset.dtype == np.dtype("f4")
    if not (single or dataset.dtype == np.dtype(entry.dtype)) or dataset.ndim != len(axes):
        raise BrokenFileError(f"{spelled}, got {dataset!r}")
    have = plain_text(dataset.attrs.get("units"))
    if have != unit:
        raise BrokenFileError(f"{spelled}, got {have!r} as unit")
    if streamed and axes[:1] == ("time",) and len(axes) > 1:
        return _lazy_dataset(dataset, path)
    values = _rows(dataset, 0, _shape(dataset)[0]).astype("f8" if single else dataset.dtype, copy=False)
    names = FLAGS.get(entry.name)
    if names and values.size and not 0 <= values.min() <= values.max() < len(names):
        raise BrokenFileError(f"expected {entry.name} 0 to {len(names) - 1}, got {values.min()} to {values.max()}")
    return values


def _turned(dataset: "h5py.Dataset") -> bool:
    """Whether its time is the last axis."""
    return str(dataset.name).rpartition("/")[2] in PACKED


def _put(dataset: "h5py.Dataset", first: int, rows: np.ndarray) -> None:
    """Write rows of a dataset from row `first` on."""
    if _turned(dataset):
        dataset[:, first : first + len(rows)] = rows.T
    else:
        dataset[first : first + len(rows)] = rows


def _shape(dataset: "h5py.Dataset") -> tuple[int, ...]:
    """Shape of a dataset with its time first."""
    return dataset.shape[::-1] if _turned(dataset) else dataset.shape


def _rows(dataset: "h5py.Dataset", first: int, last: int) -> np.ndarray:
    try:
        return dataset[:, first:last].T if _turned(dataset) else dataset[first:last]
    except OSError as wrong:
        if wrong.errno:
            raise
        raise BrokenFileError(f"{dataset.name}: damaged, its checksum does not match; use a copy") from wrong


def _lazy_dataset(dataset: "h5py.Dataset", path: Path) -> LazyFrames:
    """Lazy frames of a dataset, whose file is opened and whose numbers are checked for each read."""
    name, number = str(dataset.name), path.stat().st_ino

    def reopened(first: int, last: int) -> np.ndarray:
        with parse_errors(path, "the original file"), open_hdf5(path) as opened:
            if path.stat().st_ino != number:
                raise BrokenFileError("expected the original file, got a new one of that name; open it again")
            rows = _rows(stored_dataset(opened, name), first, last).astype(np.float64)
            check_finite(rows, name.removeprefix("/"), frame=first)
            return rows

    return LazyFrames(reopened, _shape(dataset))


def _check_lengths(entries: list[Entry], values: Mapping[str, Any]) -> None:
    lengths: dict[str, int] = {}
    for entry in entries:
        for axis, length in zip(entry.dimensions or (), values[entry.name].shape, strict=True):
            if lengths.setdefault(axis, length) != length:
                raise BrokenFileError(
                    f"{entry.name}: expected {lengths[axis]} along {axis}, got {length}; the file is damaged"
                )


class _RetryingFile(FileIO):
    """A file that accepts all data but writes nothing after the first disk error, which is `refused`."""

    # HDF5 crashes when a write fails.
    def __init__(self, path: Path, mode: Literal["w", "r+"]) -> None:
        super().__init__(path, "w+" if mode == "w" else mode)
        self.refused: OSError | None = None

    def write(self, data: "Buffer", /) -> int:
        """Write all data, or store the error."""
        view = memoryview(data).cast("B")
        left = view if self.refused is None else view[:0]
        try:
            while len(left):
                # The system may write only a part of a large block.
                left = left[super().write(left) or 0 :]
        except OSError as wrong:
            self.refused = wrong
        return len(view)

    def truncate(self, size: int | None = None, /) -> int:
        """Set the length, or store the error."""
        try:
            return super().truncate(size)
        except OSError as wrong:
            self.refused = self.refused or wrong
            return size or 0
