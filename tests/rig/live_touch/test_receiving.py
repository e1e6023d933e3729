"""Both sides of the network on loopback, with a simulated faulty network between them."""

import socket
import threading
import time
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import pytest
from tests.rig.live_touch.udp_proxy import Proxy
from tests.waiting import wait_until

from midair.devices import Stream, StreamedSensor
from midair.errors import DeviceError
from midair.model import Calibration, SensorGrid, SensorWiring
from midair.rig.live_touch import receiving, timing
from midair.rig.live_touch.encryption import END, ReceivedFrame
from midair.rig.live_touch.playing_live import FrameSender
from midair.rig.live_touch.process import RepeatedSource
from midair.rig.live_touch.receiving import JitterBuffer, NetworkSource, RateLimit

KEY, OTHER = bytes(range(32)), bytes(32)
GRID = SensorGrid(rows=2, columns=2)


def sealed(number, value=None):
    return ReceivedFrame(number=number, taken=0.0, pressure=np.full(4, float(number if value is None else value)))


def given(ways, *, length=0.015, rate=1000.0):
    """(times at which a buffer gives the frames, their numbers, the buffer) for frames that take `ways`, in s.

    A frame with way NaN is lost.
    """
    buffer = JitterBuffer(rate=rate, length=length)
    arrivals = sorted((number / rate + way, number) for number, way in enumerate(ways) if np.isfinite(way))
    frames = []
    for came, number in arrivals:
        while buffer.due() <= came:
            due = buffer.due()
            place, pressure = buffer.get()
            if pressure is not None:
                assert pressure[0] == place
                frames.append((due, place))
        buffer.put(sealed(number), came)
    times, numbers = np.array(frames).T
    assert np.all(np.diff(times) > 0)
    assert np.all(np.diff(numbers) > 0)
    return times, numbers, buffer


def test_frames_come_out_in_order_a_buffer_after_the_fastest():
    """Each frame takes up to 8 ms, the fastest 0: all are given, 10 ms after the fastest would have come."""
    ways = 1e-3 * np.tile([0, 3, 8, 1, 2, 7, 0, 4, 6, 1], 100)
    times, numbers, buffer = given(ways, length=0.01)
    assert np.all(np.diff(numbers) == 1)
    assert times == pytest.approx(numbers / 1000 + 0.01, abs=1e-6)
    assert buffer.counted.concealed == buffer.counted.tardy == 0


def test_a_missing_frame_is_left_out_and_counted():
    buffer = JitterBuffer(rate=1000.0, length=0.002, window=0.0)
    for number in (0, 1, 3):
        buffer.put(sealed(number), number / 1000)
    assert [pressure is not None and float(pressure[0]) for _, pressure in (buffer.get() for _ in range(4))] == [
        0,
        1,
        False,
        3,
    ]
    buffer.put(sealed(2), 0.02)
    assert (buffer.counted.concealed, buffer.counted.tardy, buffer.counted.frames) == (1, 1, 4)


@pytest.mark.parametrize("step", [0.016, 0.04, 0.1])
def test_a_longer_way_is_followed_within_a_fifth_of_a_second(step):
    """The frames after the step come `step` later; the first that is given comes 0.2 s after the first that is late."""
    ways = np.where(np.arange(3000) < 1000, 0.0, step)
    times, numbers, buffer = given(ways)
    pause = np.argmax(np.diff(times))
    assert numbers[pause] == 999
    assert times[pause + 1] < 1.0 + step + 0.2
    assert np.all(np.diff(times[pause + 1 :]) < 1.1e-3)
    assert times[-1] - numbers[-1] / 1000 == pytest.approx(step + 0.015, abs=1e-4)
    assert buffer.counted.concealed == buffer.counted.tardy == numbers[pause + 1] - 1000


def test_a_shorter_way_is_followed_without_a_pause_or_at_once():
    """20 ms less: no frame is left out, and the delay falls slowly; 100 ms less: the old frames are left out."""
    number = np.arange(8000)
    times, numbers, _ = given(np.where(number < 1000, 0.02, 0.0))
    assert np.all(np.diff(numbers) == 1)
    assert np.diff(times).min() > 0.99e-3
    assert times[-1] - numbers[-1] / 1000 == pytest.approx(0.015, abs=1e-3)
    times, numbers, _ = given(np.where(number < 1000, 0.1, 0.0))
    assert times[-1] - numbers[-1] / 1000 == pytest.approx(0.015, abs=1e-3)
    assert np.diff(times).max() < 0.02


def test_frames_held_up_for_a_moment_do_not_lengthen_the_delay():
    """No frame arrives for 0.3 s, then all of them at once."""
    number = np.arange(3000)
    ways = np.where((number >= 1000) & (number < 1300), (1300 - number) / 1000, 0.0)
    times, numbers, _ = given(ways)
    assert times == pytest.approx(numbers / 1000 + 0.015, abs=1e-4)
    assert np.diff(times).max() < 0.3


def test_lost_frames_are_left_out_alone():
    """5 % at random: all others are given at their time."""
    lost = np.random.default_rng(1).random(20_000) < 0.05
    times, numbers, buffer = given(np.where(lost, np.nan, 0.0))
    assert times == pytest.approx(numbers / 1000 + 0.015, abs=1e-6)
    assert np.diff(times).max() < 0.01
    assert buffer.counted.concealed == lost[int(numbers[0]) : int(numbers[-1])].sum()
    assert buffer.counted.tardy == 0


@pytest.mark.parametrize("ppm", [-200, 200])
def test_another_clock_is_followed(ppm):
    times, numbers, buffer = given(np.arange(60_000) / 1000 * ppm * 1e-6 + 0.02)
    assert times[-1] - numbers[-1] / 1000 * (1 + ppm * 1e-6) == pytest.approx(0.035, abs=1e-4)
    assert buffer.counted.concealed == 0


def free_port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


class Listener:
    """The playing side in a thread; it stores the received frames."""

    def __init__(self, *, key=KEY, buffer=0.01, patience=5.0):
        self.source = NetworkSource(("127.0.0.1", free_port()), key, buffer=buffer, patience=patience)
        self.source.bind()
        self.port, self.got, self.problem, self._ends = self.source.port, [], None, False
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self):
        try:
            self.source.open()
            self.source.start()
            while not self._ends:
                chunk = self.source.pull(0.01)
                if chunk is not None:
                    self.got.append((chunk.first, float(chunk.samples[0, 0]), time.monotonic(), chunk.host_time))
        except DeviceError as wrong:
            self.problem = wrong

    def close(self):
        self._ends = True
        self._thread.join()
        self.source.close()


@contextmanager
def speaking(port, *, key=KEY, patience=3.0, rounds=None):
    """A speaker of `rounds`, shape (frame, 4), or of 0, 1, 2 ... Pa, as frames are numbered: the filter is left out."""
    stream = Stream(channels=4, rate=1000.0, unit="Pa")
    if rounds is None:
        rounds = np.repeat(np.arange(60_000.0)[:, None], 4, axis=1)
    wiring = SensorWiring(grid=GRID, order=(0, 1, 2, 3), unit="Pa")
    sensor = StreamedSensor(RepeatedSource(rounds, stream), name="ramp", wire=lambda _: wiring)
    with sensor:
        flat = Calibration.flat(GRID, unit="Pa")
        speaker = FrameSender(sensor, flat, ("127.0.0.1", port), key, patience=patience)
        speaker._inverse = Through()
        try:
            speaker.greet()
            yield speaker
        finally:
            speaker.close()


class Through:
    def step(self, frame, out):
        out[:] = frame


def spoken(seconds, *, buffer=0.01, **way):
    """(listener, proxy, speaker) after so long over a way."""
    listener = Listener(buffer=buffer)
    proxy = Proxy(listener.port, **way)
    try:
        with speaking(proxy.port) as speaker:
            until = time.monotonic() + seconds
            speaker.run(lambda: time.monotonic() < until)
        time.sleep(0.1)
    finally:
        listener.close()
        proxy.close()
    return listener, proxy, speaker


def test_sent_frames_arrive_in_order_and_on_time():
    # A busy machine may hold this process up for longer than the buffer is: one run of some is on time.
    for _ in range(20):
        listener, _, speaker = spoken(0.4)
        told = listener.source.counted
        numbers = [number for number, *_ in listener.got]
        assert np.all(np.diff(numbers) >= 1)
        assert told.frames == speaker.spoken.frames
        assert told.refused == told.repeated == 0
        values = np.array([value for _, value, *_ in listener.got])
        assert np.all(np.diff(values) >= 0)
        if on_time := len(numbers) > 200 and np.mean(np.diff(values) == 1) > 0.9:
            break
    assert on_time


def test_another_key_is_refused_on_both_sides():
    listener = Listener(patience=1.0)
    with pytest.raises(DeviceError, match="the same key"), speaking(listener.port, key=OTHER, patience=0.6):
        pass
    listener.close()
    assert listener.got == []
    assert "check the key" in str(listener.problem)
    assert listener.source.counted.refused > 0


@pytest.mark.long
def test_a_replayed_run_is_refused():
    """Every datagram of a run is sent again: it counts once within the run, and the next receiver refuses it."""
    before, proxy, _ = spoken(0.6)
    assert before.got
    listener = Listener()
    again = Proxy(listener.port)
    with speaking(again.port) as speaker:
        # A few with each frame: all at once would not fit into the socket's buffer.
        old, until = iter(range(0, len(proxy.seen), 5)), time.monotonic() + 0.2

        def goes_on():
            if (first := next(old, None)) is not None:
                again.again(proxy.seen[first : first + 5])
            return first is not None or time.monotonic() < until

        speaker.run(goes_on)
        again.again(again.seen[1:])
        wait_until(lambda: listener.source.counted.repeated >= speaker.spoken.frames - 1, 10)
    listener.close()
    again.close()
    told = listener.source.counted
    assert told.refused >= len(proxy.seen) - 3
    assert told.repeated >= speaker.spoken.frames - 1
    assert told.frames == speaker.spoken.frames


@pytest.mark.long
def test_a_replayed_greeting_is_harmless():
    """A replayed greeting is answered, without harm: frames of that run carry an invalid number."""
    first, proxy, _ = spoken(0.6)
    listener = Listener(patience=2.0)
    again = Proxy(listener.port)
    again._speaker = ("127.0.0.1", free_port())
    again.again(proxy.seen)
    time.sleep(0.3)
    listener.close()
    again.close()
    assert first.got
    assert listener.got == []
    assert listener.source.counted.frames == 0


def test_greetings_of_an_earlier_run_do_not_keep_the_true_sender_out():
    """A stranger repeats the greeting and the first frames of an earlier run before the true sender greets."""
    _, proxy, _ = spoken(0.4)
    listener = Listener(patience=30.0)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        for datagram in proxy.seen[:3]:
            stranger.sendto(datagram, ("127.0.0.1", listener.port))
    with speaking(listener.port) as speaker:
        until = time.monotonic() + 30
        speaker.run(lambda: len(listener.got) < 50 and time.monotonic() < until)
    listener.close()
    assert len(listener.got) >= 50
    assert listener.source.counted.refused >= 2


def test_messages_beyond_a_rate_are_not_decrypted():
    limit = RateLimit()
    assert sum(limit.accepts("stranger", 200, 0.001 * number) for number in range(900)) == 200
    assert limit.accepts("sender", 200, 0.9)
    assert limit.accepts("stranger", 200, 1.9)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("way", "most"),
    [
        ({}, 0.02),
        ({"loss": 0.05}, 0.09),
        ({"delay": 0.02, "jitter": 0.01}, 0.05),
        ({"reordering": 0.01}, 0.05),
        ({"loss": 0.05, "jitter": 0.01, "reordering": 0.01, "repeating": 0.02}, 0.15),
    ],
    ids=["nothing", "loss", "jitter", "reordering", "all"],
)
def test_network_faults_are_concealed_and_counted(way, most):
    listener, proxy, speaker = spoken(3.0, buffer=0.015, **way)
    told = listener.source.counted
    numbers = [number for number, *_ in listener.got]
    assert np.all(np.diff(numbers) >= 1)
    assert told.concealed >= proxy.lost * 0.5
    assert told.concealed / len(numbers) < most
    values = np.array([value for _, value, *_ in listener.got])
    assert np.all(np.diff(values) >= 0), "frames that come late are thrown away"
    assert told.repeated > 0 if way.get("repeating") else told.repeated == 0
    assert speaker.spoken.frames > 2000


@pytest.mark.long
def test_no_frame_is_given_after_the_sender_has_ended():
    listener, _, _ = spoken(0.6)
    assert "has ended" in str(listener.problem)
    told = listener.source.counted
    assert told.concealed - told.tardy < 50, "no frame is missing in the tenth of a second after the end"
    gap = [b - a for (_, _, a, _), (_, _, b, _) in zip(listener.got, listener.got[1:], strict=False)]
    assert max(gap) < 0.2


def test_a_sender_whose_end_is_lost_has_ended_after_a_while(monkeypatch):
    monkeypatch.setattr(receiving, "GONE", 0.5)
    listener = Listener()
    with speaking(listener.port) as speaker:
        sends, until = speaker._send, time.monotonic() + 0.4
        speaker._send = lambda kind, message: kind != END and sends(kind, message)
        speaker.run(lambda: time.monotonic() < until)
    over = time.monotonic()
    while listener.problem is None and time.monotonic() < over + 10:
        time.sleep(0.01)
    listener.close()
    assert "got none for 0.5 s" in str(listener.problem)
    assert len(listener.got) > 20


class Slow(RepeatedSource):
    """States 1000 frames a second and gives 900."""

    def open(self):
        return replace(super().open(), rate=1000.0)


def test_a_sender_measures_the_rate_of_its_sensor(monkeypatch):
    monkeypatch.setattr(timing, "RATE_SPAN", 0.3)
    wiring = SensorWiring(grid=GRID, order=(0, 1, 2, 3), unit="Pa")
    source = Slow(np.ones((9000, 4)), Stream(channels=4, rate=900.0, unit="Pa"))
    with StreamedSensor(source, name="slow", wire=lambda _: wiring) as sensor:
        speaker = FrameSender(sensor, Calibration.flat(GRID, unit="Pa"), ("127.0.0.1", free_port()), KEY)
        assert speaker.rate.rate_problem == ""
        until = time.monotonic() + 20
        speaker.run(lambda: speaker.rate.rate is None and time.monotonic() < until)
        speaker.close()
    assert speaker.rate.rate == pytest.approx(900.0, rel=0.01)
    assert "expected 1000 frames per second, measured 9" in speaker.rate.rate_problem


def test_an_occupied_port_is_an_error():
    listener = Listener(patience=0.1)
    with pytest.raises(DeviceError, match="--listen"):
        NetworkSource(("127.0.0.1", listener.port), KEY).bind()
    listener.close()
