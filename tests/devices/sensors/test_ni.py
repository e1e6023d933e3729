"""The driver of NI-DAQmx with a simulated task; the vendor's driver is not available where these tests run."""

import numpy as np
import pytest

from midair.devices import StreamedSensor
from midair.errors import DeviceError
from midair.rig.names.sensor_names import source_sensor

pytest.importorskip("nidaqmx")
from midair.devices.sensors.ni import NiSource, devices


def test_the_task_is_configured_as_requested(ni_task):
    from nidaqmx.constants import AcquisitionType, TerminalConfiguration

    source = NiSource("Dev1/ai0:15", rate=2000.0, limit=5.0, wires="rse", make_task=lambda: ni_task)
    with StreamedSensor(source, name="ni") as sensor:
        assert (sensor.rate, sensor.unit, sensor.full_scale) == (2000.0, "V", 5.0)
    (channels, volts), (rate, timing) = ni_task.calls
    assert (channels, rate) == ("Dev1/ai0:15", 2000.0)
    assert volts == {"terminal_config": TerminalConfiguration.RSE, "min_val": -5.0, "max_val": 5.0}
    assert timing == {"sample_mode": AcquisitionType.CONTINUOUS, "samps_per_chan": 20000}


@pytest.mark.parametrize("channels", [1, 16])
def test_frames_come_out_as_the_task_gives_them(channels, ni_task):
    ni_task.channel_names = ni_task.channel_names[:channels]
    with StreamedSensor(NiSource("x", make_task=lambda: ni_task), name="ni") as sensor:
        sensor.start()
        samples = sensor.read(300).samples.reshape(300, channels)
    wanted = (np.arange(300)[:, None] * 16 + np.arange(channels)) / 32768 * 10
    np.testing.assert_allclose(samples, wanted)


def test_a_converter_that_is_pulled_out_is_one_clear_line(ni_task):
    sensor = StreamedSensor(NiSource("Dev1/ai0:15", make_task=lambda: ni_task), name="ni")
    with sensor:
        sensor.start()
        sensor.read(5)
        ni_task.unplugged = True
        with pytest.raises(DeviceError, match=r"^ni: Dev1/ai0:15: Device is not available.*; check") as told:
            while True:
                sensor.read(100)
    assert "\n" not in str(told.value)


def test_a_missing_vendor_driver_is_an_error_with_advice():
    from nidaqmx.errors import DaqNotFoundError

    try:
        devices()
    except DeviceError:
        with pytest.raises(DeviceError, match="expected the driver NI-DAQmx, it is not installed") as told:
            source_sensor("ni:Dev1/ai0:15").open()
        assert isinstance(told.value.__cause__, DaqNotFoundError)
