"""Loss report of a format that cannot store a calibration."""

import numpy as np

from midair.files.file_format import FormatLoss, calibration_lost
from midair.model import Calibration, SensorGrid


def test_without_a_calibration_nothing_is_lost():
    assert calibration_lost(None, "WAV") == ()


def test_a_dropped_calibration_is_reported_with_advice():
    sensor = SensorGrid(rows=1, columns=1)
    flat = Calibration(
        sensor=sensor, frequency=np.array([0.0, 500.0]), response=np.ones((2, 1, 1)), noise=np.zeros((1, 1))
    )
    (lost,) = calibration_lost(flat, "WAV")
    assert lost == FormatLoss(what="calibration", text=str(lost))
    assert str(lost).startswith("WAV holds no calibration")
    assert "save_calibration()" in str(lost)
