"""Parts of a drive that are checked while earlier ones play: what can be read, what sounds, what is logged."""

import threading
from dataclasses import replace

import numpy as np
import pytest

from midair.devices import (
    ExposureChoices,
    ExposureStream,
    VirtualArray,
    autd3_firmware,
    check_exposure,
    phase_bytes,
    read_log,
)
from midair.errors import ExposureError, StoppedError
from midair.files import profile_named
from midair.model import Drive, Placement
from midair.rig.dose import dose_report

ONE = Placement.grid(columns=1, rows=1)
ARRAY = ONE.array()
CHOICES = ExposureChoices(profile=profile_named("occupational-110"))
QUIET = 0.01


class Loud(VirtualArray):
    """A virtual array that is treated as one with sound."""

    gated = True


def noise(frames, level=QUIET, rate=1000.0):
    phase = np.random.default_rng(0).uniform(-10, 10, (frames, ARRAY.count))
    return Drive(phase=phase, level=np.broadcast_to(level, (frames,)), rate=rate, array=ARRAY)


def parts_of(drive, *lengths):
    first = 0
    for length in lengths:
        part = slice(first, first + length)
        yield replace(drive, phase=drive.phase[part], level=drive.level[part])
        first += length


def stream_of(drive, device=None, choices=CHOICES, **others):
    return ExposureStream(device or Loud(ARRAY), choices, frames=drive.frames, **others)


def test_parts_are_measured_as_the_whole_and_played_as_it():
    drive = noise(1234, np.linspace(0, QUIET, 1234))
    stream = stream_of(drive)
    for part in parts_of(drive, 130, 5, 800, 299):
        stream.add(part, took=0.01)
    stream.end()
    whole = check_exposure(drive, Loud(ARRAY), CHOICES).exposure
    for name in ("peak", "mean", "dose", "duty", "warming", "excess", "nonlinearity", "duration"):
        np.testing.assert_allclose(getattr(stream.exposure, name), getattr(whole, name), rtol=1e-6, err_msg=name)
    assert stream.exposure.pressure >= whole.pressure  # of 256 frames of each part
    assert stream.exposure.worst == whole.worst
    assert stream.exposure.measured_in == whole.measured_in
    read = stream.clearance().drive
    np.testing.assert_array_equal(phase_bytes(read, 1)[0:1234].read(0, 1234), phase_bytes(drive, 1))
    np.testing.assert_array_equal(read.level[0:1234].read(0, 1234), drive.level)


def test_a_frame_that_was_not_checked_cannot_be_read():
    drive = noise(300)
    stream = stream_of(drive)
    first, second = parts_of(drive, 100, 200)
    stream.add(first, took=0.01)
    frames = stream.clearance().drive.phase
    got = []
    reader = threading.Thread(target=lambda: got.append(frames.read(150, 160)))
    reader.start()
    reader.join(0.15)
    assert not got
    stream.add(second, took=0.01)
    reader.join()
    assert got[0].shape == (10, ARRAY.count)
    stream.end()


def test_attenuation_needs_all_frames_and_is_that_of_the_whole():
    weaker = replace(CHOICES, attenuate=True)
    drive = noise(300, 1.0)
    stream = stream_of(drive, choices=weaker)
    for part in parts_of(drive, 200, 100):
        stream.add(part, took=0.01)
    assert stream.admitted == 300
    assert stream._clearance is None
    stream.end()
    admission, whole = stream.clearance(), check_exposure(drive, Loud(ARRAY), weaker)
    assert admission.outcome == "attenuated"
    np.testing.assert_array_equal(admission.drive.level.read(0, 300), whole.drive.level)


def test_the_delay_before_the_first_frame_suffices_for_the_last():
    drive = noise(1000)
    stream = stream_of(drive)
    stream.add(next(parts_of(drive, 200)), took=0.0)
    stream.MARGIN, stream.SPARE, stream._pace = 1.0, 0.0, 0.5e-3
    assert stream.delay() == 0.0  # twice as fast as the sound
    stream._pace = 3e-3
    # 800 frames take 2.4 s; of the 1 s of sound the last part of 200 frames must come before its 0.2 s begin.
    assert stream.delay() == pytest.approx(2.4 - 0.8)
    assert stream.speed == pytest.approx(1 / 3)
    stream.end(StoppedError("enough"))
    assert stream.delay() == 0.0


pytest.importorskip("autd3_emulator")


def played(drive, give, choices=CHOICES):
    """The output of emulated units in virtual time, whose stream gets its next part from `give` while it waits."""
    device = autd3_firmware(ONE, silencer="off")
    stream = ExposureStream(device, choices, frames=drive.frames)
    stream.SPARE = 0.0
    with device:
        forward = device.banks.wait_until

        def wait(instant):
            give(stream, device.banks.now())
            forward(instant)

        device.banks.wait_until = wait
        give(stream, 0)
        try:
            report = device.play(stream.clearance(), source="take.h5")
        except ExposureError as wrong:
            report = wrong
        return report, device.banks.put_out()


def strengths(out, drive):
    """Pulse width of each frame that is not silent, from the first on."""
    width = out.pulse_width.max(axis=1)
    return width[np.flatnonzero(width)[0] :][:: round(40e3 / drive.rate)]


@pytest.mark.long
def test_a_part_that_fails_ends_in_a_fade_and_is_logged():
    drive = noise(600, np.repeat([QUIET, 1.0], [400, 200]))
    parts = [*parts_of(drive, 400, 200)]

    def give(stream, _):
        while parts and not stream.over:
            try:
                stream.add(parts.pop(0), took=0.0)
            except ExposureError as wrong:
                stream.end(wrong)

    wrong, out = played(drive, give)
    assert "is exceeded" in str(wrong)
    width = strengths(out, drive)
    assert np.flatnonzero(width)[-1] < 400
    assert (width[:389] == width[0]).all()
    assert (np.diff(width[389:400].astype(int)) <= 0).all()
    order, end = read_log()[0]
    assert (end["outcome"], end["places"]["left ear"]["limit_db"]) == ("failed", 110.0)
    assert order["sha256"] is None
    assert order["places"]["left ear"]["peak_db"] == 110.0
    assert end["places"]["left ear"]["peak_db"] > 110
    assert dose_report().orders[0]["left_ear_peak_db"] == end["places"]["left ear"]["peak_db"]


@pytest.mark.long
def test_a_stream_that_starves_pauses_between_two_fades_and_reports_the_gap():
    drive, begun = noise(800), []
    parts = [*parts_of(drive, 400, 400)]

    def give(stream, now):
        begun.append(now)
        late = len(begun) > 1 and now - begun[1] > 700_000_000
        if len(parts) == 2 or (late and parts):
            stream.add(parts.pop(0), took=0.0)

    report, out = played(drive, give)
    width = strengths(out, drive)
    silent = np.flatnonzero(width[: np.flatnonzero(width)[-1]] == 0)
    assert 390 <= silent[0] <= 400
    assert report.frames == 800
    assert report.gap == pytest.approx(len(silent) / 1000, abs=0.03)
    assert report.gap > 0.2
    after = width[silent[-1] + 1 :].astype(int)
    assert (np.diff(after[:9]) >= 0).all()
    assert after[0] < after[20] == width[0]
