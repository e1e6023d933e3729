from pathlib import Path

import numpy as np
import pytest

from midair.errors import BrokenFileError
from midair.files.native.axes import check_time, sensor_from, sensor_values, time_values
from midair.model import SensorGrid


@pytest.mark.parametrize("sensor", [SensorGrid(), SensorGrid(rows=1, columns=7, pitch=3e-3, name="strip")])
def test_a_sensor_is_read_back(sensor):
    assert sensor_from(sensor_values(sensor)) == sensor


def test_frame_i_is_at_i_over_the_rate():
    stored = time_values(5, 400.0)
    assert stored["rate_hz"] == 400.0
    assert np.asarray(stored["time"]) == pytest.approx([0, 0.0025, 0.005, 0.0075, 0.01])
    check_time(stored, Path("take.h5"))
    check_time(time_values(0, 400.0), Path("take.h5"))


@pytest.mark.parametrize("wrong", [0.01 / 400, np.nan])
def test_an_edited_time_is_reported_with_its_frame(wrong):
    stored = time_values(5, 400.0)
    stored["time"] = np.array(stored["time"])
    stored["time"][3] += wrong
    with pytest.raises(BrokenFileError, match=r"take\.h5: expected frame i at i / 400 Hz, got frame 3 at"):
        check_time(stored, Path("take.h5"))


def test_an_edited_rate_is_reported():
    with pytest.raises(BrokenFileError, match=r"got frame 1 at 0\.0025 s"):
        check_time(time_values(5, 400.0) | {"rate_hz": 1000.0}, Path("take.h5"))
