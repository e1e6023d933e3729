"""Record a sensor in one call, for programs; `rig/takes/take.py` is the interactive form."""

from pathlib import Path

import numpy as np

from midair.devices import SensorDevice, fill_gaps
from midair.errors import DeviceError, InputError
from midair.files import RecordingWriter, open_take
from midair.model import Progress, Provenance, Recording


def capture_recording(
    sensor: SensorDevice,
    duration: float,
    *,
    path: Path | None = None,
    notes: dict[str, str] | None = None,
    block: float = 0.1,
    progress: Progress | None = None,
) -> Recording:
    """Record an open sensor for `duration` seconds, or until it ends; it is started and stopped here.

    Parameters
    ----------
    path : Path, optional
        File that is written during the recording, so that the frames survive a crash; the result is read from it.
    notes : dict of str to str, optional
        Notes such as object, surface, speed and operator.
    block : float
        Duration of one read in s.
    progress : callable, optional
        Called with (frames done, total frames).

    Raises
    ------
    InputError, DeviceError
        If the duration is shorter than one frame; if the sensor gives no frames, or loses frames.
    """
    frames = round(duration * sensor.rate)
    if frames < 1:
        raise InputError(f"duration: expected at least one frame of {1e3 / sensor.rate:g} ms, got {duration:g} s")
    provenance = Provenance(source=sensor.name, simulated=sensor.simulated, notes=notes or {})
    sensor.start()
    try:
        if path is None:
            kept: list[np.ndarray] = []
            _blocks(sensor, frames, block, kept, progress)
            samples = np.concatenate(kept)
        else:
            with RecordingWriter(
                path,
                rate=sensor.rate,
                sensor=sensor.grid,
                unit=sensor.unit,
                provenance=provenance,
                calibration=sensor.calibration,
                expected=frames,
                stored=sensor.stored,
            ) as writer:
                _blocks(sensor, frames, block, writer, progress)
            return open_take(path).recording
    finally:
        sensor.stop()
    return Recording(samples=samples, rate=sensor.rate, sensor=sensor.grid, unit=sensor.unit, provenance=provenance)


def _blocks(
    sensor: SensorDevice,
    frames: int,
    block: float,
    into: RecordingWriter | list[np.ndarray],
    progress: Progress | None,
) -> None:
    got = 0
    for samples in fill_gaps(sensor, frames, block=max(1, round(block * sensor.rate))):
        into.append(samples)
        got += len(samples)
        if progress:
            progress(got, frames)
    if not got:
        raise DeviceError(f"{sensor.name}: expected frames, got none; is it connected and switched on?")
