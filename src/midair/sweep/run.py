"""Run a sweep with Dask, on a local cluster or on an existing one, and store one file per task in a folder."""

import io
import json
import logging
import reprlib
import socket
import time
from collections.abc import Generator, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from midair.array_types import Array
from midair.errors import ClusterError, MidairError, MismatchError, MissingExtraError, MissingFileError
from midair.files import parse_errors, write_file
from midair.model import Progress
from midair.processes import local_cluster
from midair.sweep.patterns import PatternSweep
from midair.sweep.recordings import RecordingSweep
from midair.sweep.tasks import Job, Task
from midair.version import __version__

if TYPE_CHECKING:
    from distributed import Client

Sweep = PatternSweep | RecordingSweep
SETTINGS = "sweep.json"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SweepResults:
    """Results of a sweep, which may be incomplete."""

    kind: str  # "patterns" or "recordings"
    settings: Mapping[str, Any]  # As JSON values
    error: Array  # E, shape (condition, pattern or frame), NaN where not computed
    rounded_error: Array  # Same shape, for rounded phases
    strength: Array  # Highest target peak over the peak of a single focus, shape (condition,)
    seconds: float  # Processor time of all finished tasks
    complete: bool  # Whether no task is missing


def run_sweep(
    sweep: Sweep,
    folder: Path,
    *,
    scheduler: str | None = None,
    workers: int | None = None,
    progress: Progress | None = None,
) -> int:
    """Solve the missing tasks of a sweep, store each result as it arrives, and return the number of solved items.

    `scheduler` is the address of a Dask scheduler, such as tls://host:8786, whose workers have midair installed; by
    default `workers` processes of this computer (one per core). Raises MismatchError if the folder contains another
    sweep, or one of another midair; ClusterError if the scheduler cannot be reached, or a task or worker fails.
    """
    tasks = sweep.tasks()
    _open_folder(folder, sweep, tasks)
    missing = [task for task in tasks if not (folder / task.file).exists()]
    whole, left = (sum(task.last - task.first for task in some) for some in (tasks, missing))
    if progress is not None:
        progress(whole - left, whole)
    if not missing:
        return 0
    with cluster(scheduler, workers=workers) as client:
        for task, content in _results(client, sweep, missing):
            write_file(folder / task.file, content)
            left -= task.last - task.first
            if progress is not None:
                progress(whole - left, whole)
    return sum(task.last - task.first for task in missing)


def load_sweep(folder: Path) -> SweepResults:
    """Load the results so far, also while a command is running.

    Raises MissingFileError if there is no sweep, BrokenFileError if a file is damaged.
    """
    known, paths = _known(folder), sorted(folder.glob("*.npz"))
    with parse_errors(folder / SETTINGS, "the settings of a sweep"):
        error, rounded = np.full(known["shape"], np.nan), np.full(known["shape"], np.nan)
        strength, seconds = np.full(len(error), np.nan), 0.0
        kind, settings, complete = str(known["kind"]), dict(known["settings"]), len(paths) == known["tasks"]
    for path in paths:
        expected = "results of a sweep (delete the file, and the same command solves them again)"
        with parse_errors(path, expected), path.open("rb") as file, np.load(file, allow_pickle=False) as part:
            row, items = int(part["condition"]), part["items"]
            error[row, items], rounded[row, items] = part["error"], part["rounded_error"]
            strength[row], seconds = part["strength"], seconds + float(part["seconds"])
    arrays = {"error": error, "rounded_error": rounded, "strength": strength}
    return SweepResults(kind=kind, settings=settings, complete=complete, seconds=seconds, **arrays)


def _open_folder(folder: Path, sweep: Sweep, tasks: list[Task]) -> None:
    """Create the folder of a sweep, or check that it has this one."""
    asked: dict[str, Any] = {"kind": sweep.kind, "midair": __version__, "simulated": True, "settings": sweep.settings()}
    asked |= {"tasks": len(tasks), "shape": [1 + max(one.condition for one in tasks), max(one.last for one in tasks)]}
    if not (folder / SETTINGS).exists():
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise MismatchError(f"{folder}: expected a new name or the folder of a sweep, got other files")
        folder.mkdir(parents=True, exist_ok=True)
        write_file(folder / SETTINGS, json.dumps(asked, indent=1))
    stored = _known(folder)
    with parse_errors(folder / SETTINGS, "the settings of a sweep"):
        there, wanted = ({"kind": one["kind"], **one["settings"], "midair": one["midair"]} for one in (stored, asked))
    for name in {**wanted, **there}:
        if there.get(name) != wanted.get(name):
            got, expected = reprlib.repr(there.get(name)), reprlib.repr(wanted.get(name))
            raise MismatchError(f"{folder}: expected {name} {expected}, got a sweep with {got}; use it, or a new name")


def _known(folder: Path) -> dict[str, Any]:
    if not (folder / SETTINGS).exists():
        raise MissingFileError(f"{folder}: expected a sweep, found none; create one with midair sweep patterns")
    with parse_errors(folder / SETTINGS, "the settings of a sweep"):
        return dict(json.loads((folder / SETTINGS).read_text(encoding="utf-8")))


@contextmanager
def cluster(scheduler: str | None = None, *, workers: int | None = None, patience: float = 10.0) -> "Generator[Client]":
    """Client of a scheduler, or of a local cluster that ends with the block.

    `patience` is the time limit for the scheduler and its first worker in s. Raises a ClusterError if there is none.
    """
    try:
        import distributed
    except ImportError as missing:
        raise MissingExtraError("sweep: expected distributed, got none; pip install 'midair[sweep]'") from missing
    for name in ("distributed", "distributed.client"):
        logging.getLogger(name).setLevel(logging.CRITICAL)
    with ExitStack() as opened:
        address = scheduler or opened.enter_context(local_cluster(workers))
        try:
            client = opened.enter_context(distributed.Client(address, timeout=patience, set_as_default=False))
            client.wait_for_workers(1, timeout=patience)
        except (OSError, TypeError, ValueError) as wrong:
            raise ClusterError(
                f"scheduler: expected one with workers at {address}, got {wrong!r}; check the "
                "address, start dask worker, and for tls:// set the certificate in Dask's configuration"
            ) from wrong
        yield client


def _results(client: "Client", sweep: Sweep, tasks: list[Task]) -> Iterator[tuple[Task, bytes]]:
    """Yield each task and the content of its file as it is finished."""
    import distributed

    running, coming, waiting = distributed.as_completed(with_results=True, loop=client.loop), iter(tasks), 0
    while True:
        try:
            # A task may hold several megabytes, so submit only as many as keep the workers busy, in order.
            threads: Any = client.nthreads()
            for task in islice(coming, max(2 * sum(threads.values()) + 2 - waiting, 0)):
                running.add(client.submit(task_content, sweep.job(task), task, __version__, pure=False))
                waiting += 1
            if not waiting:
                return
            _, found = next(running)
            if isinstance(found, Exception):  # A future that a lost scheduler cancelled
                raise found
        except MidairError:
            raise
        except Exception as wrong:  # of a task, its worker, or the scheduler
            raise ClusterError(
                f"sweep: expected an answer of every worker, got {wrong!r}; all results so far are stored, repeat the "
                "command to continue"
            ) from wrong
        waiting -= 1
        yield found


def task_content(job: Job, task: Task, version: str) -> tuple[Task, bytes]:
    """Run one task on a worker; return it and the content of its file."""
    if version != __version__:
        raise ClusterError(f"sweep: expected midair {version}, got {__version__} on {socket.gethostname()}; update one")
    start, content = time.process_time(), io.BytesIO()
    found: Any = job() | {"condition": task.condition, "items": np.arange(task.first, task.last)}
    np.savez(content, seconds=time.process_time() - start, **found)
    return task, content.getvalue()
