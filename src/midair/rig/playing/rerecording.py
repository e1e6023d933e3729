"""Play a cleared drive, and re-record it."""

import time
from dataclasses import replace
from pathlib import Path

from midair.devices import (
    ArrayDevice,
    ExposureClearance,
    PlayReport,
    SensorDevice,
    read_frames,
    signals_end_the_program,
)
from midair.errors import MismatchError
from midair.model import Medium, Progress, Recording


def play_cleared(
    admission: ExposureClearance,
    array: ArrayDevice,
    *,
    source: str | Path,
    delay: float = 0.0,
    progress: Progress | None = None,
    room: Medium | None = None,
) -> PlayReport:
    """Play a cleared drive on an open array.

    SIGTERM and SIGHUP end the program as Ctrl-C does, which silences the array. Playing is logged, and `midair stop`
    reaches it on every array. The arguments are those of `ArrayDevice.play`.
    """
    with signals_end_the_program():
        return array.play(admission, source=source, delay=delay, progress=progress, watched=True, room=room)


def rerecord(
    admission: ExposureClearance,
    array: ArrayDevice,
    sensor: SensorDevice,
    *,
    source: str | Path = "loop",
    delay: float = 0.0,
    tail: float = 0.02,
    progress: Progress | None = None,
    room: Medium | None = None,
) -> Recording:
    """Play a cleared drive on an open array and record it with an open sensor, starting before its first frame.

    A simulated sensor records the first frame at time 0. A real array starts with a delay, so the recording holds
    everything since the start of playing: `evaluate.find_delay` finds where the drive begins.

    The sensor must buffer its samples until they are read; `tail` is the recording time in s after the last frame, so
    that a delay cuts nothing off. `source` is the name of the drive in the log; a file is hashed there. `delay` in s
    before the first frame and `room` concern a real array only.

    MismatchError if only one of the two devices is simulated, DeviceStateError if the drive was not cleared for this
    array or holds no frames (live), DeviceError if the sensor loses frames.
    """
    if array.simulated != sensor.simulated:
        raise MismatchError(f"expected array and sensor both real or both virtual, got {array.name} and {sensor.name}")
    drive = admission.check_for(array)
    sensor.start()
    try:
        began = time.monotonic()
        if array.gated:
            report = play_cleared(admission, array, source=source, delay=delay, progress=progress, room=room)
        else:
            # A virtual array emits no sound, and loops on the virtual rig would fill the play log.
            report = array.play(admission, progress=progress)
        lasted = admission.repeats * drive.frames / drive.rate if sensor.simulated else time.monotonic() - began
        samples = read_frames(sensor, round((lasted + tail) * sensor.rate))
    finally:
        sensor.stop()
    played = {"array": array.name, "frames": drive.frames, "rate_hz": drive.rate, "silencer": report.silencer}
    life = replace(drive.provenance, source=f"{array.name} heard by {sensor.name}")
    provenance = life.then("play", played, simulated=sensor.simulated)
    return Recording(samples=samples, rate=sensor.rate, sensor=sensor.grid, unit=sensor.unit, provenance=provenance)
