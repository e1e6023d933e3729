"""Output of AUTD3's firmware emulator, tick by tick, compared with the drive that was played."""

from dataclasses import replace

import numpy as np
import pytest
from tests.drives import noise
from tests.simulators.autd3_firmware import autd3_firmware
from tests.simulators.exposure_override import clear_any_exposure

from midair.devices.arrays.silencer import Silencer
from midair.devices.frame_bytes import amplitude_of, phase_bytes
from midair.model import Acoustics, Drive, Medium, Placement
from midair.physics import focus_phase, quantise_phase, transfer_matrix
from midair.streaming import LazyFrames

ONE = Placement.grid(columns=1, rows=1)
MS = 1_000_000
OFF = Silencer(phase=0, intensity=0)


def played(drive, placement=ONE, *, silencer="off", repeats=1, **options):
    """The report, and the output from 5 ms before the end on."""
    device = autd3_firmware(placement, silencer=silencer)
    with device:
        report = device.play(clear_any_exposure(drive, device, repeats=repeats), **options)
        device.units.wait_until(device.units.now() + 5 * MS)
        return report, device.units.put_out()


def of_frames(values, out, report, frames, ticks=40):
    first = out.row(report.start)
    return values[first : first + frames * ticks].reshape(frames, ticks, -1)


def assert_exact(drive, report, out, units, repeats=1):
    """Every tick of every frame equals the drive, and all is silent before and after."""
    frames = drive.frames * repeats
    wanted = np.tile(phase_bytes(drive, units).reshape(drive.frames, 1, -1), (repeats, 1, 1))
    np.testing.assert_array_equal(
        of_frames(out.phase, out, report, frames), np.broadcast_to(wanted, (frames, 40, wanted.shape[2]))
    )
    assert (of_frames(out.pulse_width, out, report, frames) == 256).all()
    first = out.row(report.start)
    assert out.pulse_width[:first].max() == 0
    assert len(out.pulse_width) > first + 40 * frames
    assert out.pulse_width[first + 40 * frames :].max() == 0


@pytest.mark.long
def test_frames_that_are_read_while_they_play_are_the_drive_s():
    """At most one block of 512 frames is read at once."""
    drive, asked = noise(600), []

    def read(first, last):
        asked.append(last - first)
        return drive.phase[first:last]

    report, out = played(replace(drive, phase=LazyFrames(read, drive.phase.shape)))
    assert (report.frames, report.late, report.gap) == (600, 0, 0)
    assert_exact(drive, report, out, 1)
    assert 0 < max(asked) <= 512


@pytest.mark.long
@pytest.mark.parametrize("frames", [1, 2, 250, 251, 600])
def test_every_tick_of_every_frame_is_the_drive_s(frames):
    drive = noise(frames)
    report, out = played(drive)
    assert (report.frames, report.late, report.repeated, report.gap) == (frames, 0, 0, 0)
    assert_exact(drive, report, out, 1)


@pytest.mark.slow
def test_five_seconds_on_four_units_without_a_break():
    placement = Placement.grid()
    drive = noise(5000, placement)
    report, out = played(drive, placement)
    assert (report.frames, report.late, report.gap) == (5000, 0, 0)
    assert_exact(drive, report, out, 4)


@pytest.mark.long
def test_repeats_follow_each_other_without_a_gap():
    drive = noise(130)
    report, out = played(drive, repeats=4)
    assert report.frames == 520
    assert_exact(drive, report, out, 1, repeats=4)


@pytest.mark.long
def test_a_delay_is_silent():
    report, out = played(noise(10), delay=0.5)
    assert report.start >= out.begin + 500 * MS
    assert out.pulse_width[: out.row(report.start)].max() == 0


@pytest.mark.long
@pytest.mark.parametrize("rate", [40e3 / 3, 4000.0, 100.0])
def test_other_rates(rate):
    drive = noise(20, rate=rate)
    ticks = round(40e3 / rate)
    report, out = played(drive)
    held = of_frames(out.phase, out, report, 20, ticks)
    np.testing.assert_array_equal(held[:, 0], phase_bytes(drive, 1)[:, 0])
    np.testing.assert_array_equal(held[:, -1], phase_bytes(drive, 1)[:, 0])


@pytest.mark.long
def test_a_level_for_each_frame_becomes_a_pulse_width():
    level = np.repeat([0.0, 0.2, 1.0, 0.2, 0.5], 3)
    drive = noise(15, level=level)
    report, out = played(drive)
    width = of_frames(out.pulse_width, out, report, 15)[:, -1]
    np.testing.assert_allclose(np.sin(np.pi * width / 512), np.broadcast_to(level[:, None], width.shape), atol=0.005)


@pytest.mark.long
def test_a_level_for_each_transducer():
    rng = np.random.default_rng(3)
    base = noise(8)
    drive = Drive(phase=base.phase, level=rng.random((8, 249)), rate=1000.0, array=base.array)
    report, out = played(drive)
    width = of_frames(out.pulse_width, out, report, 8)[:, -1]
    np.testing.assert_allclose(np.sin(np.pi * width / 512), drive.level, atol=0.005)
    np.testing.assert_array_equal(of_frames(out.phase, out, report, 8)[:, -1], phase_bytes(drive, 1)[:, 0])


@pytest.mark.long
def test_intensity_bytes_are_the_amplitudes_that_the_emulator_makes():
    level = np.arange(256) / 255
    report, out = played(noise(256, level=level))
    width = of_frames(out.pulse_width, out, report, 256)[:, -1, 0]
    np.testing.assert_allclose(np.sin(np.pi * width / 512), amplitude_of(np.arange(256, dtype=np.uint8)), atol=1e-12)


@pytest.mark.long
@pytest.mark.parametrize("moment", [0.5, 3.0, 17.2, 39.9, 40.1, 62.0])
@pytest.mark.parametrize("active", [0, 1])
def test_silence_also_cancels_the_switch_that_is_to_come(moment, active):
    """The most dangerous failure: a block that starts after silence was confirmed."""
    device = autd3_firmware(ONE, silencer="off")
    drive = noise(80)
    phases = phase_bytes(drive, 1)
    with device:
        banks = device.units
        banks.set_silencer(OFF)
        start = banks.now() + 20 * MS
        banks.load(1 - active, phases[:40], np.full(40, 255, np.uint8), 40)
        banks.switch(1 - active, start)
        banks.wait_until(start + MS // 2)
        banks.load(active, phases[40:], np.full(40, 255, np.uint8), 40)
        banks.switch(active, start + 40 * MS)
        silent = start + round(moment * MS)
        banks.wait_until(silent)
        banks.silence()
        banks.wait_until(silent + 200 * MS)
        out = banks.put_out()
    assert out.pulse_width[out.row(start) + 1].max() == 256
    assert out.pulse_width[out.row(silent) + 1 :].max() == 0


@pytest.mark.long
def test_a_computer_that_hangs_leaves_silence_and_the_gap_is_reported():
    """If the next block is missing, the silent pattern at the end of the last one is reached and repeats."""
    drive = noise(600)

    def hang(done, _):
        if done == 250:
            device.units.wait_until(device.units.now() + 600 * MS)

    device = autd3_firmware(ONE, silencer="off")
    with device:
        report = device.play(clear_any_exposure(drive, device), progress=hang)
        device.units.wait_until(device.units.now() + 5 * MS)
        out = device.units.put_out()
    assert report.late == 100
    assert report.gap == pytest.approx(0.38, abs=0.03)
    first, gap = out.row(report.start), round(report.gap * 40e3)
    assert (out.pulse_width[first : first + 500 * 40] == 256).all()
    assert out.pulse_width[first + 500 * 40 : first + 500 * 40 + gap].max() == 0
    late = out.phase[first + 500 * 40 + gap : first + 600 * 40 + gap].reshape(100, 40, -1)
    np.testing.assert_array_equal(late[:, 0], phase_bytes(drive, 1)[500:, 0])


def test_the_emulator_s_own_field_is_ours():
    """Rms at 16 x 16 points over one unit and over four; no attenuation and 340 m/s are the emulator's constants."""
    placement = Placement.grid()
    array = placement.array()
    phase = focus_phase(array, np.array([0.01, -0.02, 0.2]), acoustics=Acoustics(medium=Medium(attenuation=0)))
    drive = Drive(phase=np.tile(phase, (20, 1)), level=np.ones(20), rate=1000.0, array=array)
    device = autd3_firmware(placement, silencer="off")
    with device:
        device.units.set_silencer(OFF)
        first = device.units.now()
        device.units.load(1, phase_bytes(drive, 4), np.full(20, 255, np.uint8), 40)
        device.units.switch(1, first + 20 * MS)
        device.units.wait_until(first + 35 * MS)
        field = device.units.rms_field((-0.0375, 0.0375), (-0.0375, 0.0375), 0.2, 0.005)
    assert len(field) == 256
    matrix = transfer_matrix(
        field[:, :3], array, acoustics=Acoustics(medium=Medium(attenuation=0), directivity="point")
    )
    ours = np.abs(matrix @ np.exp(1j * quantise_phase(phase))) / np.sqrt(2)
    assert np.linalg.norm(field[:, 3] - ours) / np.linalg.norm(ours) < 1e-5
    assert np.abs(field[:, 3] - ours).max() / ours.max() < 1e-5


@pytest.mark.long
def test_a_spread_step_arrives_within_half_a_frame():
    """A step of 180 degrees: from the middle of each frame on, the phase equals the solved one."""
    phase = np.zeros((10, 249))
    phase[1::2] = np.pi * 0.9
    drive = Drive(phase=phase, level=np.ones(10), rate=1000.0, array=ONE.array())
    report, out = played(drive, silencer="half")
    assert report.silencer.startswith("phase 0.5 ms")
    held = of_frames(out.phase, out, report, 10)
    np.testing.assert_array_equal(held[:, 21:], np.broadcast_to(phase_bytes(drive, 1)[:, :1], (10, 19, 249)))
