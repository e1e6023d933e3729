import json
import subprocess
import sys
from contextlib import contextmanager, nullcontext

import pytest
from tests.waiting import wait_until


@pytest.fixture
def here(monkeypatch):
    """Solve the tasks of a sweep in this process, in place of workers."""
    from midair.sweep import run as module
    from midair.version import __version__

    def results(_, sweep, tasks):
        return (module.task_content(sweep.job(task), task, __version__) for task in tasks)

    monkeypatch.setattr(module, "cluster", lambda *_, **__: nullcontext())
    monkeypatch.setattr(module, "_results", results)


@pytest.fixture
def programs(tmp_path):
    """The programs `dask scheduler` and `dask worker`: (address, processes of the workers)."""

    @contextmanager
    def started(workers, protocol="tcp", options=(), environment=None):
        def dask(*words):
            quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
            return subprocess.Popen([sys.executable, "-m", "dask", *words, *options], env=environment, **quiet)

        told = tmp_path / "scheduler.json"
        here = [f"--protocol={protocol}", "--host=127.0.0.1", "--port=0", f"--scheduler-file={told}"]
        running = [dask("scheduler", *here, "--no-dashboard")]
        try:
            wait_until(lambda: (told.exists() and told.read_text()) or running[0].poll() is not None, 120)
            address = json.loads(told.read_text())["address"]
            worker = ["--nthreads=1", "--no-nanny", "--no-dashboard", f"--local-directory={tmp_path}"]
            running += [dask("worker", address, *worker) for _ in range(workers)]
            yield address, running[1:]
        finally:
            for one in running:
                one.kill()
                one.wait()

    return started
