"""The driver for older firmware with the SDK's audit link, whose memory can be read."""

import threading
import time

import numpy as np
import pytest
from tests.drives import noise
from tests.simulators.exposure_override import clear_any_exposure

from midair.devices import pyautd3_array
from midair.devices.frame_bytes import intensity_bytes, phase_bytes
from midair.errors import TooHotError, UnknownDeviceError
from midair.model import Drive, Placement

pyautd3 = pytest.importorskip("pyautd3")

PAIR = Placement.grid(columns=2, rows=1)


def held(banks, unit, bank, frame):
    """Phases and intensities in a segment, shape (transducer,) each."""
    from midair.devices.arrays.pyautd3_banks import SEGMENTS

    intensity, phase = banks.link.drives_at(unit, SEGMENTS[bank], frame)
    return phase, intensity


def check_memory(banks, drive, units, block=250):
    """Load block after block into the two segments alternately; all bytes equal the drive, and the end is silent."""
    phases, intensity = phase_bytes(drive, units), intensity_bytes(drive, units)
    wanted = np.broadcast_to(intensity if intensity.ndim == 3 else intensity[:, None, None], phases.shape)
    for bank, first in enumerate(range(0, drive.frames, block)):
        part = slice(first, min(first + block, drive.frames))
        banks.load(bank % 2, phases[part], intensity[part], 40)
        kept = [[held(banks, unit, bank % 2, k) for unit in range(units)] for k in range(part.stop - first + 1)]
        np.testing.assert_array_equal([[phase for phase, _ in frame] for frame in kept[:-1]], phases[part])
        np.testing.assert_array_equal([[strength for _, strength in frame] for frame in kept[:-1]], wanted[part])
        assert max(int(strength.max()) for _, strength in kept[-1]) == 0


@pytest.mark.long
def test_memory_is_the_drive_to_the_last_bit():
    with pyautd3_array("audit", PAIR) as device:
        check_memory(device.units, noise(60, PAIR), 2, block=25)


def test_memory_with_levels_of_frames_and_of_transducers():
    rng = np.random.default_rng(6)
    with pyautd3_array("audit", PAIR) as device:
        check_memory(device.units, noise(20, PAIR, rng.random(20)), 2)
        check_memory(device.units, noise(20, PAIR, rng.random((20, 498))), 2)


@pytest.mark.clock
@pytest.mark.slow
def test_five_thousand_frames_on_four_units():
    placement = Placement.grid()
    drive = noise(5000, placement)
    with pyautd3_array("audit", placement) as device:
        check_memory(device.units, drive, 4)
        report = device.play(clear_any_exposure(drive, device))
    assert (report.frames, report.late, report.gap) == (5000, 0, 0)


@pytest.mark.long
@pytest.mark.parametrize("hours", [-1, 1])
def test_a_wall_clock_that_jumps_by_an_hour_while_it_plays_changes_nothing(monkeypatch, hours):
    jump, reports = [0], []
    for name, second in (("time", 1), ("time_ns", 1_000_000_000)):
        honest = getattr(time, name)
        monkeypatch.setattr(time, name, lambda honest=honest, second=second: honest() + jump[0] * 3600 * second)

    def play():
        with pyautd3_array("audit", PAIR) as device:
            progress = lambda done, _: jump.__setitem__(0, hours if done >= 250 else 0)  # noqa: E731
            reports.append(device.play(clear_any_exposure(noise(1000, PAIR), device), progress=progress))

    thread = threading.Thread(target=play, daemon=True)
    thread.start()
    thread.join(30)
    assert not thread.is_alive(), "it waits for an hour to pass"
    assert (reports[0].frames, reports[0].late, reports[0].gap) == (1000, 0, 0)


@pytest.mark.long
def test_after_playing_the_segment_that_plays_is_silent():
    with pyautd3_array("audit", PAIR) as device:
        report = device.play(clear_any_exposure(noise(300, PAIR), device))
        assert (report.frames, report.late) == (300, 0)
        assert not device.emitting
        segment = int(device.units.link.current_stm_segment(0))
        assert held(device.units, 0, segment, 0)[1].max() == 0


@pytest.mark.long
def test_the_silencer_is_set():
    slow = np.zeros((20, 498))
    drive = Drive(phase=slow, level=np.ones(20), rate=1000.0, array=PAIR.array())
    with pyautd3_array("audit", PAIR) as device:
        device.play(clear_any_exposure(drive, device))
        assert not device.units.link.silencer_fixed_completion_steps_mode(0)
        device.silencer = "half"
        device.play(clear_any_exposure(noise(20, PAIR), device))
        assert device.units.link.silencer_fixed_completion_steps_mode(0)
        assert device.units.link.silencer_completion_steps_phase(0) == 20
        assert not device.units.link.silencer_strict(0)


@pytest.mark.long
def test_a_unit_that_is_too_hot_does_not_sound():
    with pyautd3_array("audit", PAIR) as device:
        assert device.play(clear_any_exposure(noise(300, PAIR), device)).units == "not too hot"
        device.units.link.assert_thermal_sensor(1)
        with pytest.raises(TooHotError, match="unit 1 too hot before the first frame"):
            device.play(clear_any_exposure(noise(300, PAIR), device))


@pytest.mark.long
def test_a_link_that_breaks_ends_playing():
    from midair.errors import DeviceError

    def cut(done, _):
        if done >= 250:
            device.units.link.break_down()

    device = pyautd3_array("audit", PAIR)
    with pytest.raises(DeviceError, match="pyautd3"), device:
        device.play(clear_any_exposure(noise(2000, PAIR), device), progress=cut)


def test_a_link_that_the_sdk_has_not():
    with pytest.raises(UnknownDeviceError, match=r"remote:ADDRESS:PORT.*got 'soem'"):
        pyautd3_array("soem", PAIR).open()


@pytest.mark.skipif(pyautd3.__version__.startswith("36."), reason="version 36 has EtherCrab")
def test_the_error_of_the_later_sdk_names_an_alternative_to_ethercrab():
    with pytest.raises(UnknownDeviceError, match="twincat"):
        pyautd3_array("ethercrab", PAIR).open()
