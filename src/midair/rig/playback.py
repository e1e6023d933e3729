"""From a drive to a played one, and to what a sensor felt of it."""

from midair.devices import ArrayDevice, Progress, SensorDevice
from midair.errors import DeviceError, MismatchError
from midair.model import Drive, Provenance, Recording


def rerecord(
    drive: Drive,
    array: ArrayDevice,
    sensor: SensorDevice,
    *,
    tail: float = 0.02,
    progress: Progress | None = None,
) -> Recording:
    """Play a drive on an open array and record it with an open sensor from the first frame on.

    Parameters
    ----------
    drive : Drive
        What to play.
    array, sensor : ArrayDevice, SensorDevice
        Open. The sensor must keep what it samples until it is read.
    tail : float
        How much longer than the drive to record, in s, so that a delay cuts nothing off.
    progress : callable, optional
        Called with (frames played, frames in all).

    Raises
    ------
    MismatchError
        If only one of the two is simulated: they would not hear each other.
    DeviceError
        If the sensor loses frames.
    """
    if array.simulated != sensor.simulated:
        raise MismatchError(
            f"expected array and sensor both real or both virtual, got {array.name} and {sensor.name}; they cannot meet"
        )
    wanted = round((drive.frames / drive.rate + tail) * sensor.rate)
    sensor.start()
    try:
        array.play(drive, progress=progress)
        block = sensor.read(wanted)
    finally:
        sensor.stop()
    if block.overflow or len(block.samples) < wanted:
        raise DeviceError(
            f"{sensor.name}: expected {wanted} frames, got {len(block.samples)}; frames were lost, play again"
        )
    provenance = Provenance(
        source=f"{array.name} heard by {sensor.name}",
        simulated=sensor.simulated or drive.provenance.simulated,
        notes=drive.provenance.notes,
        steps=drive.provenance.steps,
    ).then("play", {"array": array.name, "frames": drive.frames, "rate_hz": drive.rate})
    return Recording(
        samples=block.samples, rate=sensor.rate, sensor=sensor.grid, unit=sensor.unit, provenance=provenance
    )
