"""Run a sweep on Dask: a cluster on this machine, or one that is already there."""

import signal
import time
import warnings
from collections.abc import Generator, Iterator, Sequence
from contextlib import contextmanager, suppress
from itertools import islice
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING, Any

from midair.errors import ClusterError, MissingExtraError
from midair.model import Progress
from midair.sweep.region import SweepAddress
from midair.sweep.store import open_sweep
from midair.sweep.task import Job, Result, Sweep, Task
from midair.sweep.watch import WorkersWatch

if TYPE_CHECKING:
    from distributed import Client


def run_sweep(
    sweep: Sweep,
    where: Path | str,
    *,
    scheduler: str | None = None,
    workers: int | None = None,
    progress: Progress | None = None,
) -> int:
    """Solve whatever is missing of a sweep, and store it as it comes.

    Each worker writes what it found where it sees the store: on a common disk, or in an object store. The results
    of others come here, and this process writes them. Killed at any moment, it can be started again: what is stored
    stays, and what is not is done.

    Parameters
    ----------
    sweep : Sweep
        What to solve.
    where : Path or str
        NAME.zarr, new or of the same sweep: a folder, or an address that fsspec knows, such as s3://bucket/all.zarr.
    scheduler : str, optional
        Address of a Dask scheduler, such as tls://host:8786, whose workers have midair installed; a cluster on this
        machine, reachable from nowhere else, if None. Certificates are those of Dask's configuration.
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
        If the cluster cannot be reached, a task fails, or no worker is heard of for 20 s; what was found so far is
        stored.
    """
    whole = sum(task.count for task in sweep.tasks())
    with open_sweep(where, sweep) as store:
        missing = store.missing()
        first = done = whole - sum(task.count for task in missing)
        if progress is not None:
            progress(done, whole)
        if not missing:
            return 0
        with cluster(scheduler, workers=workers) as client:
            for result in _results(client, sweep, missing, store.address):
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


def done_and_stored(job: Job, task: Task, address: SweepAddress | None) -> Result:
    """One task, on a worker that stores what it found where it sees the store."""
    result = do(job, task)
    return result if address is None else address.take(result)


def _client_of(scheduler: str, patience: float) -> "Client":
    distributed = _distributed()
    if scheduler.startswith("tls://") and not distributed.Security().get_connection_args("client").get("ssl_context"):
        raise ClusterError(
            f"scheduler: expected a certificate for {scheduler}, got none; "
            "set distributed.comm.tls in Dask's configuration"
        )
    try:
        client = distributed.Client(scheduler, timeout=patience, set_as_default=False)
    except (OSError, ValueError) as wrong:
        raise ClusterError(
            f"scheduler: expected one at {scheduler}, got no answer; check the address, and tls:// where it wants a "
            "certificate"
        ) from wrong
    try:
        client.wait_for_workers(1, timeout=patience)
    except TimeoutError as wrong:
        client.close()
        raise ClusterError(f"scheduler: expected workers at {scheduler}, got none; start dask worker") from wrong
    return client


def _leave_ctrl_c_to_the_client() -> None:
    """A terminal sends Ctrl-C to every process; workers are closed by the one that started them."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _results(client: "Client", sweep: Sweep, tasks: Sequence[Task], address: SweepAddress | None) -> Iterator[Result]:
    """What came of each task, as it comes."""
    finished: SimpleQueue[Any] = SimpleQueue()
    waiting: set[Any] = set()
    coming, watch = enumerate(tasks), WorkersWatch(client)
    while True:
        # A task may bring some megabytes along: no more of them wait at the scheduler than keep its workers busy.
        for number, task in islice(coming, max(0, 2 * watch.threads() + 2 - len(waiting))):
            # In the order of the tasks: whenever it is stopped, what is known is the beginning.
            future = _submitted(client, sweep.job(task), task, address, -number)
            waiting.add(future)
            future.add_done_callback(finished.put)
        if not waiting:
            return
        ended = _next(finished)
        try:
            results = _gathered(client, [future for future in ended if future.status == "finished"])
        except TimeoutError:  # who held them is gone or busy; if it is gone, they are done again
            for future in ended:
                finished.put(future)
            watch.look()
            continue
        yield from results
        _check(ended)
        waiting.difference_update(ended)
        if results:
            watch.heard()
        else:
            watch.look()


def _submitted(client: "Client", job: Job, task: Task, address: SweepAddress | None, priority: int) -> Any:
    with warnings.catch_warnings():
        # What a task brings along is counted by whom it is for; Dask warns above 10 MB.
        warnings.filterwarnings("ignore", message="Sending large graph", category=UserWarning)
        return client.submit(done_and_stored, job, task, address, pure=False, priority=priority)


def _next(finished: "SimpleQueue[Any]", *, patience: float = 1.0, most: int = 256) -> list[Any]:
    """Those that ended since the last call; waits a little for the first, and asks for few round trips."""
    ended: list[Any] = []
    with suppress(Empty):
        ended.append(finished.get(timeout=patience))
        while len(ended) < most:
            ended.append(finished.get_nowait())
    return ended


def _gathered(client: "Client", futures: list[Any]) -> list[Result]:
    if not futures:
        return []

    async def gathered() -> Any:
        coming: Any = client.gather(futures, asynchronous=True)
        return await coming

    results: Any = client.sync(gathered, callback_timeout=5)
    return results


def _check(ended: list[Any]) -> None:
    """Say in one line that a task failed, or that the scheduler went away with it."""
    wrong = next((future for future in ended if future.status not in ("finished", "pending")), None)
    if wrong is not None:
        said = repr(wrong.exception()) if wrong.status == "error" else "no more of the scheduler"
        raise ClusterError(
            f"sweep: expected an answer of every worker, got {said}; what was found so far is stored, the same command "
            "goes on"
        )


def _distributed() -> Any:
    try:
        import distributed
    except ImportError as missing:
        raise MissingExtraError(
            "sweep: expected distributed, which is not installed; pip install 'midair[sweep]'"
        ) from missing
    return distributed
