"""From an admitted drive to a played one, and to what a sensor felt of it."""

import time
from pathlib import Path

from midair.devices import ArrayDevice, ExposureChoices, ExposureClearance, SensorDevice, read_frames
from midair.errors import MismatchError
from midair.files import DEFAULT_PROFILE, profile_named
from midair.model import Progress, Provenance, Recording
from midair.rig.playing.cleared_play import play_cleared


def usual_exposure() -> ExposureChoices:
    """What is allowed where nobody said otherwise: the profile that comes first, nothing weakened, nobody answering."""
    return ExposureChoices(profile=profile_named(DEFAULT_PROFILE))


def rerecord(
    admission: ExposureClearance,
    array: ArrayDevice,
    sensor: SensorDevice,
    *,
    source: str | Path = "loop",
    tail: float = 0.02,
    progress: Progress | None = None,
) -> Recording:
    """Play what was admitted on an open array and record it with an open sensor from before its first frame on.

    A simulated sensor hears the first frame at time 0. On a real rig the array takes its time to begin, so everything
    that the sensor heard from the order to play on is kept: `evaluate.find_delay` tells where the drive begins.

    Parameters
    ----------
    admission : Admission
        What `admit` gave for this array.
    array, sensor : ArrayDevice, SensorDevice
        Open. The sensor must keep what it samples until it is read.
    source : str or Path
        What to call the drive in the log; a file is hashed there.
    tail : float
        How much longer than the drive to record, in s, so that a delay cuts nothing off.
    progress : callable, optional
        Called with (frames played, frames in all).

    Raises
    ------
    MismatchError
        If only one of the two is simulated: they would not hear each other.
    DeviceStateError
        If it was not admitted on this array, or its frames are yet to come.
    DeviceError
        If the sensor loses frames.
    """
    if array.simulated != sensor.simulated:
        raise MismatchError(
            f"expected array and sensor both real or both virtual, got {array.name} and {sensor.name}; they cannot meet"
        )
    drive = admission.check_for(array)
    sensor.start()
    try:
        began = time.monotonic()
        if array.gated:
            report = play_cleared(admission, array, source=source, progress=progress)
        else:
            # Nothing sounds: passes of a loop on the virtual rig would fill the log of what did.
            report = array.play(admission, progress=progress)
        lasted = admission.repeats * drive.frames / drive.rate if sensor.simulated else time.monotonic() - began
        samples = read_frames(sensor, round((lasted + tail) * sensor.rate))
    finally:
        sensor.stop()
    provenance = Provenance(
        source=f"{array.name} heard by {sensor.name}",
        simulated=sensor.simulated or drive.provenance.simulated,
        notes=drive.provenance.notes,
        steps=drive.provenance.steps,
    ).then(
        "play",
        {"array": array.name, "frames": drive.frames, "rate_hz": drive.rate, "silencer": report.silencer},
    )
    return Recording(samples=samples, rate=sensor.rate, sensor=sensor.grid, unit=sensor.unit, provenance=provenance)
