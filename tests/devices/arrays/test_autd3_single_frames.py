"""Single frames sent to AUTD3's emulator: their instants, frames that are not sent, and every way in which playback
ends.
"""

import asyncio
import re
import threading
import time
from dataclasses import replace

import numpy as np
import pytest
from tests.simulators.exposure_override import clear_any_exposure

from midair.devices import Cooling, ExposureChoices, autd3_immediate, check_exposure_level, stop_playing
from midair.errors import (
    DeviceError,
    DeviceStateError,
    ExposureError,
    LinkLostError,
    SilentFramesError,
    StoppedError,
    TooHotError,
)
from midair.files import DEFAULT_PROFILE, profile_named
from midair.model import Drive, Placement

pytest.importorskip("autd3")

# A computer that others keep busy sends frames late, which the units' failsafe may silence.
pytestmark = pytest.mark.long

ONE = Placement.grid(columns=1, rows=1)
PATTERN, FAILSAFE, MS = 0x16, 0x80, 1_000_000


@pytest.fixture
def turned():
    from midair.devices.arrays.autd3_single_frames import ManualEventLoop

    return ManualEventLoop()


def test_a_loop_that_is_turned_does_nothing_by_itself_and_then_all_there_is_to_do(turned):
    future, seen = turned.create_future(), []

    async def wait():
        assert asyncio.get_running_loop() is turned
        seen.append(await future)

    task = asyncio.Task(wait(), loop=turned)
    assert not seen
    turned.turn()
    asked = time.monotonic_ns()
    other = threading.Thread(target=turned.call_soon_threadsafe, args=(future.set_result, 7))
    other.start()
    other.join()
    told = time.monotonic_ns()
    assert not task.done()
    turned.turn()
    assert task.done()
    assert seen == [7]
    # When the other thread said it, not when it was listened to.
    assert asked <= turned.at <= told


def test_turning_leaves_the_loop_of_its_thread_as_it_was(turned):
    async def turns():
        turned.call_soon_threadsafe(list)
        turned.turn()
        return asyncio.get_running_loop()

    with asyncio.Runner() as runner:
        assert runner.run(turns()) is runner.get_loop()
    with pytest.raises(RuntimeError, match="no running event loop"):
        asyncio.get_running_loop()


def test_an_unknown_error_reaches_the_next_frame(tap, monkeypatch):
    device = autd3_immediate(tap.address, ONE)
    with device:
        units = device.units

        async def breaks():
            raise ValueError("out of the blue")

        monkeypatch.setattr(units, "_query_state", breaks)
        with pytest.raises(DeviceError, match="out of the blue"), device.frames_to_come(answered(device)) as put:
            put_some(put, units, 20)
        assert not device.emitting


def answered(device, level=1.0):
    choices = ExposureChoices(profile=profile_named(DEFAULT_PROFILE), override="a test")
    return check_exposure_level(level, device, choices, rate=1000.0)


def instant_of(datagram):
    """Instant of a frame, in ns of device time; the datagram holds whole microseconds."""
    return 1000 * int.from_bytes(datagram[6:10], "little")


def frames_on(tap):
    """(instant, phase of the first transducer, intensity of the first) of every frame with an instant."""
    return [(instant_of(d), d[20], d[-249]) for _, _, command, d in tap.frames() if command == PATTERN and any(d[6:10])]


def silences(tap):
    return [d for _, _, command, d in tap.frames() if command == PATTERN and not any(d[-249:])]


def put_some(put, units, count, *, first=0, lead=6 * MS, intensity=200):
    begin = units.now() + lead
    for number in range(count):
        while units.now() < begin + number * MS - lead:
            time.sleep(2e-4)
        put(np.full((1, 249), first + number, np.uint8), intensity, begin + number * MS)
    time.sleep(0.02)
    return begin


def test_the_wire_carries_every_frame_with_its_instant_and_then_silence(tap, attempts):
    device = autd3_immediate(tap.address, ONE)
    with device:
        # One run of some leaves out less than half: a computer that others keep busy does so more often.
        for _ in attempts:
            before, already = device.units.counts(), len(frames_on(tap))
            with device.frames_to_come(answered(device)) as put:
                begin = put_some(put, device.units, 40)
                assert device.emitting
            told = {name: count - before[name] for name, count in device.units.counts().items()}
            assert not device.emitting
            if told["late"] + told["crowded"] < 20 and told["answered"] == told["sent"]:
                break
    seen = frames_on(tap)[already:]
    # A computer that others keep busy leaves frames out, and says how many: those that went were right, and in order.
    which = [phase for _, phase, _ in seen]
    assert which == sorted(set(which))
    assert {intensity for _, _, intensity in seen} == {200}
    assert np.array([at for at, _, _ in seen]) == pytest.approx(begin + np.array(which) * MS, abs=1000)
    assert (told["sent"], told["answered"], told["lost"]) == (len(which), len(which), 0)
    assert len(which) + told["late"] + told["crowded"] == 40
    assert told["late"] + told["crowded"] < 20
    assert tap.frames()[-1][3] in silences(tap)


def test_a_frame_whose_instant_has_gone_by_is_not_sent_and_each_order_counts_its_late_ones(tap):
    device = autd3_immediate(tap.address, ONE)
    with device:
        with device.frames_to_come(answered(device)) as put:
            for _ in range(20):
                put(np.zeros((1, 249), np.uint8), 200, device.units.now() - MS)
            time.sleep(0.02)
            assert device.units.counts()["late"] == 20
            assert frames_on(tap) == []
        drive = Drive(phase=np.zeros((5, 249)), level=np.full(5, 0.1), rate=1000.0, array=device.array)
        assert device.play(clear_any_exposure(drive, device)).late <= 5


def test_a_frame_above_the_cleared_level_ends_in_silence(tap):
    device = autd3_immediate(tap.address, ONE)
    with device:
        clearance = answered(device, 0.5)
        assert clearance.strongest == 127
        with pytest.raises(ExposureError, match="up to 127 of 255, got 128"), device.frames_to_come(clearance) as put:
            put_some(put, device.units, 3, intensity=127)
            put_some(put, device.units, 1, intensity=128)
        assert not device.emitting
    assert {intensity for _, _, intensity in frames_on(tap)} == {127}


@pytest.mark.parametrize("triggered", [False, True])
def test_sound_ends_when_the_hours_of_a_day_are_over(triggered, tap):
    device, report = autd3_immediate(tap.address, ONE), {"duration": 0.0}
    profile = replace(profile_named(DEFAULT_PROFILE).under(200.0), hours=2e-5)
    with device:
        device.simulated = False
        clearance = check_exposure_level(1.0, device, ExposureChoices(profile=profile), rate=1000.0)
        playing = device.drives_to_come() if triggered else device.frames_to_come(clearance)
        with pytest.raises(ExposureError, match="2e-05 h of sound a day"), playing as put:
            if triggered:
                put, _ = put[1](clearance, "x", report)
                put_some(put, device.units, 100)
                report["duration"] = 0.08
            put_some(put, device.units, 200)
        assert not device.emitting


def test_nothing_sounds_outside(tap):
    device = autd3_immediate(tap.address, ONE)
    with device:
        with device.frames_to_come(answered(device)) as put:
            pass
        with pytest.raises(DeviceStateError, match="nothing sounds unchecked"):
            put(np.zeros((1, 249), np.uint8), 200, device.units.now() + 6 * MS)
    assert frames_on(tap) == []


def test_midair_stop_silences_and_nothing_sounds_after_it(tap):
    device = autd3_immediate(tap.address, ONE)
    ended = []

    def play():
        with pytest.raises(StoppedError), device, device.frames_to_come(answered(device)) as put:
            while True:
                put_some(put, device.units, 5)
        ended.append(time.monotonic())

    playing = threading.Thread(target=play)
    playing.start()
    while len(frames_on(tap)) < 10:
        time.sleep(0.005)
    (stopped,) = stop_playing()
    confirmed = len(frames_on(tap))
    playing.join(5)
    assert stopped.outcome == "silent"
    assert ended
    assert len(frames_on(tap)) == confirmed, "no frame after the answer"
    assert tap.frames()[-1][3] in silences(tap)


def test_units_go_silent_without_messages_and_it_is_reported(tap):
    device = autd3_immediate(tap.address, ONE)
    with device, pytest.raises(SilentFramesError, match="failsafe silenced"):  # noqa: SIM117
        with device.frames_to_come(answered(device)) as put:
            put_some(put, device.units, 5)
            time.sleep(0.1)
            assert all(state & FAILSAFE for state in tap.states())
            for _ in range(200):
                put_some(put, device.units, 5)
    assert not device.emitting


def test_units_that_their_failsafe_silenced_sound_again_after_a_release(tap):
    device = autd3_immediate(tap.address, ONE)
    with device, device.frames_to_come(answered(device)) as put:
        put_some(put, device.units, 5)
        time.sleep(0.1)
        with pytest.raises(SilentFramesError):
            for _ in range(200):
                put_some(put, device.units, 5)
        device.resume()
        put_some(put, device.units, 20)
        assert all(not state & FAILSAFE for state in tap.states())
        assert device.units.counts()["failsafe"] == 1
        assert device.emitting


def test_units_that_are_too_hot_are_silenced_and_sound_again_once_they_have_cooled(tap):
    device = autd3_immediate(tap.address, ONE)
    drive = Drive(phase=np.zeros((5, 249)), level=np.full(5, 0.1), rate=1000.0, array=device.array)
    with device:
        with pytest.raises(TooHotError, match=r"unit 0 too hot after \d+ frames"):  # noqa: SIM117
            with device.frames_to_come(answered(device)) as put:
                put_some(put, device.units, 30)
                tap.hot, began = range(65536), time.monotonic()
                while time.monotonic() - began < 5:
                    put_some(put, device.units, 5)
        ended, sent = time.monotonic(), len(frames_on(tap))
        assert ended - began < 0.6
        assert sent > 0
        assert tap.frames()[-1][3] in silences(tap)
        with (
            pytest.raises(TooHotError, match="too hot before the first frame"),
            device.frames_to_come(answered(device)),
        ):
            pass
        with pytest.raises(TooHotError, match="too hot before the first frame"):
            device.play(clear_any_exposure(drive, device))
        assert len(frames_on(tap)) == sent
        tap.hot = ()
        assert device.play(clear_any_exposure(drive, device)).frames == 5


def test_frames_are_dropped_while_a_unit_is_too_hot_and_sound_again_a_second_after_it_has_cooled(tap):
    device, told = autd3_immediate(tap.address, ONE), []
    device.cooling = Cooling(report=told.append)
    with device, device.frames_to_come(answered(device)) as put:
        put_some(put, device.units, 5)
        tap.hot, began = range(65536), time.monotonic()
        while not device.paused and time.monotonic() - began < 5:
            seen = time.monotonic()
            put_some(put, device.units, 5)
        silent, sent = time.monotonic(), len(frames_on(tap))
        assert silent - began < 0.6
        assert tap.frames()[-1][3] in silences(tap)
        tap.hot = ()
        while device.paused and time.monotonic() - silent < 10:
            put_some(put, device.units, 5)
        assert time.monotonic() - seen > 1.0
        dropped = device.units.counts()["hot"]
        assert dropped > 100
        put_some(put, device.units, 20)
        assert device.units.counts()["hot"] == dropped
    assert len(frames_on(tap)) > sent
    assert len(told) == 2
    assert re.search(r"got unit 0 too hot after \d+ frames .*; silent until all units have been cool for 1 s", told[0])
    assert told[1].startswith("units have cooled; playback continues after a pause of ")


def test_one_lost_datagram_is_one_frame_and_a_cut_wire_is_the_end(tap, attempts):
    for _ in attempts:
        device, lost, cut = autd3_immediate(tap.address, ONE), tap.lost, 0.0
        with pytest.raises(LinkLostError), device:  # noqa: SIM117
            with device.frames_to_come(answered(device)) as put:
                put_some(put, device.units, 5)
                tap.lose(PATTERN)
                before = device.units.counts()["sent"]
                put_some(put, device.units, 20, first=5)
                assert tap.lost == lost + 1
                # The wire is still there; a busy computer leaves some out.
                assert device.units.counts()["sent"] > before + 3
                tap.passes = False
                cut = time.monotonic()
                while time.monotonic() - cut < 2:
                    put_some(put, device.units, 5)
        # The answers of a busy computer may be so late that the link ends before it is cut.
        if cut:
            break
    assert 0 < time.monotonic() - cut < 1.5
