"""Read and write groups of HDF5 files according to the schema.

Dimensions are those of netCDF: each axis is a dataset that others refer to, so that xarray, ncdump and MATLAB find axes
and units. Files use the layout of HDF5 1.10, which has checksums of metadata and supports a reader beside a writer
(SWMR); `checksums` describes those of data.
"""

from collections.abc import Callable, Generator, Mapping
from contextlib import contextmanager
from datetime import UTC, datetime
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import NDArray

from midair.errors import BrokenFileError, InputError, UnknownFormatError
from midair.files.atomic import atomic_file, check_disk_space, existing_file, parse_errors
from midair.files.native.checksums import Ranges, create_checksums, damage_text, read_rows
from midair.files.native.hdf5_recovery import RetryingFile, is_unclosed, openable
from midair.files.native.inspection import get_ready, inspect
from midair.files.native.provenance_json import to_json
from midair.files.native.schema import BLOCK, FORMAT, TABLE, Entry, Kind
from midair.streaming import LazyFrames, block_ranges
from midair.validation import check_finite
from midair.version import __version__

if TYPE_CHECKING:
    import os

    import h5py

    from midair.model import Provenance

LAYOUT = ("v110", "v110")
"""Oldest and newest version of the HDF5 file format in use."""

ADVICE: Mapping[Kind, str] = {
    **dict.fromkeys(("recording", "pressure", "played", "drive"), "midair repair keeps the rest"),
    **dict.fromkeys(("calibration", "array"), "copy the file again, or measure again"),
}
"""What to do about damage in each kind of group."""

GROWING = ("time", "event", "stage")
"""Axes that grow during a recording."""


@contextmanager
def new_file(path: "str | os.PathLike[str]", *, room: int = 0) -> "Generator[h5py.File]":
    """Create an HDF5 file of about `room` bytes atomically: it gets its name when the block succeeds."""
    import h5py

    with atomic_file(path) as partial:
        check_disk_space(partial.parent, room, path)
        with RetryingFile(partial) as output:
            try:
                with h5py.File(output, "w", libver=LAYOUT) as file:
                    yield file
            finally:
                # Raises the original disk error instead of the one from HDF5.
                output.check()


@contextmanager
def open_file(path: "str | os.PathLike[str]") -> "Generator[h5py.File]":
    """Open an HDF5 file to read, also while it is being recorded or after its writer was killed."""
    file = existing_file(path)
    with parse_errors(file, "an HDF5 file of midair"):
        if not begins_as_hdf5(file):
            raise BrokenFileError(f"{file}: expected an HDF5 file of midair, got other bytes; copy it again")
        with open_plain(file) as opened:
            yield opened


@contextmanager
def open_plain(path: Path) -> "Generator[h5py.File]":
    """Open an HDF5 file of any program, without a lock, after the inspector has found it safe to read."""
    get_ready(path)
    inspect(path)
    with opened_for_reading(path) as file:
        yield file


def opened_for_reading(path: Path) -> "h5py.File":
    """A file without a lock; with HDF5's own if this program has it open with that, as xarray and h5netcdf do.

    HDF5 opens a file twice in a program only with the same locks.
    """
    import h5py

    try:
        return h5py.File(openable(path), "r", locking=False)
    except OSError as wrong:
        if "file locking" not in str(wrong):
            raise
        return h5py.File(openable(path), "r")


def begins_as_hdf5(path: Path) -> bool:
    """True if a file has the signature of HDF5 at an allowed offset: 0, 512, 1024, 2048 ..."""
    size, place = path.stat().st_size, 0
    with path.open("rb") as file:
        while place < size:
            file.seek(place)
            if file.read(8) == b"\x89HDF\r\n\x1a\n":
                return True
            place = max(512, 2 * place)
    return False


def signature(kind: Kind, provenance: "Provenance") -> dict[str, Any]:
    """Attributes that every file and group has."""
    return {
        "kind": f"midair {kind}",
        "format": FORMAT,
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "created_by": f"midair {__version__}",
        "provenance": to_json(provenance),
    }


def write_group(group: "h5py.Group", kind: Kind, values: Mapping[str, Any], *, live: bool = False) -> None:
    """Write the values that the schema lists for `kind`; coordinates first, because other datasets refer to them.

    With `live`, the axes time, event and stage can grow, and unwritten numbers are NaN.
    """
    values = {**values, **_digests(kind, values)}
    entries = [entry for entry in TABLE[kind] if entry.name in values]
    unit = str(values.get("unit", ""))
    for entry in entries:
        if entry.dimensions is None:
            value = values[entry.name]
            group.attrs[entry.name] = fixed_text(value) if entry.dtype == "text" else np.dtype(entry.dtype).type(value)
    for entry in sorted(entries, key=lambda entry: not entry.coordinate):
        if entry.dimensions is not None:
            _create(group, entry, values[entry.name], entry.unit.format(unit=unit), live=live)


def read_group(
    group: "h5py.Group",
    kind: Kind,
    path: Path,
    *,
    live: bool = False,
    streamed: bool = False,
    damage: dict[str, Ranges] | None = None,
) -> dict[str, Any]:
    """Read the values that the schema lists for `kind`, and check types, axes, units, lengths and checksums.

    With `live`, values along time, event or stage are cut to the shortest, because a writer may be between two
    datasets. With `streamed`, times and datasets with several numbers per frame are lazy. With `damage`, damaged rows
    are NaN or 0 and listed there by name, instead of raising BrokenFileError.
    """
    check_kind(group, kind, path)
    present = _present(group, kind, path)
    values = {entry.name: _attribute(group, entry, path) for entry in present if entry.dimensions is None}
    for name, digest in _digests(kind, values).items():
        if values.get(name, digest) != digest:
            of = name.removesuffix("_digest")
            if damage is None:
                raise BrokenFileError(f"{path}: {of}: damaged or edited, its SHA-256 does not match; {ADVICE[kind]}")
            damage[of] = ()
    stored = [entry for entry in present if entry.dimensions is not None]
    for entry in stored:
        unit = entry.unit.format(unit=values.get("unit", ""))
        values[entry.name] = _dataset(group, entry, unit, path, ADVICE[kind], streamed=streamed, damage=damage)
    for axis in GROWING if live else ():
        along = [entry.name for entry in stored if axis in (entry.dimensions or ())]
        shortest = min((len(values[name]) for name in along), default=0)
        values |= {name: values[name][:shortest] for name in along}
    _check_lengths(stored, values, path)
    return values


def check_kind(group: "h5py.Group", kind: Kind, path: Path) -> None:
    """Raise if `group` is of another kind than `kind`, or was written by a newer midair."""
    have = kind_of(group)
    if have != f"midair {kind}":
        advice = "; solve it first (midair solve)" if (kind, have) == ("drive", "midair recording") else ""
        found = have or "an HDF5 file of another program"
        raise BrokenFileError(f"{path}: expected a midair {kind}, got {found}{advice}")
    check_format(group.attrs.get("format"), path)


def check_format(version: object, path: Path) -> None:
    """Raise unless a file states a version of the schema that this program reads."""
    if not isinstance(version, int | np.integer) or version < 1:
        raise BrokenFileError(f"{path}: expected a whole number from 1 on as format, got {version!r}")
    if version > FORMAT:
        raise UnknownFormatError(f"{path}: expected format {FORMAT}, got {version}, of a newer midair; update midair")


def stored_dataset(group: "h5py.Group", name: str) -> "h5py.Dataset":
    """The dataset `name` of a group; raises BrokenFileError if there is none."""
    import h5py

    item = group.get(name)
    if not isinstance(item, h5py.Dataset):
        raise BrokenFileError(f"expected a dataset {name}, got {'nothing' if item is None else item!r}")
    return item


def stored_group(group: "h5py.Group", name: str) -> "h5py.Group":
    """The group `name` in a group; raises BrokenFileError if there is none."""
    import h5py

    item = group.get(name)
    if not isinstance(item, h5py.Group):
        raise BrokenFileError(f"expected a group {name}, got {'nothing' if item is None else item!r}")
    return item


def plain_text(value: object) -> str:
    """A text attribute as str; empty for anything else."""
    if isinstance(value, bytes):
        return value.decode("utf-8", "replace")
    return value if isinstance(value, str) else ""


def kind_of(group: "h5py.Group") -> str:
    """The kind of a group, such as "midair recording"; empty if not stated."""
    return plain_text(group.attrs.get("kind"))


def _create(group: "h5py.Group", entry: Entry, value: Any, unit: str, *, live: bool) -> None:
    # float32 data are stored as such where the schema allows it; all others in the type of the schema.
    data = value if isinstance(value, LazyFrames) else np.asarray(value)
    single = entry.single and (data.stored if isinstance(data, LazyFrames) else data.dtype) == "f4"
    kind = np.dtype("f4" if single else entry.dtype)
    axes = entry.dimensions or ()
    grows = live and bool(axes) and axes[0] in GROWING
    chunk = _chunk(data.shape, kind.itemsize, frames=256 if grows else min(BLOCK, len(data)) if entry.packed else 0)
    dataset = group.create_dataset(
        entry.name,
        shape=data.shape,
        dtype=kind,
        data=None if isinstance(data, LazyFrames) else data.astype(kind),
        maxshape=tuple(None if axis in GROWING else have for axis, have in zip(axes, data.shape, strict=True))
        if grows
        else None,
        chunks=chunk,
        fletcher32=None if grows or not data.ndim else True,
        shuffle=entry.packed and kind.itemsize > 1,
        compression=1 if entry.packed else None,
        fillvalue=np.nan if kind.kind == "f" else None,
    )
    if grows:
        create_checksums(dataset)
    if isinstance(data, LazyFrames) and chunk is not None:
        _fill(dataset, data, chunk[0])
    dataset.attrs["units"] = fixed_text(unit)
    dataset.attrs["long_name"] = fixed_text(entry.what)
    if entry.coordinate:
        dataset.make_scale(entry.name)
        return
    if axes[-2:] == ("row", "column"):
        dataset.attrs["coordinates"] = fixed_text("y x")
    for index, axis in enumerate(axes):
        dataset.dims[index].attach_scale(group[axis])


def _fill(dataset: "h5py.Dataset", frames: LazyFrames, chunk: int) -> None:
    """Write lazy frames in whole chunks, because HDF5 reads back a chunk that is written twice."""
    size = next(last for _, last in block_ranges(frames.shape))
    size = max(chunk, size // chunk * chunk)
    first = 0
    for block in frames.blocks(size):
        dataset[first : first + len(block)] = block
        first += len(block)


def _chunk(shape: tuple[int, ...], itemsize: int, *, frames: int) -> tuple[int, ...] | None:
    """Chunks of this number of frames; of about 64 kB along the first axis for 0."""
    if not shape:
        return None
    row = int(np.prod(shape[1:], dtype=int)) * itemsize
    return (frames or max(1, min(shape[0], 65536 // max(row, 1))), *shape[1:])


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


def _present(group: "h5py.Group", kind: Kind, path: Path) -> list[Entry]:
    present: list[Entry] = []
    for entry in TABLE[kind]:
        if entry.name in (group.attrs if entry.dimensions is None else group):
            present.append(entry)
        elif entry.required:
            raise BrokenFileError(f"{path}: expected {entry.name} in a midair {kind}, found none; the file is damaged")
    return present


def _attribute(group: "h5py.Group", entry: Entry, path: Path) -> Any:
    value = group.attrs[entry.name]
    if entry.dtype == "text":
        if isinstance(value, bytes):
            return value.decode()
        if isinstance(value, str):
            return value
    elif isinstance(value, np.generic) and value.dtype == entry.dtype and np.isfinite(value):
        return value.item()
    raise BrokenFileError(f"{path}: expected {entry.name} to be finite {entry.dtype}, got {value!r}")


def _dataset(
    group: "h5py.Group",
    entry: Entry,
    unit: str,
    path: Path,
    advice: str,
    *,
    streamed: bool,
    damage: dict[str, Ranges] | None,
) -> "np.ndarray | LazyFrames":
    dataset = stored_dataset(group, entry.name)
    axes = entry.dimensions or ()
    spelled = f"{entry.name}: expected {entry.dtype} with axes ({', '.join(axes)}) in {unit}"
    single = entry.single and dataset.dtype == np.dtype("f4")
    if not (single or dataset.dtype == np.dtype(entry.dtype)) or dataset.ndim != len(axes):
        raise BrokenFileError(f"{path}: {spelled}, got {dataset!r}")
    have = plain_text(dataset.attrs.get("units"))
    if have != unit:
        raise BrokenFileError(f"{path}: {spelled}, got {have!r} as unit")
    if not axes:
        return dataset[()]
    kind = np.dtype("f8") if single else dataset.dtype

    def read(dataset: "h5py.Dataset", first: int, last: int) -> np.ndarray:
        rows, damaged = read_rows(dataset, first, last, closed=not is_unclosed(path))
        if damaged and damage is None:
            raise BrokenFileError(f"{path}: {damage_text(dataset, axes, damaged)}; {advice}")
        if damaged and damage is not None:
            damage[entry.name] = (*damage.get(entry.name, ()), *damaged)
        return rows.astype(kind, copy=False)

    if streamed and axes[0] == "time" and (len(axes) > 1 or entry.coordinate):
        if damage is not None:
            for first, last in block_ranges(dataset.shape):
                read(dataset, first, last)
            damage = dict(damage)  # the same rows are read again
        return _lazy_dataset(dataset, path, read)
    return read(dataset, 0, len(dataset))


def _lazy_dataset(
    dataset: "h5py.Dataset", path: Path, read: "Callable[[h5py.Dataset, int, int], np.ndarray]"
) -> LazyFrames:
    """Lazy frames of a dataset, whose file is opened for each read."""
    name, number = str(dataset.name), path.stat().st_ino

    def reopened(first: int, last: int) -> np.ndarray:
        # The path may be that of a new file by now, which has not been inspected.
        with parse_errors(path, "the original file"), opened_for_reading(path) as opened:
            if path.stat().st_ino != number:
                raise BrokenFileError(f"{path}: expected the original file, got a new one of that name; open it again")
            return read(stored_dataset(opened, name), first, last).astype(np.float64)

    return LazyFrames(reopened, dataset.shape, stored="f4" if dataset.dtype == np.dtype("f4") else "f8")


def finite(x: "np.ndarray | LazyFrames", name: str) -> "NDArray[np.float64]":
    """Lazy frames that raise NonFiniteError for non-finite numbers when read; an array unchanged."""
    if not isinstance(x, LazyFrames):
        return x

    def read(first: int, last: int) -> np.ndarray:
        block = x.read(first, last)
        check_finite(block, name, frame=first)
        return block

    # Type checkers treat lazy frames as an array.
    return cast("NDArray[np.float64]", LazyFrames(read, x.shape, stored=x.stored))


def _digests(kind: Kind, values: Mapping[str, Any]) -> dict[str, str]:
    names = [entry.name for entry in TABLE[kind] if entry.name.endswith("_digest")]
    known = {name: values[name.removesuffix("_digest")] for name in names if name.removesuffix("_digest") in values}
    return {name: sha256(text.encode(errors="surrogatepass")).hexdigest() for name, text in known.items()}


def _check_lengths(entries: list[Entry], values: Mapping[str, Any], path: Path) -> None:
    lengths: dict[str, int] = {}
    for entry in entries:
        for axis, length in zip(entry.dimensions or (), values[entry.name].shape, strict=True):
            if lengths.setdefault(axis, length) != length:
                raise BrokenFileError(
                    f"{path}: {entry.name}: expected {lengths[axis]} along {axis}, got {length}; the file is damaged"
                )
