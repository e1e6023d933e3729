"""Sweeps on real Dask workers, also with a real kill."""

import os
import re
import shutil
import signal
import subprocess
import sys
import urllib.request
from contextlib import suppress
from http.client import HTTPException
from pathlib import Path

import numpy as np
import psutil
import pytest
from tests.waiting import wait_until

from midair import processes
from midair.errors import ClusterError, MidairError
from midair.sweep import PatternSweep, load_sweep, run_sweep
from midair.sweep import run as module
from midair.sweep.run import cluster

SWEEP = PatternSweep(count=10, chunk=4, strengths=(0.1, 0.2), iterations=2)


HERE = {"protocol": "tcp", "host": "127.0.0.1", "dashboard_address": "127.0.0.1:0", "silence_logs": "CRITICAL"}
"""A cluster on this machine that clients reach over TCP."""


@pytest.fixture(scope="module")
def scheduler():
    """Address of a cluster with one worker in a thread of this process."""
    import distributed

    with distributed.LocalCluster(n_workers=1, threads_per_worker=1, processes=False, **HERE) as local:
        yield local.scheduler_address


def expected(sweep):
    error = np.full((len(sweep.conditions()), sweep.count), np.nan)
    for task in sweep.tasks():
        error[task.condition, task.first : task.last] = sweep.job(task)()["error"]
    return error


@pytest.mark.long
def test_a_cluster_equals_one_process_and_is_resumed(tmp_path, scheduler, monkeypatch):
    def stop(done, _):
        if done:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_sweep(SWEEP, tmp_path / "s", scheduler=scheduler, progress=stop)
    known = int(np.isfinite(load_sweep(tmp_path / "s").error).sum())
    assert 0 < known < 20
    content = module.task_content
    monkeypatch.setattr(
        module, "task_content", lambda job, task, version: 1 / 0 if task.first == 8 else content(job, task, version)
    )
    with pytest.raises(MidairError, match=r"ZeroDivisionError.*stored"):
        run_sweep(SWEEP, tmp_path / "s", scheduler=scheduler)
    monkeypatch.undo()
    assert 0 < run_sweep(SWEEP, tmp_path / "s", scheduler=scheduler) < 20 - known
    np.testing.assert_allclose(load_sweep(tmp_path / "s").error, expected(SWEEP), rtol=1e-9)
    # A finished sweep needs no cluster.
    assert run_sweep(SWEEP, tmp_path / "s", scheduler="tcp://127.0.0.1:1") == 0


def test_workers_with_another_version_are_refused():
    task = SWEEP.tasks()[0]
    with pytest.raises(ClusterError, match=r"expected midair 0\.0\.9, got "):
        module.task_content(SWEEP.job(task), task, "0.0.9")


def test_a_local_cluster_starts_again_if_a_worker_ends_at_its_start(monkeypatch):
    """Before, it was an error of midair to report."""
    import distributed

    tried = []

    def started(**_):
        tried.append(None)
        if len(tried) != 3:
            raise RuntimeError("Nanny failed to start.")
        return "started"

    monkeypatch.setattr(distributed, "LocalCluster", started)
    assert processes._started_cluster(2) == "started"
    with pytest.raises(ClusterError, match=r"got one that ended \(Nanny failed to start\.\) in each try.*repeat"):
        processes._started_cluster(2)


def test_an_address_without_a_scheduler_or_without_workers_is_one_line():
    import distributed

    with pytest.raises(MidairError, match=r"tcp://127\.0\.0\.1:1"), cluster("tcp://127.0.0.1:1", patience=0.5):
        pass
    with (
        distributed.LocalCluster(n_workers=0, **HERE) as empty,
        pytest.raises(MidairError, match="expected one with workers"),
        cluster(empty.scheduler_address, patience=0.5),
    ):
        pass


@pytest.mark.slow
def test_a_killed_sweep_continues_without_losing_or_repeating_anything(tmp_path):
    """SIGKILL while two worker processes are busy; every stored task keeps its processor time."""
    path = tmp_path / "s.sweep"
    sweep = PatternSweep(count=160, chunk=8, strengths=(0.1,), method="fast")
    command = ["sweep", "patterns", str(path), "--count", "160", "--chunk", "8", "--strength", "0.1"]
    program = [sys.executable, "-c", "from midair.cli import main; main()", *command, "--workers", "2"]
    running = subprocess.Popen(program, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    children = []
    try:
        wait_until(lambda: _stored(path), 120)
        children = psutil.Process(running.pid).children(recursive=True)
    finally:
        os.kill(running.pid, signal.SIGKILL)
        running.wait()
    before = _stored(path)
    assert 0 < len(before) < len(sweep.tasks())
    gone, alive = psutil.wait_procs(children, timeout=30)
    assert len(gone) >= 2
    assert not alive

    again = subprocess.run(program, capture_output=True, text=True, check=False)
    assert again.returncode == 0, again.stderr
    assert before.items() <= _stored(path).items()
    np.testing.assert_allclose(load_sweep(path).error, expected(sweep), rtol=1e-6)


def _stored(path):
    """Content of each file of results, which has the processor time of its task."""
    return {file.name: file.read_bytes() for file in path.glob("*.npz")}


@pytest.mark.slow
def test_a_killed_worker_loses_only_its_task_and_a_lost_scheduler_is_one_line(tmp_path, programs):
    path = tmp_path / "s.sweep"
    ask = ["sweep", "patterns", str(path), "--chunk", "8", "--strength", "0.1", "--count"]
    command = [sys.executable, "-m", "midair", *ask]
    with programs(2) as (address, workers):
        running = subprocess.Popen([*command, "160", "--scheduler", address], stdout=subprocess.DEVNULL)
        wait_until(lambda: _stored(path), 120)
        before = _stored(path)
        workers[0].kill()
        assert running.wait(timeout=300) == 0
        assert before.items() <= _stored(path).items()
        assert load_sweep(path).complete
        ask[2] = str(tmp_path / "t.sweep")
        running = subprocess.Popen(
            [sys.executable, "-m", "midair", *ask, "4000", "--scheduler", address],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
        )
        wait_until(lambda: _stored(tmp_path / "t.sweep"), 120)
    said = running.communicate(timeout=120)[1]
    assert running.returncode == 1
    assert "Traceback" not in said
    lines = [line for line in said.splitlines() if line.startswith("midair: ")]
    assert len(lines) == 1
    assert "all results so far are stored" in lines[0]


@pytest.mark.slow
def test_a_tls_scheduler_requires_a_certificate(tmp_path, programs):
    """As in docs/sweep.md: one certificate for a group, in Dask's own settings."""
    if shutil.which("openssl") is None:
        pytest.skip("no openssl to make a certificate with")
    make = ["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "1", "-subj", "/CN=sweep"]
    subprocess.run([*make, "-keyout", "key.pem", "-out", "cert.pem"], cwd=tmp_path, check=True, capture_output=True)
    key, cert = str(tmp_path / "key.pem"), str(tmp_path / "cert.pem")
    options = [f"--tls-ca-file={cert}", f"--tls-cert={cert}", f"--tls-key={key}"]
    page = (Path(__file__).parents[2] / "docs" / "sweep.md").read_text()
    pages = dict(re.findall(r"(DASK_DISTRIBUTED__\w+__HTTP__ROUTES)='(.+?)'", page))
    with programs(1, protocol="tls", options=options, environment=os.environ | pages) as (address, _):
        assert address.startswith("tls://")
        ask = ["sweep", "patterns", "s.sweep", "--count", "8", "--chunk", "4", "--iterations", "2"]
        command = [sys.executable, "-m", "midair", *ask, "--scheduler"]

        def run(address, **more):
            environment = {**os.environ, **more}
            return subprocess.run(
                [*command, address], cwd=tmp_path, capture_output=True, text=True, check=False, env=environment
            )

        for refused in (run(address), run(address.replace("tls://", "tcp://"))):
            assert refused.returncode == 1
            assert "Traceback" not in refused.stderr
            lines = [line for line in refused.stderr.splitlines() if line.startswith("midair: ")]
            assert len(lines) == 1
            assert "certificate" in lines[0]
        tls = "DASK_DISTRIBUTED__COMM__TLS__"
        allowed = run(address, **{f"{tls}CA_FILE": cert, f"{tls}CLIENT__CERT": cert, f"{tls}CLIENT__KEY": key})
        assert _plain_answers(psutil.Process().children(recursive=True)) == []
    assert allowed.returncode == 0, allowed.stderr
    assert np.isfinite(load_sweep(tmp_path / "s.sweep").error).sum() == 16


def _plain_answers(processes):
    """Pages that processes give to a client without a certificate, on any port on which they listen."""
    found, ports = [], 0
    for process in processes:
        for socket in process.net_connections(kind="inet"):
            if socket.status != psutil.CONN_LISTEN:
                continue
            ports += 1
            for name in ("info/main/workers.html", "json/counts.json", "health", "metrics", "status"):
                url = f"http://127.0.0.1:{socket.laddr.port}/{name}"
                with suppress(OSError, HTTPException), urllib.request.urlopen(url, timeout=30) as page:
                    found.append((url, page.status))
    assert ports >= 2  # of the scheduler and the worker
    return found
