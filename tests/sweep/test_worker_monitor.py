"""A cluster without live workers is reported within half a minute, with all results stored."""

import signal
import subprocess
import sys
import time
from contextlib import nullcontext
from types import SimpleNamespace

import numpy as np
import pytest

from midair.errors import ClusterError
from midair.sweep.run import WorkerMonitor
from midair.sweep.store import load_sweep


class FakeClient:
    """A client whose scheduler gives prepared answers."""

    def __init__(self, *answers):
        self.answers = list(answers)

    def sync(self, _, callback_timeout):
        answer = self.answers.pop(0)
        if isinstance(answer, Exception):
            raise answer
        return {"workers": {str(number): {"last_seen": seen} for number, seen in enumerate(answer)}}


def test_a_heartbeat_of_any_worker_is_enough():
    watch = WorkerMonitor(FakeClient([1.0, 5.0], [1.0, 6.0], [1.0, 7.0]), patience=0.0)
    for _ in range(3):
        watch.look()


@pytest.mark.parametrize(
    "silent", [[], [5.0], OSError("gone"), TimeoutError()], ids=["none", "stopped", "gone", "hangs"]
)
def test_no_new_heartbeat_is_an_error(silent):
    watch = WorkerMonitor(FakeClient([5.0], silent), patience=0.0)
    watch.look()
    time.sleep(0.01)
    with pytest.raises(ClusterError, match="no heartbeat"):
        watch.look()


@pytest.mark.parametrize("answered", [True, False])
def test_an_answer_counts_as_a_heartbeat(answered, monkeypatch):
    clock = iter([0.0, 0.0, *([50.0] if answered else []), 70.0]).__next__
    monkeypatch.setattr("midair.sweep.run.time", SimpleNamespace(monotonic=clock))
    watch = WorkerMonitor(FakeClient([5.0], []), patience=60.0)
    watch.look()
    if answered:
        watch.reset()
    with nullcontext() if answered else pytest.raises(ClusterError, match="no heartbeat"):
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
