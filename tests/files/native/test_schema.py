from pathlib import Path

import h5py
import numpy as np
import pytest

from midair.files import save, save_calibration, save_solution
from midair.files.native.schema import TABLE
from midair.model import PressureFrames

REFERENCE = Path(__file__).parents[3] / "docs" / "reference.py"


@pytest.mark.long
def test_files_hold_exactly_what_the_table_says(recording, calibration, solution, target, tmp_path):
    pressure = PressureFrames(pressure=recording.samples, rate=333, sensor=recording.sensor, band=(20, 160))
    save(recording, tmp_path / "a.h5", calibration=calibration, pressure=pressure)
    save_calibration(calibration, tmp_path / "a.calibration.h5")
    save_solution(solution, tmp_path / "a.drive.h5", target=target)
    with h5py.File(tmp_path / "a.h5") as file:
        journal = {entry.name for entry in TABLE["recording"] if entry.name.startswith(("event", "stage"))}
        check(file, "recording", extra={"calibration", "pressure"}, without=journal)
        check(file["calibration"], "calibration")
        check(file["pressure"], "pressure")
    with h5py.File(tmp_path / "a.calibration.h5") as file:
        check(file, "calibration")
    with h5py.File(tmp_path / "a.drive.h5") as file:
        check(file, "drive", without={"phase", "transducer_level", "level_step", "response_real", "response_imag"})


def check(group, kind, *, extra=frozenset(), without=frozenset()):
    entries = [entry for entry in TABLE[kind] if entry.name not in without]
    assert set(group.attrs) == {entry.name for entry in entries if entry.dimensions is None}
    assert set(group) - extra == {entry.name for entry in entries if entry.dimensions is not None}
    for entry in entries:
        if entry.dimensions is not None:
            assert group[entry.name].dtype == ("f4" if entry.packed and entry.single else np.dtype(entry.dtype))
            assert group[entry.name].ndim == len(entry.dimensions)
