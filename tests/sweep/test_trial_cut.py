"""A recording in pieces on workers: the bits of one process, and after a kill only the current pieces are lost."""

import os
import signal
import subprocess
import sys
from dataclasses import replace

import numpy as np
import psutil
import pytest
import xarray
from tests.waiting import wait_until

from midair.datasets import am_stimulus
from midair.errors import InputError, MismatchError
from midair.files import load_solution
from midair.model import ControlGrid, TransducerArray
from midair.pipeline import reproduce_stream
from midair.settings import Settings
from midair.solvers import Glide
from midair.streaming import LazyFrames
from midair.sweep.pattern_report import trial_report
from midair.sweep.recording_sweep import RecordingSweep, SweepTrial
from midair.sweep.run import do, run_sweep
from midair.sweep.store import load_sweep, open_sweep

QUICK = Glide(coarse=8, block=16, cold=(20, 4, 10), smooth=3, smooth_wide=6, bent=(4, 4, 4), rough=(6, 4, 4))
SETTINGS = Settings().but(method=QUICK, grid=ControlGrid(rows=6, columns=6, pitch=11e-3), jobs=2)
UNIT = TransducerArray.autd3(columns=1, rows=1)


def trial(name, frames, settings=SETTINGS):
    """A half-wave rectified signal, which has silent frames in between."""
    pressure = am_stimulus("i", peak=30.0, duration=frames / 1000, rate=1000.0)
    if settings.solver.name == "glide":
        samples = pressure.pressure
        pressure = replace(pressure, pressure=LazyFrames(lambda first, last: samples[first:last], samples.shape))
    return SweepTrial(recording=name, variant="", pressure=pressure, settings=settings)


SWEEP = RecordingSweep(
    trials=(trial("a", 60, SETTINGS.but(level="auto")), trial("b", 9), trial("c", 12, SETTINGS.but(method="naive"))),
    columns=1,
    rows=1,
    blocks=1,
)


def alone(one):
    """E of every frame of a trial, solved in one process from start to end."""
    _, parts = reproduce_stream(one.pressure, UNIT, one.settings.but(jobs=1))
    return np.concatenate([part.error for part in parts])


def check(results, numbers=(0, 1, 2)):
    for number in numbers:
        one = SWEEP.trials[number]
        expected = np.full(60, np.nan)
        expected[: one.pressure.frames] = alone(one)
        np.testing.assert_array_equal(results.error[number], expected)
        assert np.isfinite(results.rounded_error[number]).sum() == one.pressure.frames


@pytest.mark.long
def test_pieces_are_tasks_and_give_the_bits_of_one_process(finished, tmp_path):
    counts = [(task.condition, task.count) for task in SWEEP.tasks()]
    assert counts == [(0, 19), (0, 18), (0, 18), (0, 5), (2, 12), (1, 9)]
    results = finished(tmp_path / "s.zarr", SWEEP)
    check(results)
    rounded = results.rounded_error[0]
    assert (rounded != results.error[0])[results.error[0] > 0].all()


@pytest.mark.long
def test_workers_give_the_same_bits_and_write_their_own_regions(tmp_path, threads):
    import zarr

    with threads() as scheduler:
        assert run_sweep(SWEEP, tmp_path / "s.zarr", scheduler=scheduler) == 81
    check(load_sweep(tmp_path / "s.zarr"))
    group = zarr.open_group(tmp_path / "s.zarr", mode="r")
    assert group["error"].chunks == (1, SWEEP.chunk)


@pytest.mark.long
def test_a_continued_sweep_solves_only_the_missing_pieces(finished, tmp_path):
    path = tmp_path / "s.zarr"
    with open_sweep(path, SWEEP) as store:
        second = store.missing()[1]
        store.write(do(SWEEP.job(second), second))
    known = load_sweep(path)
    np.testing.assert_array_equal(np.flatnonzero(np.isfinite(known.error[0])), np.arange(19, 37))
    assert "0 of 3 trials solved, 1 in part" in trial_report(known).words
    with open_sweep(path, SWEEP) as store:
        assert second not in store.missing()
    check(finished(path, SWEEP))
    assert "3 of 3 trials solved, " in trial_report(load_sweep(path)).words


@pytest.mark.long
def test_xarray_shows_which_frame_stands_where(finished, tmp_path):
    finished(tmp_path / "s.zarr", SWEEP)
    with xarray.open_zarr(tmp_path / "s.zarr", consolidated=False) as shown:
        frame = shown["frame"].values
        assert shown["error"].dims == ("condition", "place")
        np.testing.assert_array_equal(frame[0][frame[0] >= 0], np.arange(60))
        np.testing.assert_array_equal(shown["error"].values[0][frame[0] >= 0], alone(SWEEP.trials[0]))


def test_other_pieces_are_another_sweep_and_other_cores_are_not(tmp_path):
    with open_sweep(tmp_path / "s.zarr", SWEEP):
        pass
    with pytest.raises(MismatchError, match="blocks 2"), open_sweep(tmp_path / "s.zarr", replace(SWEEP, blocks=2)):
        pass
    more = tuple(replace(one, settings=one.settings.but(jobs=7)) for one in SWEEP.trials)
    with open_sweep(tmp_path / "s.zarr", replace(SWEEP, trials=more)):
        pass


def test_short_recordings_are_stored_in_order():
    whole = replace(SWEEP, trials=SWEEP.trials[1:])
    assert (whole.item, whole.shape) == ("frame", (2, 12))
    assert "blocks" not in whole.settings()


def test_less_than_a_block_a_task_is_refused():
    with pytest.raises(InputError, match="blocks per task: expected 1 or more, got 0"):
        replace(SWEEP, blocks=0)


@pytest.fixture(scope="module")
def stroke(tmp_path_factory):
    """A recording of a virtual towel, as the command makes it."""
    folder = tmp_path_factory.mktemp("stroke")
    midair("record", "virtual:towel", "towel.h5", "--duration", "0.5s", folder=folder)
    return folder / "towel.h5"


def midair(*words, folder):
    made = subprocess.run(
        [sys.executable, "-m", "midair", *words], cwd=folder, capture_output=True, text=True, check=False
    )
    assert made.returncode == 0, made.stderr
    return made.stdout


OPTIONS = ["--method", "glide", "--points", "6", "--pitch", "11mm", "--rate", "8000Hz"]


@pytest.mark.slow
def test_two_workers_give_the_bits_of_midair_solve(stroke, tmp_path):
    midair("solve", str(stroke), "one.drive.h5", "--mode", "paper", "--lead", "0s", *OPTIONS, folder=tmp_path)
    midair(
        *["sweep", "recordings", "s.zarr", str(stroke), "--mode", "paper", *OPTIONS],
        *["--blocks", "1", "--workers", "2"],
        folder=tmp_path,
    )
    results = load_sweep(tmp_path / "s.zarr")
    assert results.strength.shape[1] >= 4
    np.testing.assert_array_equal(results.error[0], load_solution(tmp_path / "one.drive.h5").error)


@pytest.mark.slow
def test_a_killed_worker_loses_only_its_own_piece(stroke, tmp_path, programs):
    """The other worker solves that piece, and stored results are unchanged."""
    import zarr

    path = tmp_path / "s.zarr"
    with programs(2) as (address, workers):
        command = ["sweep", "recordings", str(path), str(stroke), "--mode", "paper", *OPTIONS, "--blocks", "1"]
        running = subprocess.Popen(
            [sys.executable, "-m", "midair", *command, "--scheduler", address],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        wait_until(lambda: path.exists() and load_sweep(path).known, 120)
        os.kill(workers[0].pid, signal.SIGKILL)
        psutil.wait_procs([psutil.Process(workers[0].pid)], timeout=10)
        group = zarr.open_group(path, mode="r")
        before, done = group["seconds"][:], group["done"][:]
        assert running.wait(timeout=300) == 0
    assert 0 < done.sum() < done.size
    after = zarr.open_group(path, mode="r")
    np.testing.assert_array_equal(after["seconds"][:][done], before[done])
    assert after["done"][:].all()
    midair("solve", str(stroke), "one.drive.h5", "--mode", "paper", "--lead", "0s", *OPTIONS, folder=tmp_path)
    np.testing.assert_array_equal(load_sweep(path).error[0], load_solution(tmp_path / "one.drive.h5").error)
