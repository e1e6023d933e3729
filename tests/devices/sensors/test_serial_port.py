"""Serial frames over a pty: a kernel's serial line without hardware."""

import fcntl
import os
import threading
import time
import tty

import numpy as np
import pytest

from midair.errors import DeviceError, HeldError
from midair.rig.names.sensor_names import source_sensor

pytest.importorskip("serial")
from midair.devices.sensors.serial_port import SerialSource

TIOCGEXCL = 0x80045440
"""Linux: asks whether TIOCEXCL was set."""


def record(sensor, seconds):
    blocks, got = [], 0
    while got < seconds * sensor.rate:
        blocks.append(sensor.read(100))
        got += len(blocks[-1].samples)
    return blocks, np.concatenate([block.samples for block in blocks]).astype(int).reshape(got, -1)


@pytest.mark.parametrize(
    ("seconds", "width", "noise"),
    [
        (0.2, 2, False),
        (2, 3, True),
        pytest.param(60, 2, False, marks=pytest.mark.slow),
        pytest.param(60, 3, True, marks=pytest.mark.slow),
    ],
)
def test_nothing_is_lost_or_permuted(seconds, width, noise, serial_line):
    line = serial_line(width=width, noise=noise)
    with source_sensor(f"serial:{line.port}?timeout=20") as sensor:
        sensor.start()
        blocks, ramp = record(sensor, seconds)
        said = sensor.describe()
    np.testing.assert_array_equal(np.diff(ramp[:, 0] // 16) % 2048, 1)
    np.testing.assert_array_equal(ramp % 16, np.broadcast_to(np.arange(16), ramp.shape))
    assert not any(block.overflow for block in blocks)
    assert (said["lost frames"], said["damaged frames"]) == ("0", "0")
    # 4 bytes of noise a frame on average; without noise at most the rest of the frame that was cut at the start.
    assert (int(said["bytes outside frames"]) > len(ramp)) == noise


def test_holes_in_the_line_are_counted_exactly(serial_line):
    line = serial_line(hole=5, noise=True)
    with source_sensor(f"serial:{line.port}") as sensor:
        sensor.start()
        blocks, ramp = record(sensor, 0.5)
        lost = int(sensor.describe()["lost frames"])
    steps = np.diff(ramp[:, 0] // 16) % 2048
    assert sorted(set(steps)) == [1, 6]
    assert lost == 5 * (steps == 6).sum() >= 10
    assert blocks[-1].first + len(blocks[-1].samples) == len(ramp) + lost


def test_device_time_is_the_sensors_own_stamp_and_volts_follow_from_the_full_scale(serial_line):
    line = serial_line(rate=500, width=3)
    with source_sensor(f"serial:{line.port}?unit=V&full_scale=2.5") as sensor:
        sensor.start()
        blocks = [sensor.read(100) for _ in range(3)]
        assert (sensor.rate, sensor.unit, sensor.full_scale) == (500.0, "V", 2.5)
    times = [block.device_time for block in blocks]
    np.testing.assert_allclose(times, times[0] + np.array([block.first for block in blocks]) / 500, atol=1e-6)
    np.testing.assert_allclose(np.diff(blocks[0].samples.reshape(100, 16)), 2.5 / 2**23)


@pytest.mark.long
def test_a_sensor_that_falls_silent_is_an_error_in_time(serial_line):
    line = serial_line()
    with source_sensor(f"serial:{line.port}?timeout=0.3") as sensor:
        sensor.start()
        sensor.read(10)
        line.sends = False
        begin = time.monotonic()
        with pytest.raises(DeviceError, match=r"got none for 0\.3 s"):
            while time.monotonic() < begin + 30:
                sensor.read(10)


def test_a_port_is_one_recorder_s(serial_line, tmp_path):
    line = serial_line()
    alias = tmp_path / "by-id"
    alias.symlink_to(line.port)
    with source_sensor(f"serial:{line.port}") as sensor:
        with pytest.raises(HeldError) as refused:
            source_sensor(f"serial:{alias}").open()
        assert f"serial:{line.port}: " in str(refused.value)
        assert f"process {os.getpid()} (" in str(refused.value)
        assert "has had it since 20" in str(refused.value)
        # The system keeps out programs that do not ask for the lock; root can open the port, and sees the flag.
        if os.geteuid() == 0:
            with open(line.port, "rb") as same:
                assert fcntl.ioctl(same, TIOCGEXCL, bytes(4)) == b"\1\0\0\0"
        else:
            with pytest.raises(OSError, match="busy"):
                open(line.port, "rb").close()
        sensor.start()
        _, ramp = record(sensor, 0.2)
        np.testing.assert_array_equal(np.diff(ramp[:, 0] // 16) % 2048, 1)
    with source_sensor(f"serial:{line.port}"):
        pass
    with open(line.port, "rb") as same:
        assert fcntl.ioctl(same, TIOCGEXCL, bytes(4)) == bytes(4)


def test_another_program_s_lock_on_the_port_is_an_error(serial_line):
    line = serial_line()
    with open(line.port, "rb") as other:
        fcntl.flock(other, fcntl.LOCK_EX)
        with pytest.raises(DeviceError, match=r"another program has it open: lsof /dev/"):
            source_sensor(f"serial:{line.port}").open()
    with source_sensor(f"serial:{line.port}"):
        pass


def test_a_missing_permission_for_a_port_names_the_group():
    def refuse():
        raise PermissionError(13, "could not open port")

    with pytest.raises(DeviceError, match=r"usermod -aG root \$USER, then log out and in"):
        SerialSource("/dev/null", connect=refuse).open()
    with pytest.raises(DeviceError, match=r"usermod -aG dialout \$USER"):
        SerialSource("/dev/ttyUSB77", connect=refuse).open()


def test_a_port_that_sends_nothing_is_let_go_and_one_with_other_data_reports_the_number_of_bytes():
    master, slave = os.openpty()
    try:
        for _ in range(2):
            with pytest.raises(DeviceError, match="no whole frame"):
                SerialSource(os.ttyname(slave), search=0.1).open()
        tty.setraw(slave)
        source = SerialSource(os.ttyname(slave), search=0.4)
        talk = threading.Timer(0.1, os.write, (master, b"Arduino ready\n"))
        talk.start()
        with pytest.raises(DeviceError, match=r"got 14 bytes in 0\.4 s and no whole frame; check the port, \?baud="):
            source.open()
        source.close()
        talk.join()
    finally:
        os.close(master)
        os.close(slave)
