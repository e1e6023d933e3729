"""Groups of an HDF5 file, written and checked by the table of names.

Dimensions are netCDF's: each axis is a dataset of its own name that the others refer to, so that xarray, ncdump and
MATLAB find axes and units. The files use the layout of HDF5 1.10, whose metadata carry checksums and which allows a
reader beside a writer (SWMR); numbers of finished files carry a checksum of their own (Fletcher-32).
"""

from collections.abc import Generator, Mapping
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from midair.errors import BrokenFileError, InputError, UnknownFormatError
from midair.files.atomic import existing_file, refusing, whole_file
from midair.files.native.inspection import get_ready, inspect
from midair.files.native.provenance_json import to_json
from midair.files.native.schema import FORMAT, TABLE, Entry, Kind
from midair.files.native.unclosed import openable
from midair.version import __version__

if TYPE_CHECKING:
    import os

    import h5py

    from midair.model import Provenance

LAYOUT = ("v110", "v110")
"""Oldest and newest version of HDF5 whose layout is used."""

GROWING = ("time", "event")
"""Axes along which a recording grows while it runs."""


@contextmanager
def new_file(path: "str | os.PathLike[str]") -> "Generator[h5py.File]":
    """An HDF5 file that gets its name when the block ends well.

    It is made in memory: HDF5 does not survive a disk that fills up while it writes, Python does.
    """
    import h5py

    with whole_file(path) as partial:
        with h5py.File(partial, "w", driver="core", backing_store=False, libver=LAYOUT) as file:
            yield file
            # The image has only what HDF5 no longer holds in buffers.
            file.flush()
            image = file.id.get_file_image()
        partial.write_bytes(image)


@contextmanager
def open_file(path: "str | os.PathLike[str]") -> "Generator[h5py.File]":
    """An HDF5 file to read, also while it is being recorded or after its writer was killed.

    Raises
    ------
    MissingFileError, BrokenFileError
        If there is none, or it cannot be read.
    """
    file = existing_file(path)
    with refusing(file, "an HDF5 file of midair"):
        if not begins_as_hdf5(file):
            raise BrokenFileError(f"{file}: expected an HDF5 file of midair, got other bytes; was it copied whole?")
        with open_plain(file) as opened:
            yield opened


@contextmanager
def open_plain(path: Path) -> "Generator[h5py.File]":
    """An HDF5 file of anybody to read, once it is known that reading it does no harm (`inspector`).

    No lock is taken: whoever writes makes a new file or lets others read, and some network disks have none.

    Raises
    ------
    BrokenFileError
        If it is not plain: it links elsewhere, announces more than it holds, or HDF5 does not survive it.
    """
    get_ready(path)
    import h5py

    inspect(path)
    with h5py.File(openable(path), "r", locking=False) as file:
        yield file


def begins_as_hdf5(path: Path) -> bool:
    """Whether a file has the signature of HDF5 where it may be: at 0, 512, 1024 and so on."""
    size, place = path.stat().st_size, 0
    with path.open("rb") as file:
        while place < size:
            file.seek(place)
            if file.read(8) == b"\x89HDF\r\n\x1a\n":
                return True
            place = max(512, 2 * place)
    return False


def signature(kind: Kind, provenance: "Provenance") -> dict[str, Any]:
    """The attributes that every file and group has."""
    return {
        "kind": f"midair {kind}",
        "format": FORMAT,
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "created_by": f"midair {__version__}",
        "provenance": to_json(provenance),
    }


def write_group(group: "h5py.Group", kind: Kind, values: Mapping[str, Any], *, live: bool = False) -> None:
    """Write what the table lists for `kind`; coordinates first, since the others refer to them.

    With `live`, the axes time and event can grow, unwritten numbers are NaN, and there are no checksums of numbers: a
    writer that is killed in the middle of a block would leave one that refuses the whole block.
    """
    entries = [entry for entry in TABLE[kind] if entry.name in values]
    unit = str(values.get("unit", ""))
    for entry in entries:
        if entry.dimensions is None:
            group.attrs[entry.name] = _packed(entry, values[entry.name])
    for entry in sorted(entries, key=lambda entry: not entry.coordinate):
        if entry.dimensions is not None:
            _create(group, entry, values[entry.name], entry.unit.format(unit=unit), live=live)


def read_group(group: "h5py.Group", kind: Kind, path: Path, *, live: bool = False) -> dict[str, Any]:
    """What the table lists for `kind`, each checked for type, axes, unit and lengths that agree.

    With `live`, what lies along time, or event, is cut to the shortest: a writer may be between two datasets.

    Raises
    ------
    BrokenFileError
        If the group is of another kind or differs from the table.
    UnknownFormatError
        If a newer midair wrote it.
    """
    check_kind(group, kind, path)
    present = _present(group, kind, path)
    values = {entry.name: _attribute(group, entry, path) for entry in present if entry.dimensions is None}
    stored = [entry for entry in present if entry.dimensions is not None]
    for entry in stored:
        values[entry.name] = _dataset(group, entry, entry.unit.format(unit=values.get("unit", "")), path)
    for axis in GROWING if live else ():
        along = [entry.name for entry in stored if axis in (entry.dimensions or ())]
        shortest = min((len(values[name]) for name in along), default=0)
        values |= {name: values[name][:shortest] for name in along}
    _check_lengths(stored, values, path)
    return values


def check_kind(group: "h5py.Group", kind: Kind, path: Path) -> None:
    """Raise if `group` holds something else than `kind`, or is newer than this midair."""
    have = kind_of(group)
    if have != f"midair {kind}":
        raise BrokenFileError(f"{path}: expected a midair {kind}, got {have or 'an HDF5 file of another program'}")
    version = group.attrs.get("format")
    if not isinstance(version, np.integer) or version < 1:
        raise BrokenFileError(f"{path}: expected a whole number from 1 on as format, got {version!r}")
    if version > FORMAT:
        raise UnknownFormatError(f"{path}: expected format {FORMAT}, got {version}, of a newer midair; update midair")


def stored_dataset(group: "h5py.Group", name: str) -> "h5py.Dataset":
    """The dataset `name` of a group.

    Raises
    ------
    BrokenFileError
        If there is none.
    """
    import h5py

    item = group.get(name)
    if not isinstance(item, h5py.Dataset):
        raise BrokenFileError(f"expected a dataset {name}, got {'nothing' if item is None else item!r}")
    return item


def stored_group(group: "h5py.Group", name: str) -> "h5py.Group":
    """The group `name` in a group.

    Raises
    ------
    BrokenFileError
        If there is none.
    """
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
    """What a group says it holds, such as "midair recording"; empty when it says nothing."""
    return plain_text(group.attrs.get("kind"))


def _create(group: "h5py.Group", entry: Entry, value: Any, unit: str, *, live: bool) -> None:
    data = np.asarray(value, entry.dtype)
    axes = entry.dimensions or ()
    grows = live and not set(GROWING).isdisjoint(axes)
    dataset = group.create_dataset(
        entry.name,
        data=data,
        maxshape=tuple(None if axis in GROWING else have for axis, have in zip(axes, data.shape, strict=True))
        if grows
        else None,
        chunks=_chunk(data, grows=grows),
        fletcher32=None if live or not data.ndim else True,
        fillvalue=np.nan if entry.dtype == "f8" else None,
    )
    dataset.attrs["units"] = fixed_text(unit)
    dataset.attrs["long_name"] = fixed_text(entry.what)
    if entry.coordinate:
        dataset.make_scale(entry.name)
        return
    if axes[-2:] == ("row", "column"):
        dataset.attrs["coordinates"] = fixed_text("y x")
    for index, axis in enumerate(axes):
        dataset.dims[index].attach_scale(group[axis])


def _chunk(data: np.ndarray, *, grows: bool) -> tuple[int, ...] | None:
    """Blocks of about 64 kB along the first axis; of 256 frames when that axis grows."""
    if not data.ndim:
        return None
    row = int(np.prod(data.shape[1:], dtype=int)) * data.itemsize
    return (256 if grows else max(1, min(len(data), 65536 // max(row, 1))), *data.shape[1:])


def _packed(entry: Entry, value: Any) -> Any:
    if entry.dtype != "text":
        return np.dtype(entry.dtype).type(value)
    return fixed_text(value)


def fixed_text(value: str) -> Any:
    """`value` as text of fixed length, which lies where HDF5 keeps checksums; text of free length does not.

    Raises
    ------
    InputError
        If UTF-8 cannot hold it, or it has a null character.
    """
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


def _dataset(group: "h5py.Group", entry: Entry, unit: str, path: Path) -> np.ndarray:
    dataset = stored_dataset(group, entry.name)
    axes = entry.dimensions or ()
    spelled = f"{entry.name}: expected {entry.dtype} with axes ({', '.join(axes)}) in {unit}"
    if dataset.dtype != np.dtype(entry.dtype) or dataset.ndim != len(axes):
        raise BrokenFileError(f"{path}: {spelled}, got {dataset!r}")
    have = plain_text(dataset.attrs.get("units"))
    if have != unit:
        raise BrokenFileError(f"{path}: {spelled}, got {have!r} as unit")
    return dataset[()]


def _check_lengths(entries: list[Entry], values: Mapping[str, Any], path: Path) -> None:
    lengths: dict[str, int] = {}
    for entry in entries:
        for axis, length in zip(entry.dimensions or (), values[entry.name].shape, strict=True):
            if lengths.setdefault(axis, length) != length:
                raise BrokenFileError(
                    f"{path}: {entry.name}: expected {lengths[axis]} along {axis}, got {length}; the file is damaged"
                )
