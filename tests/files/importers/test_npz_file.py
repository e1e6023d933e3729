"""NumPy archives."""

import numpy as np
import pytest

from midair.errors import BrokenFileError
from midair.files import load, save

SAID = {"rate": 1000.0, "unit": "V"}


def test_loads_no_objects(tmp_path):
    np.savez(tmp_path / "a.npz", samples=np.array([[{}], [{}]], object))
    with pytest.raises(BrokenFileError, match="NPZ"):
        load(tmp_path / "a.npz", **SAID)


def test_a_plain_row_of_numbers_is_one_channel(tmp_path):
    np.savez(tmp_path / "a.npz", wave=np.arange(9.0))
    assert load(tmp_path / "a.npz", **SAID).frames == 9


def test_numpy_alone_reads_what_was_written(recording, tmp_path):
    save(recording, tmp_path / "a.npz")
    with np.load(tmp_path / "a.npz", allow_pickle=False) as archive:
        assert set(archive.files) == {"samples", "rate", "unit", "midair"}
        np.testing.assert_array_equal(archive["samples"], recording.samples)
        assert (archive["rate"].item(), archive["unit"].item()) == (recording.rate, recording.unit)


def test_a_dropped_calibration_is_reported(recording, calibration, tmp_path):
    assert [loss.what for loss in save(recording, tmp_path / "a.npz", calibration=calibration)] == ["calibration"]
    assert save(recording, tmp_path / "a.npz") == ()
