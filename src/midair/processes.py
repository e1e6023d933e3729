"""Child processes of Python, which import nothing from the current folder: it may hold the files of a stranger."""

import os
import signal
import sys
from collections.abc import Callable, Generator
from contextlib import contextmanager, suppress
from threading import Lock
from typing import TYPE_CHECKING, Any

from midair.errors import ClusterError, InputError

if TYPE_CHECKING:
    from multiprocessing.context import SpawnProcess
    from multiprocessing.synchronize import Event

SAFE_PATH = "PYTHONSAFEPATH"
"""Environment variable with which Python, as with its option -P, does not look for modules in the current folder."""

_lock, _blocks = Lock(), 0
_before: str | None = None


def protect_command() -> None:
    """Import nothing from the current folder, where ``python -m`` puts it first, in this program and its children."""
    os.environ[SAFE_PATH] = "1"
    with suppress(FileNotFoundError):
        if not sys.flags.safe_path and sys.path[:1] == [os.getcwd()]:
            del sys.path[0]


def python_command(*words: str) -> list[str]:
    """Command line of another Python program: its options, file or module, and arguments."""
    return [sys.executable, "-P", *words]


@contextmanager
def safe_path() -> Generator[None]:
    """Let no Python process that starts within the block import from the current folder.

    Raises InputError if this program runs with ``python -E``, whose children would not read the environment.
    """
    global _blocks, _before
    if sys.flags.ignore_environment and not sys.flags.safe_path:
        raise InputError(f"python -E: expected child processes that read {SAFE_PATH}, got none; add -P, or use -I")
    with _lock:
        if not _blocks:
            _before, os.environ[SAFE_PATH] = os.environ.get(SAFE_PATH), "1"
        _blocks += 1
    try:
        yield
    finally:
        with _lock:
            _blocks -= 1
            if not _blocks:
                del os.environ[SAFE_PATH]
                os.environ.update({} if _before is None else {SAFE_PATH: _before})


def start_process(target: Callable[..., object], *arguments: Any, name: str, daemon: bool = True) -> "SpawnProcess":
    """Start a process that runs ``target(*arguments)``."""
    from multiprocessing import get_context

    process = get_context("spawn").Process(target=target, args=arguments, name=name, daemon=daemon)
    with safe_path():
        process.start()
    return process


def shared_event() -> "Event":
    """Return an event to pass to `start_process`; the first one starts a process that tracks them."""
    from multiprocessing import get_context

    with safe_path():
        return get_context("spawn").Event()


@contextmanager
def local_cluster(workers: int | None = None) -> Generator[Any]:
    """Dask processes, one per core by default, on the loopback interface only and without dashboard."""
    import dask
    from distributed import Client

    # Dask's 64 KiB let each step fetch its memory from the system anew.
    memory = {"distributed.nanny.pre-spawn-environ.MALLOC_TRIM_THRESHOLD_": 2**28}
    with safe_path(), dask.config.set(memory), _started_cluster(workers) as local:
        with Client(local, set_as_default=False) as client:
            client.run(_ignore_ctrl_c)
        yield local


def _ignore_ctrl_c() -> None:
    """Ignore Ctrl-C, which a terminal sends to every process, because the command closes its workers."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _started_cluster(workers: int | None, *, tries: int = 3) -> Any:
    """A started cluster; it is started again if one of its workers ends meanwhile."""
    import distributed

    cluster: Any = distributed.LocalCluster
    while True:
        try:
            return cluster(
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
            tries -= 1
            if not tries:
                raise ClusterError(
                    f"expected worker processes that start, got one that ended ({wrong}) in each try; free memory and "
                    "processors, and repeat the command"
                ) from wrong
