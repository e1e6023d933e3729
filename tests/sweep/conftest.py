import json
import subprocess
import sys
import time
from contextlib import contextmanager, nullcontext

import pytest


@pytest.fixture
def here(monkeypatch):
    """Solve the tasks of a sweep in this process, in place of workers."""
    from midair.sweep import run as module
    from midair.version import __version__

    def results(_, sweep, tasks):
        return (module.task_content(sweep.job(task), task, __version__) for task in tasks)

    monkeypatch.setattr(module, "cluster", lambda *_, **__: nullcontext())
    monkeypatch.setattr(module, "_results", results)


@pytest.fixture(scope="session")
def threads():
    """A scheduler that clients reach over TCP, with one worker in a thread of this process."""
    import distributed

    @contextmanager
    def started():
        with distributed.LocalCluster(
            n_workers=1,
            threads_per_worker=1,
            processes=False,
            protocol="tcp",
            host="127.0.0.1",
            dashboard_address="127.0.0.1:0",
            silence_logs="CRITICAL",
        ) as local:
            yield local.scheduler_address

    return started


@pytest.fixture
def programs(tmp_path):
    """The programs `dask scheduler` and `dask worker`: (address, processes of the workers)."""

    @contextmanager
    def started(workers, protocol="tcp", options=(), environment=None):
        told = tmp_path / "scheduler.json"
        scheduler = [f"--protocol={protocol}", "--host=127.0.0.1", "--port=0", f"--scheduler-file={told}"]
        running = [_dask("scheduler", *scheduler, "--no-dashboard", *options, environment=environment)]
        try:
            until = time.monotonic() + 120
            while not told.exists() or not told.read_text():
                assert time.monotonic() < until
                assert running[0].poll() is None
                time.sleep(0.1)
            address = json.loads(told.read_text())["address"]
            worker = ["--nthreads=1", "--no-nanny", "--no-dashboard", f"--local-directory={tmp_path}"]
            running += [_dask("worker", address, *worker, *options, environment=environment) for _ in range(workers)]
            yield address, running[1:]
        finally:
            for one in running:
                one.kill()
                one.wait()

    return started


def _dask(*words, environment=None):
    return subprocess.Popen(
        [sys.executable, "-m", "dask", *words], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env=environment
    )
