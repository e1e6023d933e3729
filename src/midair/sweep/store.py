"""Results of a sweep in Zarr: written task by task, each flagged when it is whole, and never by two at once."""

import os
import secrets
import shutil
import sys
from collections.abc import Generator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from midair.errors import BrokenFileError, MismatchError, MissingExtraError, MissingFileError
from midair.files import hold, refusing, to_json, writable_path
from midair.sweep.task import Found, Sweep, Task
from midair.version import __version__

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Result:
    """What a task found, and the processor time it took, in s."""

    task: Task
    found: Found
    seconds: float


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
        NaN where nothing is known yet or was not asked for.
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
    """A Zarr group that this process alone writes to. `open_sweep` gives one.

    A task's flag is written after its results; a program that is killed in between does this task again, and only
    this one. Zarr puts each chunk into a file of its own and renames it when it is whole.
    """

    def __init__(self, group: Any, sweep: Sweep) -> None:
        self._group = group
        self._sweep = sweep

    def missing(self) -> tuple[Task, ...]:
        """The tasks that are not done, in order."""
        done = self._group["done"][:]
        return tuple(task for task in self._sweep.tasks() if not done[self._place(task)])

    def write(self, result: Result) -> None:
        """Store what a task found; then its flag."""
        task = result.task
        self._group["error"][task.condition, task.first : task.last] = result.found.error
        self._group["rounded_error"][task.condition, task.first : task.last] = result.found.rounded_error
        self._group["target_strength"][self._place(task)] = result.found.strength
        self._group["seconds"][self._place(task)] = result.seconds
        self._group["done"][self._place(task)] = True

    def _place(self, task: Task) -> tuple[int, int]:
        return task.condition, task.first // self._sweep.chunk


@contextmanager
def open_sweep(path: Path, sweep: Sweep) -> Generator[SweepStore]:
    """A new store for a sweep, or the one that is there, to go on with.

    Raises
    ------
    MismatchError
        If the store is of a sweep with other settings.
    DeviceStateError
        If another program is writing to it.
    BrokenFileError
        If something else has this name.
    """
    if not path.exists():
        _create(writable_path(path), sweep)
    with _alone(path):
        group = _group(path, "r+")
        _check_settings(path, group.attrs, sweep)
        for one in sweep.coordinates():
            if not np.array_equal(group[one.name][:], one.values):
                raise MismatchError(f"{path}: expected the same {one.name} as before, got others; use a new name")
        yield SweepStore(group, sweep)


def load_sweep(path: Path) -> SweepResults:
    """What is known so far; also while another program is writing.

    Raises
    ------
    MissingFileError
        If nothing has that name.
    BrokenFileError
        If it is no sweep.
    """
    if not path.exists():
        raise MissingFileError(f"{path}: expected a sweep, found none; make one with midair sweep patterns {path}")
    group = _group(path, "r")
    with refusing(path, "a sweep of midair"):
        settings, done = dict(group.attrs["settings"]), group["done"][:]
        # Results without their task's flag may be half written: they count as unknown.
        known = np.repeat(done, group["error"].chunks[1], axis=1)[:, : group["error"].shape[1]]
        return SweepResults(
            kind=str(group.attrs["kind"]),
            settings=settings,
            coordinates={str(name): group[name][:] for name in group.attrs["coordinates"]},
            error=np.where(known, group["error"][:], np.nan),
            rounded_error=np.where(known, group["rounded_error"][:], np.nan),
            strength=np.where(done, group["target_strength"][:], np.nan),
            seconds=float(np.nansum(group["seconds"][:])),
        )


def _create(path: Path, sweep: Sweep) -> None:
    """Make the store beside `path` and rename it when it is whole."""
    partial = path.with_name(f".midair-{secrets.token_hex(4)}.part")
    try:
        _fill(partial, sweep)
        with suppress(OSError):  # another program was first: its store is checked like any other
            partial.rename(path)
    finally:
        shutil.rmtree(partial, ignore_errors=True)


def _fill(path: Path, sweep: Sweep) -> None:
    group: Any = _zarr().create_group(path, zarr_format=3)
    coordinates = sweep.coordinates()
    group.attrs.put(
        {
            "midair": __version__,
            "kind": sweep.kind,
            "coordinates": [one.name for one in coordinates],
            "settings": sweep.settings(),
            "provenance": to_json(sweep.provenance()),
        }
    )
    for one in coordinates:
        group.create_array(one.name, data=one.values, dimension_names=(one.axis,)).attrs.put(dict(one.attributes))
    shape, axes = sweep.shape, ("condition", sweep.item)
    for name in ("error", "rounded_error"):
        group.create_array(
            name, shape=shape, chunks=(1, sweep.chunk), dtype="float64", fill_value=np.nan, dimension_names=axes
        )
    shape, axes = (shape[0], -(-shape[1] // sweep.chunk)), ("condition", "task")
    for name, dtype, empty in (
        ("target_strength", "float64", np.nan),
        ("seconds", "float64", np.nan),
        ("done", "bool", False),
    ):
        group.create_array(name, shape=shape, chunks=(1, shape[1]), dtype=dtype, fill_value=empty, dimension_names=axes)


def _check_settings(path: Path, attrs: Mapping[str, Any], sweep: Sweep) -> None:
    with refusing(path, "a sweep of midair"):
        stored = dict(attrs["settings"]) | {"kind": attrs["kind"]}
        asked = sweep.settings() | {"kind": sweep.kind}
    different = _difference(stored, asked)
    if different is not None:
        name, there, wanted = different
        raise MismatchError(
            f"{path}: expected {name} {wanted}, got a sweep with {there}; give its settings to go on with it, or use a "
            "new name"
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
    """Numbers and texts as they are; of what is longer, how long it is."""
    return f"{len(value)} of them" if isinstance(value, list | Mapping) and len(str(value)) > 80 else str(value)


def _group(path: Path, mode: str) -> Any:
    if not path.is_dir():
        raise BrokenFileError(f"{path}: expected a sweep, which is a folder, got a file; use another name")
    with refusing(path, "a sweep of midair"):
        return _zarr().open_group(path, mode=mode, zarr_format=3, use_consolidated=False)


@contextmanager
def _alone(path: Path) -> Generator[None]:
    """Hold the folder where the system can; the lock goes with the process, however it dies."""
    if sys.platform == "win32":  # which opens no folders
        yield
        return
    held = os.open(path, os.O_RDONLY)
    try:
        hold(held, f"{path}: another program is writing to this sweep; wait for it")
        yield
    finally:
        os.close(held)


def _zarr() -> Any:
    try:
        import zarr
    except ImportError as missing:
        raise MissingExtraError(
            "sweep: expected zarr, which is not installed; pip install 'midair[sweep]'"
        ) from missing
    return zarr
