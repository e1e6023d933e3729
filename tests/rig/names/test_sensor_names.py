import numpy as np
import pytest

from midair.errors import MissingFileError, UnknownDeviceError
from midair.files import save
from midair.model import Recording
from midair.rig.names.sensor_names import sensor_named
from midair.rig.names.virtual_rig import VirtualRig

RIG = VirtualRig()


@pytest.mark.parametrize("name", ["virtual:towel", "virtual:brush+groove", "virtual:am-ii"])
def test_virtual_sensors_open_and_give_something(name):
    with sensor_named(name, RIG, duration=0.2) as sensor:
        sensor.start()
        assert np.ptp(sensor.read(200).samples) > 0
        assert sensor.simulated
        assert sensor.name == name


def test_replay_of_a_file(tmp_path):
    recording = Recording(samples=np.random.default_rng(0).random((20, 4, 4)), rate=1000.0)
    save(recording, tmp_path / "take.h5")
    with sensor_named(f"replay:{tmp_path / 'take.h5'}", RIG) as sensor:
        sensor.start()
        np.testing.assert_allclose(sensor.read(20).samples, recording.samples, rtol=1e-6)


@pytest.mark.parametrize("name", ["", "virtual", "virtual:", "virtual:cat", "virtual:towel+fur", "usb:1", "replay:"])
def test_unknown_names(name):
    with pytest.raises(UnknownDeviceError, match="expected"):
        sensor_named(name, RIG)


def test_replay_of_a_file_that_is_not_there():
    with pytest.raises(MissingFileError):
        sensor_named("replay:nothing.h5", RIG)
