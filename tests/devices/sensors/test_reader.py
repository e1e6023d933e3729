import queue
import threading

import numpy as np
import pytest

from midair.devices.sensors.sources import Chunk
from midair.devices.sensors.streamed_sensor import Reader
from midair.errors import LinkLostError


class ListSource:
    """Returns queued chunks; a queued exception is raised in its turn."""

    def __init__(self, *given):
        self.given = queue.Queue()
        self.idle = threading.Event()
        for one in given:
            self.given.put(one)

    def pull(self, wait):
        try:
            one = self.given.get_nowait()
        except queue.Empty:
            self.idle.set()
            try:
                one = self.given.get(timeout=wait)
            except queue.Empty:
                return None
        if isinstance(one, Exception):
            raise one
        return one


def chunk(first, frames=10, samples=None):
    samples = np.full((frames, 2), float(first)) if samples is None else samples
    return Chunk(samples=samples, first=first, device_time=first / 1000, host_time=first / 1000)


@pytest.fixture
def reading():
    readers = []

    def start(*given, limit=1e6):
        source = ListSource(*given)
        reader = Reader(source, 1000.0, limit=limit)
        readers.append(reader)
        return reader, source

    yield start
    for reader in readers:
        reader.stop()


def test_chunks_come_in_their_order(reading):
    reader, _ = reading(chunk(0), chunk(10), chunk(20))
    assert [reader.take(5.0).first for _ in range(3)] == [0, 10, 20]
    assert reader.take(0.0) is None
    assert reader.dropped == 0


def test_it_waits_for_what_is_to_come(reading):
    reader, source = reading()
    later = threading.Timer(0.05, source.given.put, [chunk(7)])
    later.start()
    assert reader.take(5.0).first == 7


def test_beyond_the_limit_the_newest_are_dropped_and_counted(reading):
    # a chunk is 10 frames x 2 channels x 8 bytes
    reader, source = reading(chunk(0), chunk(10), chunk(20), chunk(30, frames=3), limit=400)
    assert source.idle.wait(5.0)
    assert reader.dropped == 10
    assert [reader.take(5.0).first for _ in range(3)] == [0, 10, 30]
    # what was taken makes room again
    source.given.put(chunk(40))
    assert reader.take(5.0).first == 40
    assert reader.dropped == 10


def test_missing_frames_are_left_out(reading):
    samples = np.zeros((10, 2))
    samples[4, 1] = np.nan
    reader, _ = reading(chunk(100, samples=samples))
    assert [(part.first, len(part)) for part in (reader.take(5.0), reader.take(5.0))] == [(100, 4), (105, 5)]


@pytest.mark.parametrize("failure", [LinkLostError("the cable"), RuntimeError("a bug in a driver")])
def test_what_came_before_a_failure_is_given_first(reading, failure):
    reader, _ = reading(chunk(0), failure)
    assert reader.take(5.0).first == 0
    for _ in range(2):
        with pytest.raises(type(failure), match=str(failure)):
            reader.take(5.0)


def test_stopping_ends_the_thread(reading):
    before = set(threading.enumerate())
    reader, _ = reading()
    (thread,) = set(threading.enumerate()) - before
    reader.stop()
    assert not thread.is_alive()
