"""The contract of every array; to test a new one, add an entry to a table. Sensors: sensors/test_sensor_contract.py."""

import weakref

import numpy as np
import pytest
from tests.simulators.autd3_firmware import autd3_firmware
from tests.simulators.exposure_override import clear_any_exposure
from tests.simulators.openmpd import OpenMpdSimulator

from midair.devices import (
    OpenMpdArray,
    VirtualArray,
    VirtualSkin,
    autd3_array,
    autd3_immediate,
    pyautd3_array,
    virtual_immediate,
)
from midair.errors import DeviceStateError, InputError, MismatchError, StoppedError
from midair.model import Board, Drive, Placement, TransducerArray
from midair.physics import focus_phase
from midair.physics.sensing import SensorModel

ARRAY = TransducerArray.autd3(columns=1, rows=1)
ONE = Placement.grid(columns=1, rows=1)


def openmpd(*boards):
    return OpenMpdArray([board.port for board in boards], [Board.nominal()] * len(boards))


ARRAYS = {
    "virtual": lambda: VirtualArray(ARRAY),
    "virtual on skin": lambda: VirtualArray(ARRAY, VirtualSkin(SensorModel())),
    "autd3:firmware": lambda: autd3_firmware(ONE),
    "autd3:emulator": lambda: autd3_array("emulator", ONE),
    "autd3, frame by frame": lambda: autd3_immediate("emulator", ONE, failsafe=0.5),
    "virtual, frame by frame": lambda: virtual_immediate(ONE),
    "pyautd3:audit": lambda: pyautd3_array("audit", ONE),
    "pyautd3:nop": lambda: pyautd3_array("nop", ONE),
    "openmpd": openmpd,
    "openmpd twin": openmpd,
}
BOARDS = {"openmpd": 1, "openmpd twin": 2}


def drive(device, frames=5, rate=1000.0):
    array = getattr(device, "array", device)
    phase = np.broadcast_to(focus_phase(array, np.array([0, 0, 0.2])), (frames, array.count))
    return Drive(phase=phase, level=np.ones(frames), rate=rate, array=array)


SLOWER = {"openmpd twin"}
"""Arrays that differ little from another: they are in the long suite."""


@pytest.fixture(
    params=[pytest.param(name, marks=pytest.mark.long if name in SLOWER else ()) for name in ARRAYS], ids=list(ARRAYS)
)
def array(request):
    boards = [OpenMpdSimulator() for _ in range(BOARDS.get(request.param, 0))]
    yield ARRAYS[request.param](*boards)
    for board in boards:
        board.settle()
        assert not board.sounds, "what a board got last must be silence"
        board.close()


@pytest.mark.long
def test_an_array_tells_what_it_played(array, attempts):
    seen = []
    with array:
        for _ in attempts:
            report = array.play(clear_any_exposure(drive(array), array), progress=lambda *so_far: seen.append(so_far))
            if report.late == 0:
                break
    assert (report.frames, report.late, report.repeated) == (5, 0, 0)
    assert report.duration == pytest.approx(0.005)
    assert seen[-1] == (5, 5)


def test_an_array_is_silent_before_and_after(array):
    with array:
        assert not array.emitting
        array.play(clear_any_exposure(drive(array), array))
        assert not array.emitting
    assert not array.emitting


@pytest.mark.parametrize("failure", [RuntimeError, KeyboardInterrupt, MemoryError])
def test_an_array_is_silent_after_any_failure_on_the_way(array, failure):
    loud = []

    def fail(done, total):
        loud.append(array.emitting)
        raise failure

    with array:
        with pytest.raises(failure):
            array.play(clear_any_exposure(drive(array, frames=300), array), progress=fail)
        assert loud == [True]
        assert not array.emitting


def test_phases_of_another_array_are_refused(array):
    other = TransducerArray.autd3(columns=2, rows=2)
    with array, pytest.raises(MismatchError, match=r"996.*solve the target again"):
        array.play(clear_any_exposure(drive(other), array))
    assert not array.emitting


def test_a_closed_array_does_not_play(array):
    with pytest.raises(DeviceStateError, match="open"):
        array.play(clear_any_exposure(drive(array), array))


@pytest.mark.long
def test_repeats_and_a_delay_are_played(array, attempts):
    with array:
        for _ in attempts:
            report = array.play(clear_any_exposure(drive(array), array, repeats=3), delay=0.01)
            if report.late == 0:
                break
        assert (report.frames, report.late) == (15, 0)
        assert report.duration == pytest.approx(0.015)
        assert not array.emitting


def test_repeats_that_make_no_sense_are_refused(array):
    with array:
        for repeats in (0, -1):
            with pytest.raises(InputError, match="repeat"):
                clear_any_exposure(drive(array), array, repeats=repeats)


def test_delays_that_make_no_sense_are_refused(array):
    with array:
        admission = clear_any_exposure(drive(array), array)
        for delay in (-1.0, float("nan"), float("inf")):
            with pytest.raises(InputError, match="delay"):
                array.play(admission, delay=delay)


def test_an_unchecked_drive_does_not_play(array):
    with array, pytest.raises(DeviceStateError, match=r"expected the result of check_exposure\(\), got a Drive"):
        array.play(drive(array))
    assert not array.emitting


def test_there_is_no_way_round_play(array):
    """A driver's `emit` sounds only within `play`."""
    if not array.gated:
        return
    with array:
        with pytest.raises(DeviceStateError, match="nothing sounds unchecked"):
            array.emit(drive(array), None)
        assert not array.emitting
        assert array.play(clear_any_exposure(drive(array), array)).frames == 5


@pytest.mark.long
def test_an_array_calls_the_permission_check_before_any_sound(array):
    def refused():
        raise StoppedError("not armed")

    with array:
        array.allowing(refused)
        with pytest.raises(StoppedError, match="not armed"):
            array.play(clear_any_exposure(drive(array), array))
        assert not array.emitting
        array.allowing(None)
        assert array.play(clear_any_exposure(drive(array), array)).frames == 5


def test_a_clearance_for_a_silent_device_is_invalid_on_a_gated_one(array):
    if not array.gated:
        return
    silent = VirtualArray(array.array)
    with array, pytest.raises(DeviceStateError, match="check it again"):
        array.play(clear_any_exposure(drive(array), silent))
    assert not array.emitting


@pytest.mark.long
def test_an_array_plays_again_after_it_has_played(array):
    with array:
        array.play(clear_any_exposure(drive(array), array))
        assert array.play(clear_any_exposure(drive(array), array)).frames == 5


def test_an_array_holds_no_drive_of_an_order_that_another_replaced():
    """A pattern that is changed a hundred times while it plays needs the memory of one."""
    with (device := virtual_immediate(ONE)), device.drives_to_come() as (_, begin):
        admission = clear_any_exposure(drive(device), device)
        begin(admission, "a.toml", {})
        held = weakref.ref(admission.drive.phase)
        del admission
        assert held() is None


def test_closing_twice_and_silence_at_any_time_are_harmless(array):
    array.silence()
    with array:
        array.silence()
        assert array.play(clear_any_exposure(drive(array), array)).frames == 5
    array.silence()
    array.close()
