from dataclasses import fields, replace

import h5py
import numpy as np
import pytest

from midair.errors import BrokenFileError, NonFiniteError, UnknownFormatError
from midair.files import load_calibration, save, save_calibration, save_solution


def same(one, other):
    for name in ("frequency", "response", "noise"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    assert (one.sensor, one.unit, one.date) == (other.sensor, other.unit, other.date)
    assert one.provenance == other.provenance
    assert (one.version, one.identifier) == (other.version, other.identifier)
    for part in ("measurement", "crosstalk", "linearity"):
        same_part(getattr(one, part), getattr(other, part))


def same_part(one, other):
    assert type(one) is type(other)
    for field in fields(other) if other is not None else ():
        np.testing.assert_array_equal(getattr(one, field.name), getattr(other, field.name))


def test_returns_the_saved_calibration(calibration, tmp_path):
    save_calibration(calibration, tmp_path / "palm.calibration.h5")
    same(load_calibration(tmp_path / "palm.calibration.h5"), calibration)


def test_returns_the_calibration_of_a_recording(recording, calibration, tmp_path):
    save(recording, tmp_path / "a.h5", calibration=calibration)
    same(load_calibration(tmp_path / "a.h5"), calibration)


def test_returns_none_for_a_recording_without_calibration(recording, tmp_path):
    save(recording, tmp_path / "a.h5")
    assert load_calibration(tmp_path / "a.h5") is None


def test_refuses_a_drive(solution, tmp_path):
    save_solution(solution, tmp_path / "a.drive.h5")
    with pytest.raises(BrokenFileError, match="expected a midair calibration or recording, got midair drive"):
        load_calibration(tmp_path / "a.drive.h5")


def test_refuses_another_ending(calibration, tmp_path):
    with pytest.raises(UnknownFormatError, match=r"ends in \.calibration\.h5"):
        save_calibration(calibration, tmp_path / "a.h5")


@pytest.mark.parametrize("left_out", [("measurement",), ("crosstalk", "linearity"), ("measurement", "linearity")])
def test_returns_only_measured_parts(calibration, tmp_path, left_out):
    part = replace(calibration, **dict.fromkeys(left_out))
    save_calibration(part, tmp_path / "a.calibration.h5")
    same(load_calibration(tmp_path / "a.calibration.h5"), part)


def test_reads_a_file_from_before_there_were_versions_and_uncertainties(calibration, tmp_path):
    old = replace(calibration, version=1, measurement=None, crosstalk=None, linearity=None)
    save_calibration(old, tmp_path / "a.calibration.h5")
    with h5py.File(tmp_path / "a.calibration.h5", "a") as file:
        del file.attrs["version"]
    same(load_calibration(tmp_path / "a.calibration.h5"), old)


def test_half_a_measurement_is_refused(calibration, tmp_path):
    save_calibration(calibration, tmp_path / "a.calibration.h5")
    with h5py.File(tmp_path / "a.calibration.h5", "a") as file:
        del file["coherence"]
    with pytest.raises(BrokenFileError, match="expected coherence beside"):
        load_calibration(tmp_path / "a.calibration.h5")


def test_a_non_finite_uncertainty_is_refused(calibration, tmp_path):
    save_calibration(calibration, tmp_path / "a.calibration.h5")
    with h5py.File(tmp_path / "a.calibration.h5", "a") as file:
        file["phase_uncertainty"][0, 0, 0] = np.nan
    with pytest.raises(NonFiniteError, match=r"a\.calibration\.h5.*phase uncertainty"):
        load_calibration(tmp_path / "a.calibration.h5")
