"""Run a sweep on Dask: a cluster on this machine, or one that is already there."""

import signal
import time
from collections.abc import Generator, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from midair.errors import ClusterError, MissingExtraError
from midair.model import Progress
from midair.sweep.store import Result, open_sweep
from midair.sweep.task import Job, Sweep, Task

if TYPE_CHECKING:
    from distributed import Client


def run_sweep(
    sweep: Sweep,
    path: Path,
    *,
    scheduler: str | None = None,
    workers: int | None = None,
    progress: Progress | None = None,
) -> int:
    """Solve whatever is missing of a sweep, and store it as it comes.

    Only this process writes, so that a cluster needs no common disk. Killed at any moment, it can be started again:
    what is stored stays, and what is not is done.

    Parameters
    ----------
    sweep : Sweep
        What to solve.
    path : Path
        NAME.zarr, new or of the same sweep.
    scheduler : str, optional
        Address of a Dask scheduler, such as tcp://host:8786, whose workers have midair installed; a cluster on this
        machine, reachable from nowhere else, if None.
    workers : int, optional
        Processes on this machine; one a core if None.
    progress : callable, optional
        Called with (patterns or frames done, all of them) at the start and after each task.

    Returns
    -------
    int
        Number of patterns or frames that were solved now.

    Raises
    ------
    MismatchError
        If the store is of another sweep.
    ClusterError
        If the cluster cannot be reached or a task fails; what was found so far is stored.
    """
    whole = sum(task.count for task in sweep.tasks())
    with open_sweep(path, sweep) as store:
        missing = store.missing()
        first = done = whole - sum(task.count for task in missing)
        if progress is not None:
            progress(done, whole)
        if not missing:
            return 0
        with cluster(scheduler, workers=workers) as client:
            for result in _results(client, sweep, missing):
                store.write(result)
                done += result.task.count
                if progress is not None:
                    progress(done, whole)
    return done - first


@contextmanager
def cluster(scheduler: str | None = None, *, workers: int | None = None, patience: float = 10.0) -> "Generator[Client]":
    """A client of a scheduler, or of a cluster of processes on this machine that ends with the block.

    A cluster of this machine listens on the loopback interface only, and has no dashboard.

    Parameters
    ----------
    scheduler, workers
        As in `run_sweep`.
    patience : float
        How long to wait for the scheduler and for its first worker, in s.

    Raises
    ------
    ClusterError
        If the scheduler does not answer or has no workers.
    """
    distributed = _distributed()
    if scheduler is not None:
        with _client_of(scheduler, patience) as client:
            yield client
        return
    with (
        distributed.LocalCluster(
            n_workers=workers,
            # The limit of one BLAS thread, which a solve sets and takes away again, is that of the whole process.
            threads_per_worker=1,
            host="127.0.0.1",
            dashboard_address="127.0.0.1:0",
            scheduler_kwargs={"dashboard": False},
            memory_limit=None,
            silence_logs="CRITICAL",
        ) as local,
        distributed.Client(local, set_as_default=False) as client,
    ):
        client.run(_leave_ctrl_c_to_the_client)
        yield client


def do(job: Job, task: Task) -> Result:
    """One task, on a worker."""
    start = time.process_time()
    found = job()
    return Result(task=task, found=found, seconds=time.process_time() - start)


def _client_of(scheduler: str, patience: float) -> "Client":
    distributed = _distributed()
    try:
        client = distributed.Client(scheduler, timeout=patience, set_as_default=False)
    except (OSError, ValueError) as wrong:
        raise ClusterError(f"scheduler: expected one at {scheduler}, got no answer; check the address") from wrong
    try:
        client.wait_for_workers(1, timeout=patience)
    except TimeoutError as wrong:
        client.close()
        raise ClusterError(f"scheduler: expected workers at {scheduler}, got none; start dask worker") from wrong
    return client


def _leave_ctrl_c_to_the_client() -> None:
    """A terminal sends Ctrl-C to every process; workers are closed by the one that started them."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _results(client: "Client", sweep: Sweep, tasks: Sequence[Task]) -> Iterator[Result]:
    """What each task found, as it comes."""
    futures: list[Any] = [
        # In the order of the tasks: whenever it is stopped, what is known is the beginning.
        client.submit(do, sweep.job(task), task, pure=False, priority=-number)
        for number, task in enumerate(tasks)
    ]
    for future in _distributed().as_completed(futures, loop=client.loop):
        if future.status != "finished":
            raise ClusterError(
                f"sweep: expected an answer of every worker, got {future.exception()!r}; what was found so far is "
                "stored, the same command goes on"
            )
        yield future.result()


def _distributed() -> Any:
    try:
        import distributed
    except ImportError as missing:
        raise MissingExtraError(
            "sweep: expected distributed, which is not installed; pip install 'midair[sweep]'"
        ) from missing
    return distributed
