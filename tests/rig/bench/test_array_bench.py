import numpy as np
import pytest

from midair.calibration import ArrayPlan
from midair.errors import InputError, RateError
from midair.model import Acoustics, TransducerArray
from midair.rig import VirtualRig, calibrate_array

WHOLE = TransducerArray.autd3(columns=1, rows=1)
NEAR = np.sort(np.argsort(np.linalg.norm(WHOLE.position, axis=1))[:30])
# Each as strong as twenty, so that a sensor with its usual noise hears so few.
STRONG = TransducerArray(position=WHOLE.position[NEAR], normal=WHOLE.normal[NEAR], pressure=90.0, name="strong")


def opened(seed):
    rig = VirtualRig(array=STRONG, seed=seed)
    skin = rig.skin()
    array = rig.array_device(skin)
    array.silencer = "off"
    return array, rig.sensor(skin)


@pytest.mark.long
def test_measures_the_virtual_array_as_its_seed_made_it():
    array, sensor = opened(4)
    with array, sensor:
        found = calibrate_array(array, sensor, ArrayPlan(duration=0.4, group=15), acoustics=Acoustics())
    true = array.chain.transducers
    response = true.response * np.exp(-1j * np.angle(true.response.sum()))
    level = np.abs(found.response).mean() / np.abs(response).mean()
    assert level == pytest.approx(1, abs=0.05)
    assert np.std(found.response / level - response) < 0.3 * np.std(response)
    assert np.corrcoef(found.pole.imag, true.pole.imag)[0, 1] > 0.9
    assert not found.dead.any()
    assert found.provenance.simulated
    assert [step.stage for step in found.provenance.steps] == ["measure array", "fit array"]


def test_a_sensor_must_be_calibrated_and_of_the_codes_rate():
    array, sensor = opened(0)
    with array, sensor:
        with pytest.raises(RateError, match="an integer multiple of the codes' 400 Hz"):
            calibrate_array(array, sensor, ArrayPlan(rate=400))
        sensor.calibration = None
        with pytest.raises(InputError, match="with a calibration"):
            calibrate_array(array, sensor)
