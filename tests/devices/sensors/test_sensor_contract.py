"""The contract of every sensor; to test a new one, add an entry to a table.

Live sensors send the ramp (conftest): frame i, channel c is (i mod 2048) * 16 + c after `SCALE`.
"""

import contextlib
import itertools
import threading
import time

import numpy as np
import pytest

from midair.devices import ReplaySensor, StreamedSensor, VirtualSensor, VirtualSkin, WrappedSensor
from midair.devices.sensors.decimated import Decimated
from midair.errors import DeviceError, DeviceStateError
from midair.model import PressureFrames, Provenance, Recording, SensorWiring
from midair.physics.sensing import SensorModel
from midair.rig.names.sensor_names import source_sensor

SCALE = {"audio": 32768.0, "ni": 3276.8}
LIVE = ["lsl", "serial", "ni", "audio"]


def virtual_sensor():
    touch = PressureFrames(pressure=np.random.default_rng(1).random((1600, 4, 4)), rate=8000.0)
    return VirtualSensor(VirtualSkin(SensorModel()), touch=touch)


def replay():
    samples = np.random.default_rng(2).random((200, 4, 4))
    return ReplaySensor(Recording(samples=samples, rate=1000.0, provenance=Provenance(simulated=True)))


SIMULATED = {
    "virtual": virtual_sensor,
    "replay": replay,
    "rewired": lambda: WrappedSensor(replay(), SensorWiring(order=tuple(range(15, -1, -1)))),
}


@pytest.fixture(scope="module")
def pulse(pulse_server, tmp_path_factory):
    with pulse_server(tmp_path_factory.mktemp("pulse"), rate=8000, what="ramp") as server:
        yield server


@pytest.fixture(scope="module")
def one_lsl_sender(lsl_sender_of_a_module):
    return lsl_sender_of_a_module()


@pytest.fixture
def live(request, serial_line):
    """Creates a live sensor; returns it and a function that unplugs its source."""

    def lsl():
        name, sender = request.getfixturevalue("one_lsl_sender")
        return source_sensor(f"lsl:{name}?search=60&counter=16&timeout=10"), sender.kill

    def serial():
        line = serial_line()
        return source_sensor(f"serial:{line.port}?timeout=10"), line.unplug

    def ni():
        from midair.devices.sensors.ni import NiSource

        task = request.getfixturevalue("ni_task")
        source = NiSource("Dev1/ai0:15", make_task=lambda: task)
        return StreamedSensor(source, name="ni", timeout=10), lambda: setattr(task, "unplugged", True)

    def audio():
        request.getfixturevalue("pulse")
        return source_sensor("audio:pulse?channels=16&native=8000&rate=8000&timeout=10"), None

    return {"lsl": lsl, "serial": serial, "ni": ni, "audio": audio}


@pytest.fixture(params=[*SIMULATED, *LIVE])
def sensor(request):
    if request.param in SIMULATED:
        return SIMULATED[request.param]()
    return request.getfixturevalue("live")[request.param]()[0]


@pytest.fixture(params=LIVE)
def live_sensor(request, live):
    return *live[request.param](), SCALE.get(request.param, 1.0)


def test_blocks_follow_each_other_without_a_gap_and_have_the_time_of_their_first_frame(sensor):
    """Samples that are declared as float32 are exact."""
    with sensor:
        sensor.start()
        blocks = [sensor.read(50) for _ in range(4)]
        assert all(block.samples.shape == (50, *sensor.grid.shape) for block in blocks)
        assert all(type(key) is str and type(value) is str for key, value in sensor.describe().items())
        np.testing.assert_allclose(np.diff([block.device_time for block in blocks]), 50 / sensor.rate, rtol=1e-6)
        samples = np.concatenate([block.samples for block in blocks])
        assert sensor.stored == "f8" or np.array_equal(samples.astype(np.float32), samples)
        assert sensor.stored == "f4" or not sensor.name.startswith("virtual")
    assert [block.first for block in blocks] == [0, 50, 100, 150]
    assert not any(block.overflow for block in blocks)
    assert np.ptp(samples) > 0


@pytest.mark.parametrize("make", SIMULATED.values(), ids=SIMULATED.keys())
def test_the_size_of_the_blocks_does_not_matter(make):
    sensor = make()
    with sensor:
        sensor.start()
        at_once = sensor.read(120).samples
        sensor.stop()
        sensor.start()
        in_parts = np.concatenate([sensor.read(n).samples for n in (7, 50, 63)])
    np.testing.assert_array_equal(at_once, in_parts)


def test_live_frames_are_the_ones_sent_in_order_and_in_their_cells(live_sensor):
    sensor, _, scale = live_sensor
    with sensor:
        sensor.start()
        samples = np.concatenate([sensor.read(n).samples for n in (7, 50, 63, 200)])
    ramp = np.rint(samples * scale).astype(int)
    np.testing.assert_array_equal(ramp % 16, np.broadcast_to(np.arange(16).reshape(4, 4), ramp.shape))
    np.testing.assert_array_equal(np.diff(ramp[:, 0, 0] // 16) % 2048, 1)


def test_reading_before_start_and_after_stop_is_refused_and_stop_and_close_are_harmless(sensor):
    refused = pytest.raises(DeviceStateError, match="start before read")
    sensor.stop()
    sensor.close()
    with refused:
        sensor.read(1)
    with sensor:
        with refused:
            sensor.read(1)
        sensor.stop()
        sensor.start()
        assert len(sensor.read(5).samples) == 5
        sensor.stop()
        sensor.stop()
        with refused:
            sensor.read(1)
    sensor.close()
    sensor.close()


def test_a_second_start_and_a_second_opening_begin_again_at_frame_0(sensor):
    with sensor:
        sensor.start()
        sensor.read(20)
        sensor.start()
        assert sensor.read(20).first == 0
    with sensor:
        sensor.start()
        assert sensor.read(20).first == 0


def test_a_live_sensor_must_be_open_to_start_or_read_its_rate(live_sensor):
    sensor, _, _ = live_sensor
    with pytest.raises(DeviceStateError, match="open before start"):
        sensor.start()
    with pytest.raises(DeviceStateError, match="open before reading its rate"):
        _ = sensor.rate


@pytest.mark.long  # It compares times with the clock.
def test_host_time_is_this_computers_steady_clock(live_sensor):
    sensor, _, _ = live_sensor
    with sensor:
        begin = time.monotonic()
        sensor.start()
        blocks = [sensor.read(100) for _ in range(3)]
        end = time.monotonic()
    # A source may have had a buffer full when it was started.
    assert all(begin - 1 < block.host_time < end for block in blocks)
    assert all(late.host_time > early.host_time for early, late in itertools.pairwise(blocks))


def test_a_source_at_a_lower_rate_keeps_the_contract(live):
    sensor, _ = live["ni"]()
    slow = StreamedSensor(Decimated(sensor.source, 250.0), name="slow", timeout=10)
    with contextlib.closing(slow), slow:
        slow.start()
        blocks = [slow.read(20) for _ in range(3)]
        np.testing.assert_allclose(np.diff([block.device_time for block in blocks]), 20 / 250.0, rtol=1e-6)
    assert [block.first for block in blocks] == [0, 20, 40]


# The last test: the senders are gone after it.
@pytest.mark.long
@pytest.mark.parametrize("kind", ["lsl", "serial", "ni"])
def test_unplugging_gives_what_came_and_then_an_error_in_time(kind, live):
    sensor, unplug = live[kind]()
    got, failure = [], []

    def read_on():
        try:
            while True:
                got.append(sensor.read(40))
        except DeviceError as wrong:
            failure.append(wrong)

    with sensor:
        sensor.start()
        reader = threading.Thread(target=read_on, daemon=True)
        reader.start()
        while len(got) < 5:
            time.sleep(0.01)
        unplug()
        reader.join(30)
        assert not reader.is_alive()
    assert len(failure) == 1
    assert ";" in str(failure[0])
    assert [block.first for block in got] == list(np.cumsum([0, *(len(block.samples) for block in got)])[:-1])
