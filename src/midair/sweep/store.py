"""Results of a sweep in Zarr: every task has its own chunks, so that the process that solved it can store it."""

import hashlib
import json
import math
import secrets
import warnings
from collections.abc import Generator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array
from midair.errors import BrokenFileError, MidairError, MismatchError, MissingFileError
from midair.files import check_memory_for, parse_errors, to_json
from midair.sweep.pattern_sweep import PatternSweep
from midair.sweep.recording_sweep import RecordingSweep
from midair.sweep.storage import Found, Result, SweepStorage, Task, storage_of, sweep_package
from midair.version import __version__

Sweep = PatternSweep | RecordingSweep
"""A sweep: E of each item under each condition."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SweepAddress:
    """Location of the store for workers."""

    place: str
    """Absolute folder, or address for fsspec."""
    token: str
    """Random token; differs for a store of the same name on another machine, and for a new store."""

    def take(self, result: Result) -> Result:
        """Store the result of a task if this machine can access the store; return what is still to be stored."""
        place = storage_of(self.place)
        if result.found is None or not place.exists():
            return result
        group = place.group("r+")
        if group.attrs.get("token") != self.token:
            return result
        write_region(group, result.task, result.found, result.seconds)
        return replace(result, found=None)


def write_region(group: Any, task: Task, found: Found, seconds: float) -> None:
    """Write the numbers, then the flag, so that after a crash in between only this task is repeated.

    Zarr writes each chunk to its own object, or to a file that it renames when it is complete.
    """
    error = group["error"]
    place = task.condition, task.first // error.chunks[1]
    error[task.condition, task.first : task.last] = found.error
    group["rounded_error"][task.condition, task.first : task.last] = found.rounded_error
    group["target_strength"][place] = found.strength
    group["seconds"][place] = seconds
    group["done"][place] = True


@contextmanager
def store_errors_raised() -> Generator[None]:
    """Turn errors from invalid settings, coordinates or results of a store into a BrokenFileError."""
    try:
        yield
    except MidairError:
        raise
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as wrong:
        cause = " ".join(f"{type(wrong).__name__}: {wrong}".split())[:120]
        raise BrokenFileError(
            f"sweep: expected settings and results of midair, got others ({cause}); the store is damaged"
        ) from wrong


_BEGUN = {"midair": __version__}
"""Attributes of a group in an object store until it is complete."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SweepResults:
    """Results of a sweep, which may be incomplete."""

    kind: str
    """``patterns`` or ``recordings``."""
    settings: Mapping[str, Any]
    """Settings of the sweep as JSON values."""
    coordinates: Mapping[str, NDArray[Any]]
    """Arrays along the axes by name."""
    error: Array
    """Shape (condition, item), NaN where not computed. Items are in their own order, even if tasks are not."""
    rounded_error: Array
    """Same shape, for rounded phases."""
    strength: Array
    """Highest target peak over the peak of a single focus, shape (condition, task); NaN for unfinished tasks."""
    seconds: float
    """Processor time of all finished tasks."""

    @property
    def known(self) -> int:
        """Number of solved patterns or frames over all conditions."""
        return int(np.isfinite(self.error).sum())


class SweepStore:
    """An open Zarr group of a sweep; create it with `open_sweep`."""

    def __init__(self, place: SweepStorage, group: Any, sweep: Sweep) -> None:
        self._place = place
        self._group = group
        self._sweep = sweep

    @property
    def address(self) -> SweepAddress:
        """Address for workers that store results themselves."""
        return SweepAddress(place=self._place.name, token=str(self._group.attrs["token"]))

    def missing(self) -> tuple[Task, ...]:
        """Unfinished tasks in order."""
        done, width = _done(self._place, self._group), self._sweep.chunk
        return tuple(task for task in self._sweep.tasks() if not done[task.condition, task.first // width])

    def write(self, result: Result) -> None:
        """Store the result of a task, unless its worker has stored it."""
        if result.found is not None:
            write_region(self._group, result.task, result.found, result.seconds)


@contextmanager
def open_sweep(where: Path | str, sweep: Sweep) -> Generator[SweepStore]:
    """Create a store for a sweep, or open the existing one to continue it.

    Raises a MismatchError for a store with other settings, a DeviceStateError if another program writes to it, a
    BrokenFileError if another kind of file has this name, and a FileError if the object store cannot be reached.
    """
    place = storage_of(where)
    if not place.exists() or dict(place.group("r").attrs) == _BEGUN:
        place.create(lambda inside: _fill(inside, sweep))
    with place.alone():
        group = place.group("r+")
        _check_layout(place, group)
        check_settings(place, group.attrs, sweep)
        for one in sweep.coordinates():
            if not np.array_equal(group[one.name][:], one.values):
                raise MismatchError(f"{place}: expected the stored {one.name}, got other values; use a new name")
        yield SweepStore(place, group, sweep)


def load_sweep(where: Path | str) -> SweepResults:
    """Load the results so far, also while other processes are writing.

    Raises MissingFileError or BrokenFileError if the name does not exist, or is not a sweep; FileError if the object
    store cannot be reached.
    """
    place = storage_of(where)
    if not place.exists():
        raise MissingFileError(f"{place}: expected a sweep, found none; create one with midair sweep patterns {place}")
    group = place.group("r")
    _check_layout(place, group)
    with parse_errors(str(place), "a sweep of midair"):
        done = _done(place, group)
        coordinates = {str(name): group[name][:] for name in group.attrs["coordinates"]}
        item = coordinates.get("frame")
        return SweepResults(
            kind=str(group.attrs["kind"]),
            settings=dict(group.attrs["settings"]),
            coordinates=coordinates,
            error=_by_item(_known(group["error"], done), item),
            rounded_error=_by_item(_known(group["rounded_error"], done), item),
            strength=_known(group["target_strength"], done, width=1),
            seconds=float(np.nansum(_known(group["seconds"], done, width=1))),
        )


def _check_layout(place: SweepStorage, group: Any) -> None:
    """Check everything outside of the chunks, which have checksums of their own, before anything is read.

    Raises an InputError if the arrays, which may claim any shape, do not fit into memory, and a BrokenFileError if
    settings or layouts differ from those that were written.
    """
    with parse_errors(str(place), "a sweep of midair"), warnings.catch_warnings():
        # About files that belong to no array; they are not read.
        warnings.simplefilter("ignore", UserWarning)
        numbers = sum(max(math.prod(array.shape), math.prod(array.chunks)) for _, array in group.arrays())
        # Of 8 bytes each; results, mask and sorted copies exist at the same time.
        check_memory_for(5 * 8 * numbers, str(place), "check that the sweep is not damaged, or use more memory")
        if group.attrs.get("sha256") != _digest(place, group, group.attrs):
            raise BrokenFileError(
                f"{place}: expected the settings and layouts that were written, got others, their checksum differs; "
                "restore the files zarr.json from a copy"
            )


def _digest(place: SweepStorage, group: Any, attributes: Mapping[str, Any]) -> str:
    """SHA-256 of the attributes of the group, without the digest itself, and of the layout of each array."""
    kept = {name: value for name, value in attributes.items() if name != "sha256"}
    digest = hashlib.sha256(json.dumps(kept, sort_keys=True).encode())
    for name in sorted(group.array_keys()):
        digest.update(name.encode() + place.layout(name))
    return digest.hexdigest()


_RESULTS = ("error", "rounded_error", "target_strength", "seconds")


def _done(place: SweepStorage, group: Any) -> NDArray[np.bool_]:
    """Mask of the finished tasks, shape (condition, task): those with a flag and all chunks of results."""
    rows, columns = group["done"].shape
    done = np.zeros((rows, columns), dtype=bool)
    for row, column in set.intersection(*(place.chunks(name) for name in ("done", *_RESULTS))):
        if row < rows and column < columns:
            done[row, column] = True
    return done


def _known(array: Any, done: NDArray[np.bool_], width: int = 0) -> Array:
    """Values of finished tasks, NaN elsewhere, because a task without a flag may be half written.

    Each row is read up to its last finished task; reading every chunk would take minutes for a mostly empty store.
    """
    known = np.repeat(done, width or array.chunks[1], axis=1)[:, : array.shape[1]]
    found = np.full(array.shape, np.nan)
    for row in np.flatnonzero(known.any(axis=1)):
        until = int(np.flatnonzero(known[row])[-1]) + 1
        try:
            found[row, :until] = array[int(row), :until]
        except RuntimeError as wrong:
            chunk = _damaged_chunk(array, int(row), until)
            raise BrokenFileError(
                f"{chunk} is damaged, its checksum does not match; delete it and run the same sweep again"
            ) from wrong
    return np.where(known, found, np.nan)


def _damaged_chunk(array: Any, row: int, until: int) -> str:
    """Name of the first chunk of a row that cannot be read."""
    width = array.chunks[1]
    for first in range(0, until, width):
        try:
            _ = array[row, first : first + width]
        except RuntimeError:
            return f"chunk {array.basename}/c/{row}/{first // width}"
    return f"a chunk {array.basename}/c/{row}"


def _by_item(stored: Array, item: NDArray[np.int64] | None) -> Array:
    """Values in the order of the items, if the store has the item at each place (-1: none)."""
    if item is None:
        return stored
    found = np.full((len(stored), int(item.max()) + 1), np.nan)
    row, column = np.nonzero(item >= 0)
    found[row, item[row, column]] = stored[row, column]
    return found


def _fill(inside: str, sweep: Sweep) -> None:
    """Create the arrays first and the settings last; the settings mark a complete store."""
    # Copy the mapping, because Zarr modifies it with the attributes.
    begun = dict(_BEGUN)
    package = sweep_package("zarr")
    group: Any = package.open_group(inside, mode="a", zarr_format=3, use_consolidated=False, attributes=begun)
    for one in sweep.coordinates():
        _array(group, one.name, shape=one.values.shape, dtype=one.values.dtype, dimension_names=one.axes)
        group[one.name].attrs.put(dict(one.attributes))
        group[one.name][...] = one.values
    shape, axes = sweep.shape, ("condition", sweep.item)
    for name in ("error", "rounded_error"):
        chunks = (1, sweep.chunk)
        _array(group, name, shape=shape, chunks=chunks, dtype="float64", fill_value=np.nan, dimension_names=axes)
    shape, axes = (shape[0], -(-shape[1] // sweep.chunk)), ("condition", "task")
    for name in ("target_strength", "seconds"):
        _array(group, name, shape=shape, chunks=(1, 1), dtype="float64", fill_value=np.nan, dimension_names=axes)
    _array(group, "done", shape=shape, chunks=(1, 1), dtype="bool", fill_value=False, dimension_names=axes)
    attributes = _BEGUN | {
        "kind": sweep.kind,
        "coordinates": [one.name for one in sweep.coordinates()],
        "settings": sweep.settings(),
        "provenance": to_json(sweep.provenance()),
        "token": secrets.token_hex(8),
    }
    group.attrs.put(attributes | {"sha256": _digest(storage_of(inside), group, attributes)})


def _array(group: Any, name: str, **layout: Any) -> None:
    """Create an array if it does not exist."""
    if name not in group:
        codec = sweep_package("zarr").codecs.ZstdCodec(level=0, checksum=True)
        group.create_array(name, compressors=codec, **layout)


def check_settings(path: object, attrs: Mapping[str, Any], sweep: Sweep) -> None:
    """Raise a MismatchError that names the first different setting, or a BrokenFileError without settings."""
    with parse_errors(str(path), "a sweep of midair"):
        stored = dict(attrs["settings"]) | {"kind": attrs["kind"]}
        asked = sweep.settings() | {"kind": sweep.kind}
    different = _difference(stored, asked)
    if different is not None:
        name, there, wanted = different
        raise MismatchError(
            f"{path}: expected {name} {wanted}, got a sweep with {there}; use its settings to continue it, or a new "
            "name"
        )


def _difference(stored: Any, asked: Any, name: str = "") -> tuple[str, str, str] | None:
    """Name and both values of the first setting that differs."""
    if isinstance(stored, Mapping) and isinstance(asked, Mapping):
        pairs = [(str(key), stored.get(key), asked.get(key)) for key in sorted({*stored, *asked})]
    elif isinstance(stored, list) and isinstance(asked, list) and len(stored) == len(asked):
        pairs = [(str(number), *pair) for number, pair in enumerate(zip(stored, asked, strict=True))]
    elif stored == asked:
        return None
    else:
        return name, _short(stored), _short(asked)
    found = (_difference(there, wanted, f"{name} {key}".strip()) for key, there, wanted in pairs)
    return next((one for one in found if one is not None), None)


def _short(value: Any) -> str:
    """Text of a value; long lists and mappings are replaced by their length."""
    return f"{len(value)} of them" if isinstance(value, list | Mapping) and len(str(value)) > 80 else str(value)
