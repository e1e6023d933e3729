import numpy as np
import pytest

from midair.errors import BrokenFileError, UnknownFormatError
from midair.store import load_calibration, save, save_calibration, save_solution


def same(one, other):
    for name in ("frequency", "response", "noise"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    assert (one.sensor, one.unit, one.date) == (other.sensor, other.unit, other.date)
    assert one.provenance == other.provenance


def test_returns_what_was_saved(calibration, tmp_path):
    save_calibration(calibration, tmp_path / "palm.calibration.h5")
    same(load_calibration(tmp_path / "palm.calibration.h5"), calibration)


def test_returns_what_a_recording_carries(recording, calibration, tmp_path):
    save(recording, tmp_path / "a.h5", calibration=calibration)
    same(load_calibration(tmp_path / "a.h5"), calibration)


def test_returns_none_when_a_recording_carries_none(recording, tmp_path):
    save(recording, tmp_path / "a.h5")
    assert load_calibration(tmp_path / "a.h5") is None


def test_refuses_a_drive(solution, tmp_path):
    save_solution(solution, tmp_path / "a.drive.h5")
    with pytest.raises(BrokenFileError, match="expected a midair calibration or recording, got midair drive"):
        load_calibration(tmp_path / "a.drive.h5")


def test_refuses_another_ending(calibration, tmp_path):
    with pytest.raises(UnknownFormatError, match=r"ends in \.calibration\.h5"):
        save_calibration(calibration, tmp_path / "a.h5")
