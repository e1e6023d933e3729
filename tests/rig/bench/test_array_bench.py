import numpy as np
import pytest
from tests.calibration.measure.test_unit_poses import measured, some
from tests.model.test_array_calibration import calibration

from midair.calibration import ArrayField, ArrayPlan, array_codes
from midair.errors import InputError, RateError
from midair.model import Acoustics, Provenance, TransducerArray
from midair.physics import SensorModel, Transducers, calibration_of, sense
from midair.rig import VirtualRig, calibrate_array
from midair.rig.bench import check_silence
from midair.rig.bench.array_bench import _check_fit, no_warning

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


def silent_sensor():
    model = SensorModel()
    codes = array_codes(STRONG, model.grid, ArrayPlan(duration=0.4), acoustics=Acoustics(), height=0.2)
    field = ArrayField(array=STRONG, codes=codes, acoustics=Acoustics(), calibration=calibration_of(model))
    pressure = np.zeros((8000, 4, 4))
    volts = sense(model, pressure, 1000, rng=np.random.default_rng(1), oversample=8)
    return field, volts.reshape(-1, 16)


def test_a_quiet_sensor_passes_and_a_noisy_or_draughty_one_does_not():
    field, volts = silent_sensor()
    said = []
    check_silence(volts, field, said.append)
    assert said == []
    rng, time = np.random.default_rng(2), np.arange(len(volts))[:, None] / 1000
    check_silence(volts + 3 * volts.std() * rng.standard_normal(volts.shape), field, said.append)
    assert len(said) == 1
    assert "3.2 times as much" in said[0] or "3.1 times as much" in said[0]
    with pytest.raises(InputError, match=r"expected the noise of its calibration, got .* times as much"):
        check_silence(volts + 30 * volts.std() * rng.standard_normal(volts.shape), field)
    said.clear()
    check_silence(volts + volts.std() * np.sin(2 * np.pi * 3 * time), field, said.append)
    assert len(said) == 1
    assert "still air" in said[0]


def test_a_clipped_recording_is_refused():
    array, sensor = opened(4)
    with array, sensor:
        sensor.full_scale = 1e-4
        with pytest.raises(InputError, match=r"no clipped sample under the beam, got .* lower --top"):
            calibrate_array(array, sensor, ArrayPlan(duration=0.4, group=15))


@pytest.mark.slow
def test_a_sensor_that_moves_between_two_groups_is_refused():
    """Half of the jump is the distance of each group's place from their mean."""
    array = some(30)
    found = measured(array, Transducers.alike(array.count), np.zeros((4, 7)), jump=(2e-3, 0, 0))
    assert found.provenance.last("fit array")["moved_m"] == pytest.approx(1e-3, rel=0.5)
    with pytest.raises(InputError, match=r"expected it at rest, got a movement of .* mm"):
        _check_fit(found, no_warning)


def test_what_the_model_does_not_explain_is_reported():
    array = some(30)
    told = {"moved_m": 0.0, "moved_uncertainty_m": 1e-5, "noise_ratio": 4.0}
    found, said = calibration(array, provenance=Provenance().then("fit array", told)), []
    _check_fit(found, said.append)
    assert len(said) == 1
    assert "4.0 times as much: draught, movement or echoes" in said[0]


def test_the_spread_of_published_boards_has_their_phases():
    count = VirtualRig().array.count
    phases = {}
    for spread in ("default", "boards", "data-sheets"):
        true = VirtualRig(seed=1, spread=spread).array_device().chain.transducers
        phases[spread] = np.angle(true.response).std()
        again = VirtualRig(seed=1, spread=spread, transducers=Transducers.alike(count)).array_device()
        assert (again.chain.transducers.response == 1).all()
    assert phases["default"] == pytest.approx(0.06, abs=0.01)
    assert phases["boards"] == pytest.approx(0.2, abs=0.02)
    assert phases["data-sheets"] > 0.3
