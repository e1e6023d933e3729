"""A constant frame on the emulator over loopback: its output, and silence when Python hangs."""

import time

import numpy as np
import pytest
from tests.simulators.exposure_override import clear_any_exposure

from midair.devices import autd3_constant_frame
from midair.devices.arrays.autd3_address import autd3_place
from midair.devices.arrays.constant_frame_array import ConstantFrameArray
from midair.devices.frame_bytes import phase_bytes
from midair.errors import InputError, SilentFramesError, TooHotError, UnknownDeviceError
from midair.model import Drive, Placement

pytest.importorskip("autd3")

ONE = Placement.grid(columns=1, rows=1)
SHOW, PATTERN, FAILSAFE = 0x16, 0x08, 0x80


def stands(frames, rate=1000.0):
    array = ONE.array()
    phase = np.broadcast_to(np.random.default_rng(2).uniform(0, 6, array.count), (frames, array.count))
    return Drive(phase=phase, level=np.ones(frames), rate=rate, array=array)


def hangs_after(seconds, hang, tap):
    """A progress callback that blocks once, as when Python hangs, and then queries the units."""
    begun, states = time.monotonic(), []

    def progress(done, total):
        if not states and time.monotonic() - begun > seconds:
            time.sleep(hang)
            states.extend(tap.states())

    return progress, states


def test_a_frame_sounds_with_its_phases_until_it_is_silenced(tap):
    drive = stands(300)
    with autd3_constant_frame(tap.address, ONE, failsafe=0.5) as device:
        report = device.play(clear_any_exposure(drive, device, repeats=2))
    assert (report.frames, report.duration, report.late) == (600, 0.6, 0)
    shown = [datagram for _, _, command, datagram in tap.frames() if command == SHOW]
    loud = [datagram for datagram in shown if datagram[-1]]
    assert len(loud) == 1
    # Phase and intensity of each transducer; then only silence.
    pairs = np.frombuffer(loud[0][-498:], np.uint8)
    wanted = phase_bytes(drive, 1)[0, 0]
    assert any(np.array_equal(part, wanted) for part in (pairs[:249], pairs[249:], pairs[::2], pairs[1::2]))
    assert not shown[-1][-1]


def test_a_python_that_hangs_is_silent_though_its_process_lives(tap):
    with autd3_constant_frame(tap.address, ONE) as device:
        progress, states = hangs_after(0.2, 0.4, tap)
        with pytest.raises(SilentFramesError, match=r"failsafe silenced unit 0: frames \d+ to 1999 of 2000"):
            device.play(clear_any_exposure(stands(2000), device), progress=progress)
        assert states == [PATTERN | FAILSAFE]
        assert device.play(clear_any_exposure(stands(20), device)).frames == 20


@pytest.mark.long
def test_with_the_sdk_s_heartbeat_it_would_sound_on(tap):
    """The reason why it is off: with it, a hang longer than the failsafe does not silence the units."""
    from midair.devices.arrays.autd3_udp import Autd3Udp

    place = autd3_place(tap.address)
    with ConstantFrameArray(lambda placement: Autd3Udp(placement, place), ONE, name="with a heartbeat") as device:
        progress, states = hangs_after(0.2, 0.8, tap)
        device.play(clear_any_exposure(stands(2000), device), progress=progress)
    assert states == [PATTERN]


def test_a_unit_that_is_too_hot_ends_it(tap):
    def heat(done, total):
        tap.hot = range(65536)

    with autd3_constant_frame(tap.address, ONE) as device:
        with pytest.raises(TooHotError, match=r"unit 0 too hot after \d+ of 2000 frames"):
            device.play(clear_any_exposure(stands(2000), device), progress=heat)
        assert not tap.frames()[-1][3][-1]
        with pytest.raises(TooHotError, match="before the first frame"):
            device.play(clear_any_exposure(stands(2000), device))


def test_a_drive_that_changes_is_refused():
    array = ONE.array()
    moving = Drive(phase=np.arange(2)[:, None] * np.ones(array.count), level=np.ones(2), rate=1000.0, array=array)
    with autd3_constant_frame("emulator", ONE) as device, pytest.raises(InputError, match="expected identical frames"):
        device.play(clear_any_exposure(moving, device))


def test_a_server_is_refused_since_its_heartbeat_keeps_units_on():
    with pytest.raises(UnknownDeviceError, match="a server's heartbeat keeps them on"):
        autd3_constant_frame("server", ONE).open()
