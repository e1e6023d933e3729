import numpy as np
import pytest

from midair.devices import FrameBlock, ReplaySensor
from midair.errors import DeviceError, InputError
from midair.files import load
from midair.model import Recording
from midair.rig.takes.capture import capture_recording

TAKE = Recording(samples=np.random.default_rng(0).random((250, 4, 4)), rate=1000.0)


class Losing(ReplaySensor):
    """Skips a frame before its second block."""

    def read(self, frames):
        block = super().read(frames)
        shift = 1 if block.first else 0
        return FrameBlock(samples=block.samples, first=block.first + shift, device_time=0, host_time=0)


def test_the_recording_equals_the_sensor_s_frames(tmp_path):
    with ReplaySensor(TAKE) as sensor:
        recording = capture_recording(sensor, 0.25, path=tmp_path / "take.h5", notes={"object": "none"})
    np.testing.assert_array_equal(recording.samples, TAKE.samples)
    stored = load(tmp_path / "take.h5")
    np.testing.assert_allclose(stored.samples, TAKE.samples, rtol=1e-6)
    assert stored.provenance.notes["object"] == "none"
    assert stored.rate == TAKE.rate


def test_a_source_that_ends_early_gives_what_there_was():
    with ReplaySensor(TAKE) as sensor:
        assert capture_recording(sensor, 10.0).frames == 250


def test_lost_frames_are_an_error_and_stop_the_sensor(tmp_path):
    with Losing(TAKE) as sensor:
        with pytest.raises(DeviceError, match=r"lost frames before 0\.100 s"):
            capture_recording(sensor, 0.25, path=tmp_path / "take.h5")
        with pytest.raises(Exception, match="start before read"):
            sensor.read(1)
    assert load(tmp_path / "take.h5").frames == 100, "what came before the loss is kept"


def test_no_frame_is_refused():
    with ReplaySensor(TAKE) as sensor, pytest.raises(InputError, match="at least one frame"):
        capture_recording(sensor, 0.0001)
