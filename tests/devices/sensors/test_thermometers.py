"""Thermometers: a file, a serial line on a pty, and a stream of LSL, with values that are wrong or too old."""

import os
import threading
import time

import pytest

from midair.devices.sensors.thermometer import FileThermometer
from midair.errors import DeviceError, UnknownDeviceError
from midair.rig import thermometer_named


@pytest.mark.parametrize(("text", "degrees"), [("22.4\n", 22.4), ("-3 C", -3.0), ("20.0\n23.25 °C\n", 23.25)])
def test_a_file_gives_the_temperature_of_its_last_line(tmp_path, text, degrees):
    path = tmp_path / "room.txt"
    path.write_text(text, encoding="utf-8")
    assert thermometer_named(f"file:{path}").read() == degrees


@pytest.mark.parametrize(
    ("text", "says"),
    [("295.5", "-10 to 50 degrees Celsius, got 295.5"), ("", "got ''"), ("72 F", "got '72 F'"), ("nan", "got 'nan'")],
)
def test_a_file_without_a_plausible_temperature_is_an_error(tmp_path, text, says):
    path = tmp_path / "room.txt"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(DeviceError, match=says):
        thermometer_named(f"file:{path}").read()


def test_a_file_older_than_a_minute_is_an_error(tmp_path):
    path = tmp_path / "room.txt"
    path.write_text("22.4", encoding="utf-8")
    now = path.stat().st_mtime
    os.utime(path, (now - 50, now - 50))
    assert FileThermometer(str(path)).read() == 22.4
    os.utime(path, (now - 90, now - 90))
    with pytest.raises(DeviceError, match="of the last 60 s, got one of 90 s ago"):
        FileThermometer(str(path)).read()


def test_a_missing_file_and_an_unknown_kind_are_errors(tmp_path):
    with pytest.raises(DeviceError, match="No such file"):
        thermometer_named(f"file:{tmp_path / 'none.txt'}").read()
    for name in ("usb:COM3", "lsl:", "22"):
        with pytest.raises(UnknownDeviceError, match="lsl:PLACE, serial:PLACE, file:PLACE"):
            thermometer_named(name)


@pytest.fixture(name="line")
def _line():
    pytest.importorskip("serial")
    tty = pytest.importorskip("tty")
    master, slave = os.openpty()
    tty.setraw(slave)
    yield master, os.ttyname(slave)
    for end in (master, slave):
        os.close(end)


def test_a_serial_line_gives_its_last_whole_line(line):
    master, port = line
    thermometer = thermometer_named(f"serial:{port}?baud=19200")
    answer = []
    reading = threading.Thread(target=lambda: answer.append(thermometer.read()))
    reading.start()
    while reading.is_alive():
        os.write(master, b"DS18B20 ready\r\n21.5\r\n")
        reading.join(0.05)
    assert answer == [21.5]
    os.write(master, b"22.0 C\r\n22.5 C\r\n23")
    assert eventually(thermometer.read, 22.5)
    os.write(master, b".75\n")
    assert eventually(thermometer.read, 23.75)
    thermometer.close()


def eventually(read, value, within=10.0):
    """Whether `read` returns the value within some seconds: a pty has a delay."""
    until = time.monotonic() + within
    while read() != value:
        if time.monotonic() > until:
            return False
    return True


def test_a_serial_line_that_falls_silent_is_an_error(line):
    master, port = line
    thermometer = thermometer_named(f"serial:{port}")
    thermometer.stale = 0.2
    os.write(master, b"boot\n")
    with pytest.raises(DeviceError, match=r"within 0.2 s, got '.*'; check the thermometer"):
        thermometer.read()
    thermometer.close()
    with pytest.raises(DeviceError, match="No such file"):
        thermometer_named("serial:/dev/no-such-port").read()


def test_a_stream_gives_its_last_value_and_an_error_once_it_falls_silent():
    pylsl = pytest.importorskip("pylsl")
    name = f"room {os.getpid()} {time.monotonic_ns()}"
    outlet = pylsl.StreamOutlet(pylsl.StreamInfo(name, "temperature", 1, 0, pylsl.cf_float32, name))
    thermometer = thermometer_named(f"lsl:{name}")
    thermometer.search = 60.0
    answer = []
    reading = threading.Thread(target=lambda: answer.append(thermometer.read()))
    reading.start()
    while reading.is_alive():
        outlet.push_sample([21.5])
        reading.join(0.1)
    assert answer == [21.5]
    outlet.push_sample([23.25])
    assert eventually(thermometer.read, 23.25)
    thermometer.stale = 0.0
    with pytest.raises(DeviceError, match="of the last 0 s, got one of"):
        thermometer.read()
    thermometer.stale = 10.0
    outlet.push_sample([230.0])
    until = time.monotonic() + 10
    with pytest.raises(DeviceError, match="-10 to 50 degrees Celsius, got 230"):
        while time.monotonic() < until:
            thermometer.read()
    thermometer.close()


def test_a_stream_without_a_sender_is_an_error():
    pytest.importorskip("pylsl")
    thermometer = thermometer_named("lsl:no such thermometer")
    thermometer.search = 0.2
    with pytest.raises(DeviceError, match=r"found none in 0\.2 s"):
        thermometer.read()
