import time

import numpy as np

from midair.devices import Stream, StreamedSensor
from midair.rig import VirtualRig
from midair.rig.live_touch.process import RepeatedSource, streamed


def test_frames_are_repeated_when_they_are_due():
    samples = np.arange(10.0).reshape(5, 2)
    source = RepeatedSource(samples, Stream(channels=2, rate=1000.0, unit="V"))
    source.open()
    source.start()
    began = time.monotonic()
    chunks = [source.pull(0.1) for _ in range(8)]
    assert time.monotonic() - began >= 0.0155
    assert np.array_equal(np.concatenate([chunk.samples for chunk in chunks]), samples[np.arange(16) % 5])
    assert [chunk.first for chunk in chunks] == list(range(0, 16, 2))
    assert np.allclose(np.diff([chunk.host_time for chunk in chunks]), 0.002)
    source.start()
    assert source.pull(0.0) is None


def test_a_virtual_sensor_is_recorded_once_and_repeated_with_its_calibration():
    named = VirtualRig().touched_by("am-i", duration=0.05)
    sensor = streamed(named, longest=0.05)
    assert isinstance(sensor, StreamedSensor)
    assert (sensor.calibration, sensor.simulated) == (named.calibration, True)
    with sensor:
        sensor.start()
        assert sensor.ready(0.1)
        block = sensor.read(60)
        sensor.stop()
    assert np.array_equal(block.samples[:10], block.samples[50:])
    assert streamed(sensor) is sensor
