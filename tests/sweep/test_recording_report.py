from dataclasses import replace

import numpy as np
import pytest

from midair.datasets import am_stimulus
from midair.errors import InputError
from midair.model import ControlGrid
from midair.settings import Settings
from midair.sweep.pattern_report import trial_report, write_trial_report
from midair.sweep.recording_sweep import RecordingSweep, SweepTrial
from midair.sweep.store import load_sweep, open_sweep

COARSE = Settings().but(grid=ControlGrid(rows=6, columns=6, pitch=11e-3))


def trial(name, frames, method, **more):
    pressure = am_stimulus("i", peak=30.0, duration=frames / 1000, rate=1000.0)
    settings = COARSE.but(method=method, **more)
    return SweepTrial(recording=name, variant=f"method={method}", pressure=pressure, settings=settings)


SWEEP = RecordingSweep(trials=(trial("a", 10, "naive"), trial("b", 6, "lm", iterations=(4, 2))), columns=1, rows=1)


@pytest.mark.long
def test_report_counts_only_audible_frames(finished, tmp_path):
    results = finished(tmp_path / "s.zarr", SWEEP)
    results = replace(results, error=np.where(np.isnan(results.error), np.nan, [[0.0, 0.1] * 5, [0.2] * 10]))
    report = trial_report(results)
    assert [(row["recording"], row["frames"], row["mean"], row["worst"]) for row in report.rows] == [
        ("a", 5, pytest.approx(0.1), 0.1),
        ("b", 6, pytest.approx(0.2), 0.2),
    ]
    assert "2 of 2 trials" in report.words


@pytest.mark.long
def test_writes_a_table_and_a_figure(finished, tmp_path):
    files = write_trial_report(finished(tmp_path / "s.zarr", SWEEP), tmp_path / "report")
    assert [file.name for file in files] == ["trials.csv", "trials.png"]
    assert files[0].read_text(encoding="utf-8").splitlines()[1].startswith("a,method=naive,")
    assert files[1].read_bytes().startswith(b"\x89PNG")


def test_a_report_of_nothing_is_refused(tmp_path):
    with open_sweep(tmp_path / "s.zarr", SWEEP):
        pass
    with pytest.raises(InputError, match="continue with"):
        trial_report(load_sweep(tmp_path / "s.zarr"))
