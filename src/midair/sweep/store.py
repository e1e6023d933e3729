"""Results of a sweep in Zarr: a task has chunks of its own, so that whoever solved it can store it."""

import secrets
from collections.abc import Generator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from midair.errors import MismatchError, MissingFileError
from midair.files import refusing, to_json
from midair.sweep.place import SweepPlace, place_of, zarr
from midair.sweep.region import SweepAddress, write_region
from midair.sweep.same_settings import check_settings
from midair.sweep.task import Result, Sweep, Task
from midair.version import __version__

Array = NDArray[np.float64]
_BEGUN = {"midair": __version__}
"""All that a group in an object store says until it is whole."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SweepResults:
    """All that is known of a sweep so far.

    Attributes
    ----------
    kind : str
        ``patterns`` or ``recordings``.
    settings : mapping
        Settings of the sweep, as JSON knows them.
    coordinates : mapping of str to ndarray
        What stands along the axes, by name.
    error, rounded_error : ndarray, shape (condition, item)
        NaN where nothing is known yet or was not asked for. Items are in their own order, also where tasks are not.
    strength : ndarray, shape (condition, task)
        Highest peak of the targets over the focus of the whole array; NaN for tasks that are not done.
    seconds : float
        Processor time of all tasks that are done.
    """

    kind: str
    settings: Mapping[str, Any]
    coordinates: Mapping[str, NDArray[Any]]
    error: Array
    rounded_error: Array
    strength: Array
    seconds: float

    @property
    def known(self) -> int:
        """Number of patterns or frames solved, over all conditions."""
        return int(np.isfinite(self.error).sum())


class SweepStore:
    """A Zarr group that this command alone hands out work for. `open_sweep` gives one."""

    def __init__(self, place: SweepPlace, group: Any, sweep: Sweep) -> None:
        self._place = place
        self._group = group
        self._sweep = sweep

    @property
    def address(self) -> SweepAddress | None:
        """What workers need to store results themselves; None for a store of before they did."""
        token = self._group.attrs.get("token")
        return None if token is None else SweepAddress(place=self._place.name, token=str(token))

    def missing(self) -> tuple[Task, ...]:
        """The tasks that are not done, in order."""
        done, width = _done(self._place, self._group), self._sweep.chunk
        return tuple(task for task in self._sweep.tasks() if not done[task.condition, task.first // width])

    def write(self, result: Result) -> None:
        """Store what a task found, unless its worker has; then its flag."""
        if result.found is not None:
            write_region(self._group, result.task, result.found, result.seconds)


@contextmanager
def open_sweep(where: Path | str, sweep: Sweep) -> Generator[SweepStore]:
    """A new store for a sweep, or the one that is there, to go on with.

    Parameters
    ----------
    where : Path or str
        A folder, or an address that fsspec knows.
    sweep : Sweep
        What is, or is to be, in it.

    Raises
    ------
    MismatchError
        If the store is of a sweep with other settings.
    DeviceStateError
        If another program is writing to this folder.
    BrokenFileError
        If something else has this name.
    FileError
        If the object store cannot be reached.
    """
    place = place_of(where)
    if not place.exists() or dict(place.group("r").attrs) == _BEGUN:
        place.create(lambda inside: _fill(inside, sweep))
    with place.alone():
        group = place.group("r+")
        check_settings(place, group.attrs, sweep)
        for one in sweep.coordinates():
            if not np.array_equal(group[one.name][:], one.values):
                raise MismatchError(f"{place}: expected the same {one.name} as before, got others; use a new name")
        yield SweepStore(place, group, sweep)


def load_sweep(where: Path | str) -> SweepResults:
    """What is known so far; also while others are writing.

    Raises
    ------
    MissingFileError
        If nothing has that name.
    BrokenFileError
        If it is no sweep.
    FileError
        If the object store cannot be reached.
    """
    place = place_of(where)
    if not place.exists():
        raise MissingFileError(f"{place}: expected a sweep, found none; make one with midair sweep patterns {place}")
    group = place.group("r")
    with refusing(str(place), "a sweep of midair"):
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


def _done(place: SweepPlace, group: Any) -> NDArray[np.bool_]:
    """Which tasks are whole, shape (condition, task): those with a flag."""
    flags = group["done"]
    if flags.chunks != (1, 1):  # a store of before workers wrote: one file a row
        return np.asarray(flags[:], dtype=bool)
    rows, columns = flags.shape
    done = np.zeros((rows, columns), dtype=bool)
    for row, column in place.chunks("done"):
        if row < rows and column < columns:
            done[row, column] = True
    return done


def _known(array: Any, done: NDArray[np.bool_], width: int = 0) -> Array:
    """Numbers of the tasks that are done; NaN elsewhere: without their task's flag they may be half written.

    Each row is read up to the last that is known: where most is missing, asking for every chunk takes minutes.
    """
    known = np.repeat(done, width or array.chunks[1], axis=1)[:, : array.shape[1]]
    found = np.full(array.shape, np.nan)
    for row in np.flatnonzero(known.any(axis=1)):
        until = int(np.flatnonzero(known[row])[-1]) + 1
        found[row, :until] = array[int(row), :until]
    return np.where(known, found, np.nan)


def _by_item(stored: Array, item: NDArray[np.int64] | None) -> Array:
    """Numbers in the order of the items, where the store says which item stands where (-1: none)."""
    if item is None:
        return stored
    found = np.full((len(stored), int(item.max()) + 1), np.nan)
    row, column = np.nonzero(item >= 0)
    found[row, item[row, column]] = stored[row, column]
    return found


def _fill(inside: str, sweep: Sweep) -> None:
    """Arrays first and settings last: with them the store is whole."""
    # A copy: Zarr keeps the mapping, and changes it with the attributes.
    begun = dict(_BEGUN)
    group: Any = zarr().open_group(inside, mode="a", zarr_format=3, use_consolidated=False, attributes=begun)
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
    group.attrs.put(
        _BEGUN
        | {
            "kind": sweep.kind,
            "coordinates": [one.name for one in sweep.coordinates()],
            "settings": sweep.settings(),
            "provenance": to_json(sweep.provenance()),
            "token": secrets.token_hex(8),
        }
    )


def _array(group: Any, name: str, **layout: Any) -> None:
    """Make an array that is not there yet."""
    if name not in group:
        group.create_array(name, **layout)
