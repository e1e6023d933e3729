"""Gaps, timeouts, full memory, units and wiring of a sensor with a scripted source."""

import threading
import time

import numpy as np
import psutil
import pytest

from midair.devices import ReplaySensor, StreamedSensor, WrappedSensor
from midair.devices.sensors.decimated import Decimated
from midair.devices.sensors.sources import Chunk, Stream
from midair.errors import DeviceError, InputError, MismatchError
from midair.model import Provenance, Recording, SensorGrid, SensorWiring


class Script:
    def __init__(self, chunks=(), *, channels=4, rate=1000.0, then=None, **stream):
        self.stream = Stream(channels=channels, rate=rate, **stream)
        self.chunks, self.then = list(chunks), then
        self.calls = []

    def open(self):
        self.calls.append("open")
        return self.stream

    def start(self):
        self.calls.append("start")
        self.left = list(self.chunks)

    def pull(self, wait):
        if self.left:
            return self.left.pop(0)
        if self.then is not None:
            raise self.then
        time.sleep(min(wait, 0.01))
        return None

    def stop(self):
        self.calls.append("stop")

    def close(self):
        self.calls.append("close")

    def describe(self):
        return {}


def chunk(first, frames, channels=4):
    number = np.arange(first, first + frames)[:, None]
    return Chunk(
        samples=np.asarray(10 * number + np.arange(channels), np.float32),
        first=first,
        device_time=first / 1000,
        host_time=100 + first / 1000,
    )


def wired(**settings):
    return lambda _: SensorWiring(grid=SensorGrid(rows=2, columns=2), **settings)


def test_blocks_are_cut_from_chunks_of_any_size_and_no_thread_is_left_behind():
    with StreamedSensor(Script([chunk(0, 7), chunk(7, 1), chunk(8, 30)]), name="s") as sensor:
        sensor.start()
        blocks = [sensor.read(5) for _ in range(6)]
        with pytest.raises(InputError, match="got 0"):
            sensor.read(0)
        for _ in range(2):
            sensor.start()
    assert [block.first for block in blocks] == [0, 5, 10, 15, 20, 25]
    assert [block.host_time for block in blocks] == pytest.approx([100 + n / 1000 for n in range(0, 30, 5)])
    np.testing.assert_array_equal(np.concatenate([block.samples for block in blocks])[:, 0, 0], 10 * np.arange(30))
    assert not [thread for thread in threading.enumerate() if thread.name == "midair source"]


def test_a_gap_ends_a_block_and_is_reported_in_the_next():
    with StreamedSensor(Script([chunk(0, 10), chunk(13, 10)]), name="s") as sensor:
        sensor.start()
        before, after = sensor.read(15), sensor.read(10)
        assert sensor.describe()["lost frames"] == "3"
    assert (before.first, len(before.samples), before.overflow) == (0, 10, False)
    assert (after.first, len(after.samples), after.overflow) == (13, 10, True)
    assert after.device_time == pytest.approx(0.013)


def test_frames_that_hold_no_number_count_as_lost():
    holed = chunk(0, 10)
    holed.samples[4, 1], holed.samples[5, 0] = np.nan, -np.inf
    holed.samples[9, 0] = np.inf
    with StreamedSensor(Script([holed, chunk(10, 5)]), name="s") as sensor:
        sensor.start()
        blocks = [sensor.read(100) for _ in range(2)] + [sensor.read(5)]
    assert [(block.first, len(block.samples)) for block in blocks] == [(0, 4), (6, 3), (10, 5)]
    assert blocks[1].device_time == pytest.approx(0.006)
    assert [block.overflow for block in blocks] == [False, True, True]


def test_a_silent_source_is_an_error_after_the_time_limit_and_may_come_back():
    source = Script([chunk(0, 10)])
    with StreamedSensor(source, name="s", timeout=0.2) as sensor:
        sensor.start()
        assert len(sensor.read(50).samples) == 10
        with pytest.raises(DeviceError, match=r"got none for 0\.2 s; check that it is connected"):
            sensor.read(50)
        source.left.append(chunk(10, 50))
        assert sensor.read(50).first == 10


@pytest.mark.parametrize("failure", [DeviceError("it is gone"), ZeroDivisionError("a mistake of ours")])
def test_a_lost_source_gives_what_came_first_and_then_its_error_every_time(failure):
    with StreamedSensor(Script([chunk(0, 10)], then=failure), name="s") as sensor:
        sensor.start()
        assert len(sensor.read(50).samples) == 10
        for _ in range(2):
            with pytest.raises(type(failure), match=str(failure)):
                sensor.read(1)


def test_a_late_reader_loses_only_excess_frames_and_they_are_counted():
    # 100 frames of 4 float32 are 1600 bytes: two of the four chunks fit.
    chunks = [chunk(first, 100) for first in range(0, 400, 100)]
    source = Script(chunks)
    with StreamedSensor(source, name="s", memory=3200) as sensor:
        sensor.start()
        while source.left:
            time.sleep(0.01)
        first, last = sensor.read(200), None
        source.left.append(chunk(400, 50))
        last = sensor.read(50)
    assert (first.first, len(first.samples)) == (0, 200)
    assert (last.first, last.overflow) == (400, True)


def test_a_wiring_that_contradicts_the_source_is_refused_and_the_source_let_go(subtests):
    for stream, wiring, error, words in [
        ({"channels": 3}, {}, MismatchError, "expected 4 channels for 2 x 2 cells, got 3"),
        ({"unit": "V"}, {"unit": "Pa"}, MismatchError, "expected samples in Pa, the source states V; set unit=V"),
        ({"full_scale": 1.0}, {"unit": "V"}, InputError, "expected full_scale for a unit of V"),
    ]:
        with subtests.test(words=words):
            source = Script(**stream)
            with pytest.raises(error, match=words):
                StreamedSensor(source, name="s", wire=wired(**wiring)).open()
            assert source.calls == ["open", "close"]


def test_units_and_full_scale(subtests):
    for stream, wiring, factor, full_scale in [
        ({"full_scale": 32768.0}, {}, 1.0, 32768.0),
        ({"full_scale": 32768.0}, {"unit": "V", "full_scale": 3.3}, 3.3 / 32768, 3.3),
        ({"full_scale": 32768.0}, {"full_scale": 2048.0}, 1.0, 2048.0),
        ({"unit": "V", "scale": 1e-6}, {"unit": "V"}, 1e-6, None),
        ({"unit": "V", "full_scale": 10.0}, {"unit": "V"}, 1.0, 10.0),
        ({}, {"unit": "Pa"}, 1.0, None),
    ]:
        sensor = StreamedSensor(Script([chunk(0, 2)], **stream), name="s", wire=wired(**wiring))
        with subtests.test(stream=stream), sensor:
            sensor.start()
            np.testing.assert_allclose(sensor.read(2).samples[1, 0], [10 * factor, 11 * factor], rtol=1e-12)
            assert sensor.unit == wiring.get("unit", "count")
            assert sensor.full_scale == sensor.wiring.full_scale == full_scale


def test_a_stated_sensitivity_is_a_nominal_calibration():
    with StreamedSensor(Script(unit="V"), name="s", wire=wired(unit="V", sensitivity=0.02)) as sensor:
        assert np.all(sensor.calibration.response == 0.02)
        assert sensor.calibration.provenance.source.startswith("nominal")


class Endless(Script):
    """As many frames of 16 channels at 48 kHz as are read, without delay."""

    def start(self):
        self.asked = threading.Semaphore(4)
        self.given = 0
        self.piece = np.random.default_rng(0).random((4800, 16), np.float32)

    def pull(self, wait):
        if not self.asked.acquire(timeout=wait):
            return None
        first, self.given = self.given, self.given + len(self.piece)
        return Chunk(samples=self.piece.copy(), first=first, device_time=first / 48e3, host_time=first / 48e3)


@pytest.mark.parametrize(
    ("rate", "hours"),
    [(48_000, 0.01), pytest.param(48_000, 1, marks=pytest.mark.slow), pytest.param(1000, 0.2, marks=pytest.mark.slow)],
)
def test_an_hour_of_16_channels_at_48_khz_needs_no_more_memory_than_minutes(rate, hours):
    source = Endless(channels=16, rate=48_000.0)
    with StreamedSensor(Decimated(source, float(rate)), name="s", timeout=30) as sensor:
        sensor.start()
        used, frames = [], round(hours * 3600 * rate)
        for tenth in range(10):
            while sensor._next < frames * (tenth + 1) / 10:
                block = sensor.read(rate // 10)
                source.asked.release()
                assert not block.overflow
            used.append(psutil.Process().memory_info().rss)
    assert max(used) - used[0] < 20e6


TAKE = Recording(samples=np.random.default_rng(0).random((300, 4, 4)), rate=1000.0)


def test_frames_come_when_their_time_has_come_and_not_sooner():
    with WrappedSensor(ReplaySensor(TAKE, name="replay:x"), paced=True) as sensor:
        assert (sensor.name, sensor.rate, sensor.on_demand) == ("replay:x", 1000.0, False)
        sensor.start()
        begin = time.monotonic()
        for first in range(0, 300, 50):
            block = sensor.read(50)
            np.testing.assert_array_equal(block.samples, TAKE.samples[first : first + 50])
            assert time.monotonic() - begin >= (first + 50) / 1000 - 2e-3
            assert block.device_time == first / 1000
            assert abs(block.host_time - begin - first / 1000) < 1
        assert not len(sensor.read(50).samples), "it has ended"


def test_cells_are_taken_in_the_other_order_and_the_name_is_the_wirings():
    samples = np.arange(3 * 16, dtype=float).reshape(3, 4, 4)
    wiring = SensorWiring(grid=SensorGrid(name="palm"), order=tuple(range(15, -1, -1)))
    with WrappedSensor(ReplaySensor(Recording(samples=samples, rate=500.0, unit="Pa")), wiring) as sensor:
        sensor.start()
        block = sensor.read(3)
    np.testing.assert_array_equal(block.samples, samples[:, ::-1, ::-1])
    assert (sensor.grid.name, sensor.rate, sensor.unit, sensor.wiring) == ("palm", 500.0, "Pa", wiring)
    # The calibration of another order would put every cell's response onto another cell.
    assert sensor.calibration is None


RECORDING = Recording(
    samples=np.arange(40.0).reshape(10, 2, 2),
    rate=500.0,
    unit="count",
    sensor=SensorGrid(rows=2, columns=2, name="palm"),
    provenance=Provenance(simulated=True),
)


def test_a_replay_is_what_the_recording_is_until_there_are_no_frames():
    with ReplaySensor(RECORDING) as sensor:
        assert (sensor.grid, sensor.rate, sensor.unit, sensor.simulated) == (RECORDING.sensor, 500.0, "count", True)
        assert sensor.on_demand
        sensor.start()
        blocks = [sensor.read(4) for _ in range(4)]
    assert [(block.first, len(block.samples)) for block in blocks] == [(0, 4), (4, 4), (8, 2), (10, 0)]
    assert [block.device_time for block in blocks] == [0, 0.008, 0.016, 0.02]
    np.testing.assert_array_equal(np.concatenate([block.samples for block in blocks]), RECORDING.samples)
