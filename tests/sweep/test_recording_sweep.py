import json
from dataclasses import replace

import numpy as np
import pytest

from midair.datasets import am_stimulus
from midair.errors import InputError, MismatchError
from midair.evaluate import relative_error
from midair.model import ControlGrid, TransducerArray
from midair.physics import propagate, quantise_phase
from midair.pipeline import reproduce
from midair.settings import Settings
from midair.sweep.recording_sweep import RecordingSweep, SweepTrial
from midair.sweep.run import do, run_sweep
from midair.sweep.store import load_sweep, open_sweep

COARSE = ControlGrid(rows=6, columns=6, pitch=11e-3)
NAIVE = Settings().but(method="naive", grid=COARSE)
WARM = Settings().but(method="lm", grid=COARSE, iterations=(4, 2))


def trial(name, settings=NAIVE, frames=10, variant=""):
    pressure = am_stimulus("i", peak=30.0, duration=frames / 1000, rate=1000.0)
    return SweepTrial(recording=name, variant=variant, pressure=pressure, settings=settings)


SWEEP = RecordingSweep(
    trials=(trial("a", variant="method=naive"), trial("b", frames=6, settings=WARM, variant="method=lm")),
    columns=1,
    rows=1,
)


@pytest.mark.long
def test_equals_the_pipeline(finished, tmp_path):
    results = finished(tmp_path / "s.zarr", SWEEP)
    array = TransducerArray.autd3(columns=1, rows=1)
    for number, one in enumerate(SWEEP.trials):
        made = reproduce(one.pressure, array, one.settings)
        frames = one.pressure.frames
        np.testing.assert_allclose(results.error[number, :frames], made.solution.error, rtol=1e-9)
        assert np.isnan(results.error[number, frames:]).all()
        assert results.strength[number, 0] == pytest.approx(made.strength())
        drive = replace(made.solution.drive, phase=quantise_phase(made.solution.drive.phase, bits=8))
        rounded = relative_error(propagate(drive, COARSE), made.target.amplitude)
        np.testing.assert_allclose(results.rounded_error[number, :frames], rounded, rtol=1e-9)


@pytest.mark.long
def test_on_real_workers_and_again_only_what_is_missing(tmp_path):
    import distributed

    path = tmp_path / "s.zarr"
    with open_sweep(path, SWEEP) as store:
        first = store.missing()[0]
        store.write(do(SWEEP.job(first), first))
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, protocol="tcp", host="127.0.0.1", dashboard_address=None
    ) as local:
        assert run_sweep(SWEEP, path, scheduler=local.scheduler_address) == 16 - first.count
    assert np.isfinite(load_sweep(path).error).sum() == 16


def test_the_longest_trial_is_begun_first_and_a_task_is_a_whole_trial():
    sweep = RecordingSweep(trials=(trial("a", frames=3), trial("b", frames=9)))
    assert [(task.condition, task.first, task.last) for task in sweep.tasks()] == [(1, 0, 9), (0, 0, 3)]
    assert sweep.chunk == 9


def test_another_recording_under_the_same_name_is_refused(finished, tmp_path):
    finished(tmp_path / "s.zarr", SWEEP)
    pressure = SWEEP.trials[0].pressure
    louder = replace(SWEEP.trials[0], pressure=replace(pressure, pressure=2 * pressure.pressure))
    with (
        pytest.raises(MismatchError, match="trials 0 pressure_sha256"),
        open_sweep(tmp_path / "s.zarr", replace(SWEEP, trials=(louder, SWEEP.trials[1]))),
    ):
        pass
    with (
        pytest.raises(MismatchError, match=r"expected bits 4, got a sweep with 8"),
        open_sweep(tmp_path / "s.zarr", replace(SWEEP, bits=4)),
    ):
        pass


def test_settings_survive_json():
    assert json.loads(json.dumps(SWEEP.settings())) == SWEEP.settings()


@pytest.mark.parametrize(
    "trials",
    [(), (trial("a"), trial("a")), (trial("a", settings=Settings().but(method="magic")),)],
    ids=["none", "twice", "unknown method"],
)
def test_invalid_sweeps_are_rejected(trials):
    with pytest.raises(InputError):
        RecordingSweep(trials=trials)
