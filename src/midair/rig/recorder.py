"""Record from Python in one call, with a sensor given by name."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from midair.devices import SensorDevice, WrappedSensor
from midair.errors import DeviceError, InputError
from midair.files import OpenedTake, check_memory_for, open_take
from midair.model import Event, Progress, SensorWiring
from midair.rig.names.sensor_names import VirtualRig, sensor_named
from midair.rig.takes.take import record_take
from midair.rig.takes.take_state import Drift, RecordSettings, TakeObserver, View
from midair.validation import check_type, checked_call


@dataclass(frozen=True, slots=True, eq=False)
class _ProgramObserver(TakeObserver):
    """Reports the progress of a recording to a program; lost frames are an error there."""

    sensor: SensorDevice
    progress: Progress | None

    def show(self, view: View) -> None:
        """Report the progress."""
        if self.progress is not None:
            self.progress(view.frames, view.wanted or view.frames)

    def tell(self, event: Event, _: Drift | None = None, /) -> None:
        """Raise DeviceError for lost frames."""
        if event.kind == "lost":
            seconds = event.frame / self.sensor.rate
            raise DeviceError(
                f"{self.sensor.name}: lost frames before {seconds:.3f} s; close other programs and try again"
            )


@checked_call
def record(
    sensor: str | SensorDevice | None = None,
    duration: float | None = None,
    *,
    path: str | Path | None = None,
    notes: dict[str, str] | None = None,
    wiring: SensorWiring | None = None,
    progress: Progress | None = None,
    settings: RecordSettings | None = None,
    **changes: Any,
) -> OpenedTake:
    """Record a sensor for some time, or until it ends.

    Parameters
    ----------
    sensor : str or SensorDevice, optional
        A name as in ``midair record``: ``virtual:towel``, the default, ``replay:take.h5``, ``lsl:NAME``,
        ``audio:DEVICE``, ``serial:PORT``, ``ni:CHANNELS``; or an open device.
    duration : float, optional
        Time in s; that of `settings` if None, and 1 s without settings.
    path : str or Path, optional
        File that is written during the recording, so that the frames survive a crash.
    notes : dict of str to str, optional
        Notes such as object, surface, speed and operator.
    progress : callable, optional
        Called with (frames done, total frames).
    settings : RecordSettings, optional
        All settings; the defaults if None.
    wiring, **changes
        Fields of `RecordSettings` that differ from `settings`, such as ``seed=1`` or ``level=0.05``, with which the
        recording begins at a touch. Wiring may be the path of a sensor file.

    Returns
    -------
    OpenedTake
        ``.recording``, ``.calibration`` and ``.journal``.

    Raises
    ------
    UnknownDeviceError, MissingExtraError, DeviceError
        If the device is unknown or not found, or the sensor gives no frames or loses frames.
    InputError
        If a value is out of range, or the duration is shorter than one frame.
    FileError
        If the file cannot be written.
    """
    if sensor is not None:
        check_type(sensor, "sensor", str, SensorDevice)
    target = None if path is None else Path(path)
    if target is not None and target.suffix.lower() not in (".h5", ".hdf5"):
        raise InputError(f"path: expected a name that ends in .h5, got {target.name}; midair.save writes other formats")
    named = {"duration": duration, "wiring": wiring, "sensor": sensor if isinstance(sensor, str) else None} | changes
    given = {name: value for name, value in named.items() if value is not None}
    chosen = (settings or RecordSettings(duration=1.0)).but(**given)
    if chosen.repeats > 1:
        raise InputError(f"repeats: expected 1 in one call, got {chosen.repeats}; call record once for each take")
    if not isinstance(sensor, SensorDevice):
        device = sensor_named(chosen.sensor, VirtualRig(seed=chosen.seed), wiring=chosen.wiring)
        with WrappedSensor(device, paced=True) if chosen.real_time and device.on_demand else device as opened:
            return record(opened, path=path, notes=notes, progress=progress, settings=chosen)
    if target is None and chosen.duration and np.isfinite(chosen.duration):
        needed = 16 * sensor.rate * chosen.duration * sensor.grid.count
        check_memory_for(needed, f"duration: {chosen.duration:g} s", "record for a shorter time, or give a path")
    take = record_take(sensor, chosen, _ProgramObserver(sensor, progress), path=target, notes=notes)
    if take.error is not None:
        raise take.error
    if take.memory is not None:
        return take.memory
    if take.path is None:
        raise DeviceError(f"{sensor.name}: expected a touch, got none; the sensor ended before")
    return open_take(take.path)
