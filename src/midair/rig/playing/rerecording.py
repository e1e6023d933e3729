"""From a drive to a played one, and to what a sensor felt of it."""

import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from midair.devices import ArrayDevice, PlayReport, SensorDevice, admit
from midair.errors import DeviceError, DeviceStateError, MismatchError
from midair.model import Drive, Progress, Provenance, Recording
from midair.physics import ExposureProfile
from midair.rig.playing.admitted import play_admitted


@dataclass(frozen=True, slots=True, kw_only=True)
class Gate:
    """How each drive of a loop gets onto a real array: checked against a profile, logged, and stopped on demand.

    Attributes
    ----------
    profile : ExposureProfile
        That every drive must keep.
    attenuate : bool
        Whether to weaken a drive that is too strong.
    override : str or None
        Who answers for playing it all the same.
    source : str
        What to call the drives in the log.
    """

    profile: ExposureProfile
    attenuate: bool = False
    override: str | None = None
    source: str = "loop"

    def play(self, drive: Drive, array: ArrayDevice, progress: Progress | None = None) -> tuple[Drive, PlayReport]:
        """Play what may be played of a drive on an open array; that, and how it went.

        Raises
        ------
        InputError
            If the drive breaks the profile and nobody answers for it.
        """
        admission = admit(drive, self.profile, gated=array.gated, attenuate=self.attenuate, override=self.override)
        return admission.drive, play_admitted(admission, array, source=self.source, progress=progress)


def rerecord(
    drive: Drive,
    array: ArrayDevice,
    sensor: SensorDevice,
    *,
    gate: Gate | None = None,
    tail: float = 0.02,
    progress: Progress | None = None,
) -> Recording:
    """Play a drive on an open array and record it with an open sensor from before its first frame on.

    A simulated sensor hears the first frame at time 0. On a real rig the array takes its time to begin, so everything
    that the sensor heard from the order to play on is kept: `evaluate.find_delay` tells where the drive begins.

    Parameters
    ----------
    drive : Drive
        What to play.
    array, sensor : ArrayDevice, SensorDevice
        Open. The sensor must keep what it samples until it is read.
    gate : Gate, optional
        Checks the drive's exposure and logs what is played. An array on which that is a duty is refused without.
    tail : float
        How much longer than the drive to record, in s, so that a delay cuts nothing off.
    progress : callable, optional
        Called with (frames played, frames in all).

    Raises
    ------
    MismatchError
        If only one of the two is simulated: they would not hear each other.
    DeviceStateError
        If the array needs a gate and there is none.
    DeviceError
        If the sensor loses frames.
    """
    if array.simulated != sensor.simulated:
        raise MismatchError(
            f"expected array and sensor both real or both virtual, got {array.name} and {sensor.name}; they cannot meet"
        )
    if array.gated and gate is None:
        raise DeviceStateError(f"{array.name}: expected an exposure gate before anything is played, got none")
    sensor.start()
    try:
        began = time.monotonic()
        played = drive
        if gate is None:
            array.play(drive, progress=progress)
        else:
            played, _ = gate.play(drive, array, progress)
        lasted = drive.frames / drive.rate if sensor.simulated else time.monotonic() - began
        samples = _read(sensor, round((lasted + tail) * sensor.rate))
    finally:
        sensor.stop()
    provenance = Provenance(
        source=f"{array.name} heard by {sensor.name}",
        simulated=sensor.simulated or played.provenance.simulated,
        notes=played.provenance.notes,
        steps=played.provenance.steps,
    ).then("play", {"array": array.name, "frames": drive.frames, "rate_hz": drive.rate})
    return Recording(samples=samples, rate=sensor.rate, sensor=sensor.grid, unit=sensor.unit, provenance=provenance)


def _read(sensor: SensorDevice, wanted: int) -> NDArray[np.float64]:
    """`wanted` frames without a gap, shape (frame, row, column)."""
    blocks: list[NDArray[np.float64]] = []
    have = 0
    while have < wanted:
        block = sensor.read(wanted - have)
        if block.overflow or block.first != have or not len(block.samples):
            break
        blocks.append(block.samples)
        have += len(block.samples)
    if have < wanted:
        raise DeviceError(f"{sensor.name}: expected {wanted} frames, got {have}; frames were lost, play again")
    return np.concatenate(blocks)
