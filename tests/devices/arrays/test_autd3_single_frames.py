"""Single frames on the wire to AUTD3's emulator: their instants, what is not sent, and every way in which it ends."""

import threading
import time

import numpy as np
import pytest

from midair.devices import ExposureChoices, admit_level, autd3_immediate, stop_playing
from midair.errors import DeviceStateError, ExposureError, LinkLostError, SilentFramesError, StoppedError
from midair.files import DEFAULT_PROFILE, profile_named
from midair.model import Placement

pytest.importorskip("autd3")

ONE = Placement.grid(columns=1, rows=1)
PATTERN, FAILSAFE, MS = 0x16, 0x80, 1_000_000


def answered(device, level=1.0):
    choices = ExposureChoices(profile=profile_named(DEFAULT_PROFILE), override="a test")
    return admit_level(level, device, choices, rate=1000.0)


def instant_of(datagram):
    """Of a frame, in ns of device time, which the wire carries in whole microseconds."""
    return 1000 * int.from_bytes(datagram[6:10], "little")


def frames_on(tap):
    """(instant, phase of the first transducer, intensity of the first) of every frame that has an instant."""
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


def test_the_wire_carries_every_frame_with_its_instant_and_then_silence(tap):
    device = autd3_immediate(tap.address, ONE)
    with device:
        with device.frames_to_come(answered(device)) as put:
            begin = put_some(put, device.units, 40)
            assert device.emitting
        told = device.units.told()
        assert not device.emitting
    seen = frames_on(tap)
    # A computer that others keep busy leaves frames out, and says how many: those that went were right, and in order.
    which = [phase for _, phase, _ in seen]
    assert which == sorted(set(which))
    assert {intensity for _, _, intensity in seen} == {200}
    assert np.array([at for at, _, _ in seen]) == pytest.approx(begin + np.array(which) * MS, abs=1000)
    assert (told["sent"], told["answered"], told["lost"]) == (len(which), len(which), 0)
    assert len(which) + told["late"] == 40
    assert told["late"] < 20
    assert tap.frames()[-1][3] in silences(tap)


def test_a_frame_whose_instant_has_gone_by_is_not_sent(tap):
    device = autd3_immediate(tap.address, ONE)
    with device, device.frames_to_come(answered(device)) as put:
        put(np.zeros((1, 249), np.uint8), 200, device.units.now() - MS)
        time.sleep(0.02)
        assert device.units.told()["late"] == 1
        assert frames_on(tap) == []


def test_a_frame_stronger_than_what_was_admitted_ends_in_silence(tap):
    device = autd3_immediate(tap.address, ONE)
    with device:
        admission = answered(device, 0.5)
        assert admission.strongest == 127
        with pytest.raises(ExposureError, match="up to 127 of 255, got 128"), device.frames_to_come(admission) as put:
            put_some(put, device.units, 3, intensity=127)
            put_some(put, device.units, 1, intensity=128)
        assert not device.emitting
    assert {intensity for _, _, intensity in frames_on(tap)} == {127}


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


def test_units_go_silent_by_themselves_when_nobody_speaks_and_it_is_said(tap):
    device = autd3_immediate(tap.address, ONE)
    with device, pytest.raises(SilentFramesError, match="failsafe silenced"):  # noqa: SIM117
        with device.frames_to_come(answered(device)) as put:
            put_some(put, device.units, 5)
            time.sleep(0.1)
            assert all(state & FAILSAFE for state in tap.states())
            for _ in range(200):
                put_some(put, device.units, 5)
    assert not device.emitting


def test_one_lost_datagram_is_one_frame_and_a_cut_wire_is_the_end(tap):
    device = autd3_immediate(tap.address, ONE)
    with pytest.raises(LinkLostError), device:  # noqa: SIM117
        with device.frames_to_come(answered(device)) as put:
            put_some(put, device.units, 5)
            tap.lose(PATTERN)
            put_some(put, device.units, 20, first=5)
            assert tap.lost == 1
            assert device.units.told()["sent"] > 20
            tap.passes = False
            began = time.monotonic()
            while time.monotonic() - began < 2:
                put_some(put, device.units, 5)
    assert time.monotonic() - began < 1.5
