"""Sweeps on real Dask workers, also with a real kill."""

import os
import re
import shutil
import signal
import subprocess
import sys
import time
import urllib.request
from contextlib import suppress
from dataclasses import replace
from http.client import HTTPException
from pathlib import Path

import numpy as np
import psutil
import pytest
from tests.waiting import wait_until

import midair
from midair.errors import ClusterError, MidairError
from midair.sweep import run as module
from midair.sweep.pattern_sweep import PatternSweep, solve_patterns
from midair.sweep.run import WorkerMonitor, cluster, run_sweep
from midair.sweep.store import SweepStore, load_sweep, open_sweep

SWEEP = PatternSweep(count=10, curve_count=3, chunk=4, strengths=(0.1,), curve_heights=(0.3,), method="naive")

PRELOADED = {"DASK_DISTRIBUTED__WORKER__PRELOAD": '["midair.sweep"]'}
"""On a busy machine a worker that imports midair for its first task sends no heartbeat for too long."""


@pytest.fixture(scope="module")
def scheduler(threads):
    """A scheduler on this machine that clients reach over TCP, with one worker in a thread."""
    with threads() as address:
        yield address


def asked(sweep):
    return sum(one.count for one in sweep.conditions())


def expected(sweep):
    error = np.full((len(sweep.conditions()), len(sweep.patterns())), np.nan)
    for task in sweep.tasks():
        some = sweep.patterns()[task.first : task.last]
        solved = solve_patterns(sweep, sweep.conditions()[task.condition], some)
        error[task.condition, task.first : task.last] = solved.error
    return error


@pytest.mark.long
def test_a_cluster_equals_one_process(tmp_path, scheduler):
    reports = []
    solved = run_sweep(SWEEP, tmp_path / "s.zarr", scheduler=scheduler, progress=lambda *said: reports.append(said))
    results = load_sweep(tmp_path / "s.zarr")
    np.testing.assert_allclose(results.error, expected(SWEEP), rtol=1e-9)
    assert solved == asked(SWEEP) == results.known
    assert reports[0] == (0, solved)
    assert reports[-1] == (solved, solved)
    assert len(reports) == len(SWEEP.tasks()) + 1


@pytest.mark.long
def test_a_finished_sweep_needs_no_cluster(tmp_path, scheduler):
    run_sweep(SWEEP, tmp_path / "s.zarr", scheduler=scheduler)
    assert run_sweep(SWEEP, tmp_path / "s.zarr", scheduler="tcp://127.0.0.1:1") == 0


@pytest.mark.long
def test_stopped_and_started_again_it_does_only_what_is_missing(tmp_path, scheduler):
    def stop(done, _):
        if done:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_sweep(SWEEP, tmp_path / "s.zarr", scheduler=scheduler, progress=stop)
    before, done = _stored(tmp_path / "s.zarr")
    known = load_sweep(tmp_path / "s.zarr").known
    assert 0 < known < asked(SWEEP)
    # A worker finishes and stores its current task.
    assert 0 < run_sweep(SWEEP, tmp_path / "s.zarr", scheduler=scheduler) <= asked(SWEEP) - known
    np.testing.assert_array_equal(_stored(tmp_path / "s.zarr")[0][done], before[done])
    np.testing.assert_allclose(load_sweep(tmp_path / "s.zarr").error, expected(SWEEP), rtol=1e-9)


@pytest.mark.long
def test_a_failed_task_is_one_line_and_loses_nothing_else(tmp_path, scheduler, monkeypatch):
    do = module.do
    monkeypatch.setattr(module, "do", lambda job, task: 1 / 0 if task.first == 8 else do(job, task))
    with pytest.raises(MidairError, match=r"ZeroDivisionError.*stored"):
        run_sweep(SWEEP, tmp_path / "s.zarr", scheduler=scheduler)
    monkeypatch.undo()
    run_sweep(SWEEP, tmp_path / "s.zarr", scheduler=scheduler)
    np.testing.assert_allclose(load_sweep(tmp_path / "s.zarr").error, expected(SWEEP), rtol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("file", "before", "after", "found"),
    [
        ("version.py", f'"{midair.__version__}"', '"0.0.9"', "got 0.0.9, code "),
        (
            "sweep/pattern_sweep.py",
            "error=solved.error",
            "error=1.1 * solved.error",
            f"got {midair.__version__}, code ",
        ),
    ],
)
def test_workers_with_other_code_are_refused(tmp_path, programs, file, before, after, found):
    copy = tmp_path / "other" / "midair"
    shutil.copytree(Path(midair.__file__).parent, copy, ignore=shutil.ignore_patterns("__pycache__"))
    source = (copy / file).read_text()
    (copy / file).write_text(source.replace(before, after))
    assert (copy / file).read_text() != source
    with (
        programs(1, environment=os.environ | PRELOADED | {"PYTHONPATH": str(copy.parent)}) as (address, _),
        pytest.raises(ClusterError, match=found),
    ):
        with cluster(address, patience=120):
            pass
        run_sweep(SWEEP, tmp_path / "s.zarr", scheduler=address)
    assert load_sweep(tmp_path / "s.zarr").known == 0


@pytest.mark.long
def test_workers_write_their_results_themselves(tmp_path, scheduler, monkeypatch):
    monkeypatch.setattr(SweepStore, "write", lambda store, result: written.append(result.found))
    written = []
    run_sweep(SWEEP, tmp_path / "s.zarr", scheduler=scheduler)
    assert written == [None] * len(SWEEP.tasks())
    np.testing.assert_allclose(load_sweep(tmp_path / "s.zarr").error, expected(SWEEP), rtol=1e-9)


@pytest.mark.long
def test_a_store_that_workers_cannot_access_is_written_by_the_command(tmp_path, scheduler, monkeypatch):
    """As on machines without a shared disk, where the folder name refers to another folder or none."""
    place = SweepStore.address.fget
    elsewhere = tmp_path / "elsewhere.zarr"
    other = property(lambda store: replace(place(store), place=str(elsewhere)))
    monkeypatch.setattr(SweepStore, "address", other)
    run_sweep(SWEEP, tmp_path / "none.zarr", scheduler=scheduler)
    assert not elsewhere.exists()
    with open_sweep(elsewhere, SWEEP):
        pass
    run_sweep(SWEEP, tmp_path / "other.zarr", scheduler=scheduler)
    assert load_sweep(elsewhere).known == 0
    for name in ("none.zarr", "other.zarr"):
        np.testing.assert_allclose(load_sweep(tmp_path / name).error, expected(SWEEP), rtol=1e-9)


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
    assert module._local_cluster(2) == "started"
    with pytest.raises(
        ClusterError, match=r"got one that ended \(Nanny failed to start\.\) in each of 3 tries.*repeat"
    ):
        module._local_cluster(2)


def test_an_address_without_a_scheduler_is_one_line():
    with pytest.raises(MidairError, match=r"tcp://127\.0\.0\.1:1"), cluster("tcp://127.0.0.1:1", patience=0.5):
        pass


def test_a_scheduler_without_workers_is_one_line():
    import distributed

    with (
        distributed.LocalCluster(
            n_workers=0, protocol="tcp", host="127.0.0.1", dashboard_address="127.0.0.1:0", silence_logs="CRITICAL"
        ) as empty,
        pytest.raises(MidairError, match="expected workers"),
        cluster(empty.scheduler_address, patience=0.5),
    ):
        pass


@pytest.mark.slow
def test_a_killed_sweep_continues_without_losing_or_repeating_anything(tmp_path):
    """SIGKILL while two worker processes are busy; every stored task keeps its processor time."""
    path = tmp_path / "s.zarr"
    sweep = PatternSweep(count=160, curve_count=0, chunk=8, strengths=(0.1,), method="fast")
    command = ["sweep", "patterns", str(path), "--count", "160", "--curves", "0", "--chunk", "8", "--strength", "0.1"]
    program = [sys.executable, "-c", "from midair.cli import main; main()", *command, "--workers", "2"]
    running = subprocess.Popen(program, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    children = []
    try:
        wait_until(lambda: path.exists() and load_sweep(path).known > 0, 120)
        children = psutil.Process(running.pid).children(recursive=True)
    finally:
        os.kill(running.pid, signal.SIGKILL)
        running.wait()
    before, done = _stored(path)
    assert 0 < done.sum() < done.size
    gone, alive = psutil.wait_procs(children, timeout=30)
    assert len(gone) >= 2
    assert not alive

    again = subprocess.run(program, capture_output=True, text=True, check=False)
    assert again.returncode == 0, again.stderr
    after, finished = _stored(path)
    np.testing.assert_array_equal(after[done], before[done])
    assert finished.all()
    np.testing.assert_allclose(load_sweep(path).error, expected(sweep), rtol=1e-6)


def _stored(path):
    import zarr

    group = zarr.open_group(path, mode="r")
    return group["seconds"][:], group["done"][:]


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
    with programs(1, protocol="tls", options=options, environment=os.environ | PRELOADED | pages) as (address, _):
        assert address.startswith("tls://")
        ask = ["sweep", "patterns", "s.zarr", "--count", "8", "--curves", "0", "--chunk", "4", "--method", "naive"]
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
    assert load_sweep(tmp_path / "s.zarr").known == 16


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


class FakeClient:
    def __init__(self, *answers):
        self.answers = list(answers)

    def sync(self, _, callback_timeout):
        answer = self.answers.pop(0)
        if isinstance(answer, Exception):
            raise answer
        return {"workers": {str(number): {"last_seen": seen} for number, seen in enumerate(answer)}}


@pytest.mark.parametrize(
    "silent", [[], [5.0], OSError("gone"), TimeoutError()], ids=["none", "stopped", "gone", "hangs"]
)
def test_no_new_heartbeat_is_an_error(silent):
    watch = WorkerMonitor(FakeClient([5.0], silent), patience=0.0)
    watch.look()
    time.sleep(0.01)
    with pytest.raises(ClusterError, match="no heartbeat"):
        watch.look()


@pytest.mark.slow
@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGSTOP], ids=["killed", "stopped"])
def test_lost_workers_are_one_line_and_no_result_is_lost(how, tmp_path, programs):
    """The workers of a real scheduler are killed as soon as a result is stored; others then complete the sweep."""
    path = tmp_path / "s.zarr"
    with programs(2) as (address, workers):
        ask = ["sweep", "patterns", str(path), "--count", "400", "--curves", "0", "--chunk", "8", "--strength", ".1"]
        command = [sys.executable, "-m", "midair", *ask]
        running = subprocess.Popen(
            [*command, "--scheduler", address], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
        )
        while not (path.exists() and load_sweep(path).known):
            assert running.poll() is None
            time.sleep(0.1)
        for worker in workers:
            worker.send_signal(how)
        gone = time.monotonic()
        said = running.communicate(timeout=120)[1]
        print(f"said after {time.monotonic() - gone:.1f} s")
    assert running.returncode == 1
    lines = [line for line in said.splitlines() if line.startswith("midair: ")]
    assert len(lines) == 1
    assert "no heartbeat" in said
    assert "Traceback" not in said
    before = load_sweep(path).error
    assert 0 < np.isfinite(before).sum() < 400
    assert subprocess.run([*command, "--workers", "2"], capture_output=True, check=False).returncode == 0
    after = load_sweep(path).error
    np.testing.assert_array_equal(after[np.isfinite(before)], before[np.isfinite(before)])
    assert np.isfinite(after).all()
