"""Run a sweep with Dask, on a local cluster or on an existing one, and detect a cluster without live workers."""

import hashlib
import signal
import socket
import time
import warnings
from collections.abc import Generator, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import cache
from itertools import islice
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING, Any

import numpy as np

from midair.errors import ClusterError
from midair.model import Progress
from midair.processes import safe_path
from midair.sweep.storage import Job, Result, Task, sweep_package
from midair.sweep.store import Sweep, SweepAddress, open_sweep
from midair.version import __version__

if TYPE_CHECKING:
    from distributed import Client


class WorkerMonitor:
    """Monitor of the workers' heartbeats through their scheduler.

    Workers send heartbeats to their scheduler every half second or few seconds, also while they solve. The monitor only
    checks that the latest heartbeat changes within `patience` seconds of this process's own clock, so that a suspended
    computer or a wrong clock does not count as a failure.
    """

    def __init__(
        self, client: "Client", *, patience: float = 20.0, advice: str = "start workers (dask worker) and repeat"
    ) -> None:
        self._client = client
        self._patience, self._advice = patience, advice
        self._latest: object = None
        self._since = time.monotonic()
        self._threads, self._asked = 0, -np.inf

    def reset(self) -> None:
        """Restart the time limit after a response of a worker."""
        self._since = time.monotonic()

    def threads(self) -> int:
        """Number of threads of all workers, updated every two seconds because workers come and go."""
        if time.monotonic() - self._asked > 2:
            identity, self._asked = self._identity(), time.monotonic()
            if identity is not None:
                self._threads = sum(worker["nthreads"] for worker in identity["workers"].values())
        return self._threads

    def look(self) -> None:
        """Query the scheduler; raise a ClusterError if there was no heartbeat for too long."""
        found = self._identity()
        # Time of the latest heartbeat on the scheduler's clock; None without an answer or workers.
        latest = None if found is None else max((one["last_seen"] for one in found["workers"].values()), default=None)
        if latest is not None and latest != self._latest:
            self._latest = latest
            self.reset()
        elif time.monotonic() - self._since > self._patience:
            raise ClusterError(
                f"sweep: expected running workers, got no heartbeat for {self._patience:.0f} s; all results so far "
                f"are stored; {self._advice} the command to continue"
            )

    def _identity(self) -> Any:
        """Identity of the scheduler and its workers; None without an answer."""

        async def identity() -> Any:
            return await self._client.scheduler.identity()  # pyright: ignore[reportOptionalMemberAccess]

        try:
            return self._client.sync(identity, callback_timeout=5)
        except (OSError, TimeoutError, AttributeError):  # the scheduler is gone, or hangs
            return None


def run_sweep(
    sweep: Sweep,
    where: Path | str,
    *,
    scheduler: str | None = None,
    workers: int | None = None,
    progress: Progress | None = None,
) -> int:
    """Solve the missing tasks of a sweep, and store their results as they arrive.

    Each worker writes its results if it can access the store (a shared disk or an object store). Other results are sent
    to this process, which writes them. The command can be stopped at any time and started again: stored results are
    kept, and missing ones are computed. Raises MismatchError if the store contains another sweep; ClusterError if the
    cluster cannot be reached, a worker has another midair, a task fails, or no worker responds for 20 s; all results so
    far are stored.

    `where` is NAME.zarr, new or with the same sweep: a folder, or an address for fsspec, such as s3://bucket/all.zarr.
    `scheduler` is the address of a Dask scheduler, such as tls://host:8786, whose workers have midair installed, with
    the certificates of Dask's configuration; by default a local cluster that other machines cannot access, with
    `workers` processes (one per core by default). `progress` is called with (finished patterns or frames, all of them)
    at the start and after each task. Returns the number of patterns or frames solved by this call.
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
            # A local cluster starts lost workers again, which takes long on a busy computer.
            monitor = (
                WorkerMonitor(client, patience=120.0, advice="free memory and processors, and repeat")
                if scheduler is None
                else WorkerMonitor(client)
            )
            for result in _results(client, sweep, missing, store.address, monitor):
                store.write(result)
                done += result.task.count
                if progress is not None:
                    progress(done, whole)
    return done - first


@contextmanager
def cluster(scheduler: str | None = None, *, workers: int | None = None, patience: float = 10.0) -> "Generator[Client]":
    """Client of a scheduler, or of a local cluster that ends with the block.

    A local cluster listens on the loopback interface only, and has no dashboard. `patience` is the time limit for the
    scheduler and its first worker in s. Raises a ClusterError if there is no scheduler or no worker.
    """
    distributed = sweep_package("distributed")
    if scheduler is not None:
        with _client_of(scheduler, patience) as client:
            yield client
        return
    with (
        safe_path(),
        _local_cluster(workers) as local,
        distributed.Client(local, set_as_default=False) as client,
    ):
        client.run(_leave_ctrl_c_to_the_client)
        yield client


def _local_cluster(workers: int | None, *, tries: int = 3) -> Any:
    """A started local cluster; it is started again if one of its workers ends meanwhile."""
    distributed = sweep_package("distributed")
    for left in reversed(range(tries)):
        try:
            return distributed.LocalCluster(
                n_workers=workers,
                # A solve limits BLAS to one thread temporarily, which affects the whole process.
                threads_per_worker=1,
                host="127.0.0.1",
                dashboard_address="127.0.0.1:0",
                scheduler_kwargs={"dashboard": False},
                memory_limit=None,
                silence_logs="CRITICAL",
            )
        except (RuntimeError, TimeoutError) as wrong:
            if not left:
                raise ClusterError(
                    f"sweep: expected workers that start, got one that ended ({wrong}) in each of {tries} tries; all "
                    "results so far are stored; free memory and processors, and repeat the command to continue"
                ) from wrong
    return None


def do(job: Job, task: Task) -> Result:
    """Run one task on a worker."""
    start = time.process_time()
    found = job()
    return Result(task=task, found=found, seconds=time.process_time() - start)


@cache
def installed_code() -> str:
    """Version of midair in this process, and the first digits of the SHA-256 of its source files."""
    folder, digest = Path(__file__).parents[1], hashlib.sha256()
    for file in sorted(folder.rglob("*.py"), key=Path.as_posix):
        digest.update(file.relative_to(folder).as_posix().encode() + b"\0" + file.read_bytes())
    return f"{__version__}, code {digest.hexdigest()[:12]}"


def done_and_stored(job: Job, task: Task, address: SweepAddress, code: str) -> Result:
    """Run one task on a worker, which stores the result if it can access the store.

    Raises a ClusterError if the worker has other code than the command. Each task is checked, because workers may join
    at any time.
    """
    if installed_code() != code:
        raise ClusterError(
            f"sweep: expected workers with midair {code}, got {installed_code()} on {socket.gethostname()}; install "
            "the same version there and restart the workers; all results so far are stored"
        )
    return address.take(do(job, task))


def _client_of(scheduler: str, patience: float) -> "Client":
    distributed = sweep_package("distributed")
    if scheduler.startswith("tls://") and not distributed.Security().get_connection_args("client").get("ssl_context"):
        raise ClusterError(
            f"scheduler: expected a certificate for {scheduler}, got none; "
            "set distributed.comm.tls in Dask's configuration"
        )
    try:
        client = distributed.Client(scheduler, timeout=patience, set_as_default=False)
    except (OSError, ValueError) as wrong:
        raise ClusterError(
            f"scheduler: expected one at {scheduler}, got no answer; check the address, and use tls:// if it requires "
            "a certificate"
        ) from wrong
    try:
        client.wait_for_workers(1, timeout=patience)
    except TimeoutError as wrong:
        client.close()
        raise ClusterError(f"scheduler: expected workers at {scheduler}, got none; start dask worker") from wrong
    return client


def _leave_ctrl_c_to_the_client() -> None:
    """Ignore Ctrl-C, which a terminal sends to every process, because the client closes its workers."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _results(
    client: "Client", sweep: Sweep, tasks: Sequence[Task], address: SweepAddress, watch: WorkerMonitor
) -> Iterator[Result]:
    finished: SimpleQueue[Any] = SimpleQueue()
    waiting: set[Any] = set()
    coming = enumerate(tasks)
    while True:
        # A task may hold several megabytes, so submit only as many as keep the workers busy.
        for number, task in islice(coming, max(0, 2 * watch.threads() + 2 - len(waiting))):
            # Keep the order of the tasks, so that a stopped sweep has its first tasks complete.
            with warnings.catch_warnings():
                # The amount of queued data is limited here; Dask warns above 10 MB.
                warnings.filterwarnings("ignore", message="Sending large graph", category=UserWarning)
                future = client.submit(
                    done_and_stored, sweep.job(task), task, address, installed_code(), pure=False, priority=-number
                )
            waiting.add(future)
            future.add_done_callback(finished.put)
        if not waiting:
            return
        ended = _next(finished)
        try:
            results = _gathered(client, [future for future in ended if future.status == "finished"])
        except TimeoutError:  # their worker is lost or busy; the tasks of a lost worker are repeated
            for future in ended:
                finished.put(future)
            watch.look()
            continue
        yield from results
        _check(ended)
        waiting.difference_update(ended)
        if results:
            watch.reset()
        else:
            watch.look()


def _next(finished: "SimpleQueue[Any]", *, patience: float = 1.0, most: int = 256) -> list[Any]:
    """Futures that ended since the last call; waits briefly for the first, and returns many to save round trips."""
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
    """Raise a ClusterError if a task failed or the scheduler was lost."""
    wrong = next((future for future in ended if future.status not in ("finished", "pending")), None)
    if wrong is not None:
        if isinstance(refused := wrong.exception() if wrong.status == "error" else None, ClusterError):
            raise refused
        cause = repr(wrong.exception()) if wrong.status == "error" else "a lost connection to the scheduler"
        raise ClusterError(
            f"sweep: expected an answer of every worker, got {cause}; all results so far are stored, repeat the "
            "command to continue"
        )
