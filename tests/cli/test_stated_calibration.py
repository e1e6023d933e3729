import numpy as np
import pytest

from midair.cli.import_options import calibration_from_options
from midair.errors import InputError
from midair.model import Recording, SensorGrid

SENSOR = SensorGrid(rows=1, columns=2)


def recording(samples, unit="V"):
    return Recording(samples=np.reshape(np.asarray(samples, float), (-1, 1, 2)), rate=1000.0, unit=unit, sensor=SENSOR)


TAKE = recording([[1, 0], [1, 0], [1.5, 0], [1, -2]])


def test_nothing_stated_is_no_calibration():
    assert calibration_from_options(TAKE, None, None) is None


@pytest.mark.parametrize(("text", "value"), [("20mV/Pa", 0.02), ("2V/kPa", 0.002)])
def test_a_sensitivity_is_flat(text, value):
    calibration = calibration_from_options(TAKE, text, None)
    assert np.abs(calibration.response) == pytest.approx(np.full(calibration.response.shape, value))


def test_a_peak_is_the_largest_change_from_the_median_of_any_channel():
    # channel 1 falls by 2 V from its median of 0: 2 V are 40 Pa
    calibration = calibration_from_options(TAKE, None, 40.0)
    assert np.abs(calibration.response) == pytest.approx(np.full(calibration.response.shape, 0.05))
    assert calibration.provenance.source == "stated: the largest change of any channel, 2 V, is 40 Pa"


def test_a_recording_that_never_changes_has_no_peak():
    with pytest.raises(InputError, match="a recording that changes"):
        calibration_from_options(recording(np.ones((4, 2))), None, 40.0)
