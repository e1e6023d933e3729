"""Results of a sweep in Zarr: written task by task, each flagged when it is whole, and never by two at once."""

import os
import secrets
import shutil
from collections.abc import Generator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from midair.errors import BrokenFileError, DeviceStateError, MismatchError, MissingExtraError, MissingFileError
from midair.rig.sweep_plan import PatternSweep, Task
from midair.store.files import refusing, writable_path
from midair.store.provenance import to_json
from midair.version import __version__

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Result:
    """What a task found: E and E of rounded phases, shape (pattern,), and the processor time it took, in s."""

    task: Task
    error: Array
    rounded_error: Array
    seconds: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SweepResults:
    """All that is known of a sweep so far.

    Attributes
    ----------
    sweep : PatternSweep
        What was asked for.
    patterns : ndarray of int, shape (pattern,)
        Bit k is channel k.
    error, rounded_error : ndarray, shape (condition, pattern)
        NaN where nothing is known yet or was not asked for.
    seconds : float
        Processor time of all tasks that are done.
    """

    sweep: PatternSweep
    patterns: NDArray[np.int64]
    error: Array
    rounded_error: Array
    seconds: float

    @property
    def known(self) -> int:
        """Number of patterns solved, over all conditions."""
        return int(np.isfinite(self.error).sum())

    @property
    def asked(self) -> int:
        """Number of patterns asked for, over all conditions."""
        return sum(condition.count for condition in self.sweep.conditions())


class SweepStore:
    """A Zarr group that this process alone writes to. `open_sweep` gives one.

    A task's flag is written after its results; a program that is killed in between does this task again, and only
    this one. Zarr puts each chunk into a file of its own and renames it when it is whole.
    """

    def __init__(self, group: Any, sweep: PatternSweep) -> None:
        self._group = group
        self._sweep = sweep

    def missing(self) -> tuple[Task, ...]:
        """The tasks that are not done, in order."""
        done = self._group["done"][:]
        return tuple(task for task in self._sweep.tasks() if not done[self._place(task)])

    def write(self, result: Result) -> None:
        """Store what a task found; then its flag."""
        task = result.task
        self._group["error"][task.condition, task.first : task.last] = result.error
        self._group["rounded_error"][task.condition, task.first : task.last] = result.rounded_error
        self._group["seconds"][self._place(task)] = result.seconds
        self._group["done"][self._place(task)] = True

    def _place(self, task: Task) -> tuple[int, int]:
        return task.condition, task.first // self._sweep.chunk


@contextmanager
def open_sweep(path: Path, sweep: PatternSweep) -> Generator[SweepStore]:
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
        if not np.array_equal(group["pattern"][:], sweep.patterns()):
            raise MismatchError(f"{path}: expected the patterns of seed {sweep.seed}, got others; use a new name")
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
        sweep = PatternSweep.of_settings(group.attrs["settings"])
        done = np.repeat(group["done"][:], sweep.chunk, axis=1)[:, : group["error"].shape[1]]
        return SweepResults(
            sweep=sweep,
            patterns=group["pattern"][:],
            error=np.where(done, group["error"][:], np.nan),
            rounded_error=np.where(done, group["rounded_error"][:], np.nan),
            seconds=float(np.nansum(group["seconds"][:])),
        )


def _create(path: Path, sweep: PatternSweep) -> None:
    """Make the store beside `path` and rename it when it is whole."""
    partial = path.with_name(f".midair-{secrets.token_hex(4)}.part")
    try:
        _fill(partial, sweep)
        with suppress(OSError):  # another program was first: its store is checked like any other
            partial.rename(path)
    finally:
        shutil.rmtree(partial, ignore_errors=True)


def _fill(path: Path, sweep: PatternSweep) -> None:
    conditions, patterns = sweep.conditions(), sweep.patterns()
    group: Any = _zarr().create_group(path, zarr_format=3)
    group.attrs.put({"midair": __version__, "settings": sweep.settings(), "provenance": to_json(sweep.provenance())})
    axes = ("condition", "pattern")
    group.create_array("pattern", data=patterns, dimension_names=axes[1:]).attrs["description"] = "bit k is channel k"
    strengths, heights = ([getattr(one, name) for one in conditions] for name in ("strength", "height"))
    group.create_array("strength", data=np.array(strengths), dimension_names=axes[:1])
    group.create_array("height", data=np.array(heights), dimension_names=axes[:1]).attrs["units"] = "m"
    shape = (len(conditions), len(patterns))
    for name in ("error", "rounded_error"):
        group.create_array(
            name, shape=shape, chunks=(1, sweep.chunk), dtype="float64", fill_value=np.nan, dimension_names=axes
        )
    shape = (len(conditions), -(-len(patterns) // sweep.chunk))
    axes = ("condition", "task")
    for name, dtype, empty in (("seconds", "float64", np.nan), ("done", "bool", False)):
        group.create_array(name, shape=shape, chunks=(1, shape[1]), dtype=dtype, fill_value=empty, dimension_names=axes)


def _check_settings(path: Path, attrs: Mapping[str, Any], sweep: PatternSweep) -> None:
    with refusing(path, "a sweep of midair"):
        stored, asked = dict(attrs["settings"]), sweep.settings()
    for name in sorted(stored | asked):
        if stored.get(name) != asked.get(name):
            raise MismatchError(
                f"{path}: expected {name} {asked.get(name)}, got a sweep with {stored.get(name)}; give its settings to "
                "go on with it, or use a new name"
            )


def _group(path: Path, mode: str) -> Any:
    if not path.is_dir():
        raise BrokenFileError(f"{path}: expected a sweep, which is a folder, got a file; use another name")
    with refusing(path, "a sweep of midair"):
        return _zarr().open_group(path, mode=mode, zarr_format=3, use_consolidated=False)


@contextmanager
def _alone(path: Path) -> Generator[None]:
    """Hold the folder where the system can; the lock goes with the process, however it dies."""
    try:
        from fcntl import LOCK_EX, LOCK_NB, flock
    except ImportError:
        yield
        return
    held = os.open(path, os.O_RDONLY)
    try:
        try:
            flock(held, LOCK_EX | LOCK_NB)
        except OSError as other:
            raise DeviceStateError(f"{path}: another program is writing to this sweep; wait for it") from other
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
