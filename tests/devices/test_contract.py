"""The contract of every array; to test a new one, add an entry to a table. Sensors: sensors/test_sensor_contract.py."""

import weakref

import numpy as np
import pytest
from tests.simulators.autd3_firmware import autd3_firmware
from tests.simulators.exposure_override import clear_any_exposure

from midair.devices import VirtualArray, VirtualSkin, autd3_array, autd3_immediate, pyautd3_array, virtual_immediate
from midair.errors import DeviceStateError, InputError, MismatchError, StoppedError
from midair.model import Drive, Placement, Provenance, TransducerArray
from midair.physics import focus_phase
from midair.physics.sensing import SensorModel

ARRAY = TransducerArray.autd3(columns=1, rows=1)
ONE = Placement.grid(columns=1, rows=1)


ARRAYS = {
    "virtual": lambda: VirtualArray(ARRAY),
    "virtual on skin": lambda: VirtualArray(ARRAY, VirtualSkin(SensorModel())),
    "autd3:firmware": lambda: autd3_firmware(ONE),
    "autd3:emulator": lambda: autd3_array("emulator", ONE),
    "autd3, frame by frame": lambda: autd3_immediate("emulator", ONE, failsafe=0.5),
    "virtual, frame by frame": lambda: virtual_immediate(ONE),
    "pyautd3:audit": lambda: pyautd3_array("audit", ONE),
    "pyautd3:nop": lambda: pyautd3_array("nop", ONE),
}


def drive(device, frames=5, rate=1000.0):
    array = getattr(device, "array", device)
    phase = np.broadcast_to(focus_phase(array, np.array([0, 0, 0.2])), (frames, array.count))
    # A drive that states its height is not simulated at many.
    stated = Provenance().then("settings", {"target.grid.height": 0.2})
    return Drive(phase=phase, level=np.ones(frames), rate=rate, array=array, provenance=stated)


@pytest.fixture(params=list(ARRAYS))
def array(request):
    return ARRAYS[request.param]()


@pytest.mark.long
def test_an_array_tells_what_it_played_with_repeats_and_a_delay(array, attempts):
    seen = []
    with array:
        for _ in attempts:
            cleared = clear_any_exposure(drive(array), array, repeats=3)
            report = array.play(cleared, delay=0.01, progress=lambda *so_far: seen.append(so_far))
            if report.late == 0:
                break
        assert not array.emitting
    assert (report.frames, report.late, report.repeated) == (15, 0, 0)
    assert report.duration == pytest.approx(0.015)
    assert seen[-1] == (15, 15)


def test_an_array_plays_again_and_is_silent_before_and_after(array):
    """Also after a refusal of `allowing`; closing twice and silence at any time are harmless."""

    def refused():
        raise StoppedError("not armed")

    array.silence()
    with array:
        assert not array.emitting
        array.silence()
        clearance = clear_any_exposure(drive(array), array)
        array.allowing(refused)
        with pytest.raises(StoppedError, match="not armed"):
            array.play(clearance)
        assert not array.emitting
        array.allowing(None)
        for _ in range(2):
            assert array.play(clearance).frames == 5
            assert not array.emitting
    assert not array.emitting
    array.silence()
    array.close()
    with pytest.raises(DeviceStateError, match="open"):
        array.play(clearance)


def test_an_array_is_silent_after_any_failure_on_the_way(array):
    loud = []
    with array:
        clearance = clear_any_exposure(drive(array, frames=40), array)
        for failure in (RuntimeError, KeyboardInterrupt, MemoryError):

            def fail(done, total, failure=failure):
                loud.append(array.emitting)
                raise failure

            with pytest.raises(failure):
                array.play(clearance, progress=fail)
            assert not array.emitting
    assert loud == [True] * 3


def test_what_makes_no_sense_or_was_not_checked_does_not_play(array):
    """A drive for another array, repeats, delays, an unchecked drive, and one that was cleared for a silent device.

    A driver's `emit` sounds only within `play`.
    """
    other = TransducerArray.autd3(columns=2, rows=2)
    with array:
        with pytest.raises(MismatchError, match=r"996.*solve the target again"):
            clear_any_exposure(drive(other, frames=1), array)
        for repeats in (0, -1):
            with pytest.raises(InputError, match="repeat"):
                clear_any_exposure(drive(array), array, repeats=repeats)
        with pytest.raises(DeviceStateError, match=r"expected the result of check_exposure\(\), got a Drive"):
            array.play(drive(array))
        clearance = clear_any_exposure(drive(array), array)
        for delay in (-1.0, float("nan"), float("inf")):
            with pytest.raises(InputError, match="delay"):
                array.play(clearance, delay=delay)
        if array.gated:
            with pytest.raises(DeviceStateError, match="nothing sounds unchecked"):
                array.emit(drive(array), None)
            with pytest.raises(DeviceStateError, match="check it again"):
                array.play(clear_any_exposure(drive(array), VirtualArray(array.array)))
        assert not array.emitting
        assert array.play(clearance).frames == 5


def test_an_array_holds_no_drive_of_an_order_that_another_replaced():
    """A pattern that is changed a hundred times while it plays needs the memory of one."""
    with (device := virtual_immediate(ONE)), device.drives_to_come() as (_, begin):
        clearance = clear_any_exposure(drive(device), device)
        begin(clearance, "a.toml", {})
        held = weakref.ref(clearance.drive.phase)
        del clearance
        assert held() is None
