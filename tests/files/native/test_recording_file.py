import numpy as np
import pytest

from midair.errors import MismatchError
from midair.files import load, load_calibration, load_pressure, save
from midair.model import PressureFrames, Provenance, SensorGrid


@pytest.mark.long
@pytest.mark.parametrize("band", [None, (20.0, 470.0)])
def test_the_pressure_is_read_back(band, path, recording, calibration, alike):
    life = recording.provenance.then("calibrate", {"band": band})
    pressure = PressureFrames(
        pressure=recording.samples[:7], rate=250, sensor=recording.sensor, band=band, provenance=life
    )
    assert load_pressure(path) is None
    save(recording, path, calibration=calibration, pressure=pressure)
    again = load_pressure(path)
    assert again is not None
    np.testing.assert_array_equal(again.pressure, pressure.pressure)
    assert (again.rate, again.sensor, again.band) == (250, recording.sensor, band)
    assert again.provenance == life
    alike(load(path), recording)
    kept = load_calibration(path)
    assert kept is not None
    np.testing.assert_array_equal(kept.response, calibration.response)


def test_refuses_pressure_of_another_sensor(recording, path):
    with pytest.raises(MismatchError, match=r"expected pressure of \(3, 5\) cells, got \(4, 4\)"):
        save(recording, path, pressure=PressureFrames(pressure=np.zeros((3, 4, 4)), rate=250, sensor=SensorGrid()))


def test_keeps_a_long_provenance(recording, tmp_path):
    life = Provenance()
    for i in range(2000):
        life = life.then("correct", {"round": i, "what": "x" * 50})
    save(
        type(recording)(samples=recording.samples, rate=10, sensor=recording.sensor, provenance=life), tmp_path / "a.h5"
    )
    assert load(tmp_path / "a.h5").provenance == life
