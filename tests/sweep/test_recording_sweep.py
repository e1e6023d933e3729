"""Sweeps over recordings, solved in this process."""

from dataclasses import replace

import numpy as np
import pytest

from midair.datasets import am_stimulus
from midair.errors import InputError, MismatchError
from midair.model import ControlGrid, TransducerArray
from midair.physics import propagate, quantise_phase, relative_error
from midair.pipeline import reproduce
from midair.settings import Settings
from midair.solvers import Glide
from midair.sweep import RecordingSweep, SweepTrial, load_sweep, run_sweep, sweep_report, write_sweep_report

COARSE = ControlGrid(rows=6, columns=6, pitch=11e-3)
UNIT = TransducerArray.autd3(columns=1, rows=1)
QUICK = Glide(coarse=8, block=16, cold=(20, 4, 10), smooth=3, smooth_wide=6, bent=(4, 4, 4), rough=(6, 4, 4))
FAST = Settings().but(method="fast", iterations=2, grid=COARSE)


def trial(name, frames, settings=FAST, variant=""):
    """A half-wave rectified signal, which has silent frames in between."""
    pressure = am_stimulus("i", peak=30.0, duration=frames / 1000, rate=1000.0)
    return SweepTrial(recording=name, variant=variant, pressure=pressure, settings=settings)


SWEEP = RecordingSweep(
    trials=(
        trial("a", 10, variant="method=fast"),
        trial("b", 6, settings=Settings().but(method="lm", grid=COARSE, iterations=(4, 2)), variant="method=lm"),
        trial("a", 12, settings=Settings().but(method=QUICK, grid=COARSE), variant="method=glide"),
    ),
    array=UNIT,
)


@pytest.mark.long
def test_equals_the_pipeline(tmp_path, here):
    assert [task.condition for task in SWEEP.tasks()] == [2, 0, 1], "the longest recording comes first"
    assert run_sweep(SWEEP, tmp_path / "s") == 28
    results = load_sweep(tmp_path / "s")
    for number, one in enumerate(SWEEP.trials):
        made, frames = reproduce(one.pressure, UNIT, one.settings), one.pressure.frames
        np.testing.assert_allclose(results.error[number, :frames], made.solution.error, rtol=1e-6)
        assert np.isnan(results.error[number, frames:]).all()
        assert results.strength[number] == pytest.approx(made.strength())
        drive = replace(made.solution.drive, phase=quantise_phase(made.solution.drive.phase, bits=8))
        rounded = relative_error(propagate(drive, COARSE), made.target.amplitude)
        np.testing.assert_allclose(results.rounded_error[number, :frames], rounded, rtol=1e-6)

    rows = sweep_report(results)["trials"]
    assert [f"{row['recording']} {row['variant']}" for row in rows] == [
        "a method=fast",
        "b method=lm",
        "a method=glide",
    ]
    files = write_sweep_report(results, tmp_path / "report")
    assert [file.name for file in files] == ["trials.csv", "trials.png"]
    assert files[0].read_text(encoding="utf-8").splitlines()[1].startswith("a,method=fast,")
    assert files[1].read_bytes().startswith(b"\x89PNG")


def test_the_report_counts_only_frames_with_sound(tmp_path, here):
    sweep = RecordingSweep(trials=(trial("a", 10), trial("b", 6)), array=UNIT)
    run_sweep(sweep, tmp_path / "s")
    results = load_sweep(tmp_path / "s")
    error = np.array([[0.0, 0.1] * 5, [0.2] * 6 + [np.nan] * 4])
    rows = sweep_report(replace(results, error=error))["trials"]
    assert [(row["recording"], row["frames"], row["mean"], row["worst"]) for row in rows] == [
        ("a", 5, pytest.approx(0.1), 0.1),
        ("b", 6, pytest.approx(0.2), 0.2),
    ]
    with pytest.raises(InputError, match="continue with midair sweep recordings"):
        sweep_report(replace(results, error=np.full((2, 10), np.nan)))


def test_another_recording_is_another_sweep_and_other_cores_are_not(tmp_path, here):
    one = trial("a", 4)
    run_sweep(RecordingSweep(trials=(one,), array=UNIT), tmp_path / "s")
    cores = replace(one, settings=one.settings.but(jobs=7))
    assert run_sweep(RecordingSweep(trials=(cores,), array=UNIT), tmp_path / "s") == 0
    louder = replace(one, pressure=replace(one.pressure, pressure=2 * one.pressure.pressure))
    for other in (louder, replace(one, settings=one.settings.but(gain=2.0)), replace(one, variant="gain=1")):
        with pytest.raises(MismatchError, match="expected trials"):
            run_sweep(RecordingSweep(trials=(other,), array=UNIT), tmp_path / "s")
