"""Record and play from Python, each in one call, with devices given by name."""

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from midair.array_types import Array
from midair.devices import ExposureClearance, PacedSensor, PlayReport, SensorDevice, check_exposure
from midair.errors import DeviceError, InputError
from midair.files import OpenedTake, open_take
from midair.model import Drive, Event, PressureFrames, Progress, SensorWiring, Solution, TransducerArray
from midair.physics import Exposure
from midair.rig.names import VirtualRig, open_tracker, sensor_named
from midair.rig.opening import OpenRig, open_rig
from midair.rig.playing import (
    PlaySettings,
    SolvedAhead,
    clear_followed,
    follow_as_set,
    grid_of,
    immediate_array,
    play_cleared,
    play_followed,
    rerecord,
    tracker_name,
)
from midair.rig.signals import signals_end_the_program
from midair.rig.takes import Drift, RecordSettings, TakeOrder, View, record_take
from midair.settings import Settings
from midair.validation import check_type


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Played:
    """Result of `play`."""

    drive: Drive
    """The drive that was played; attenuated if the exposure limits required it."""
    outcome: str
    """Result of the exposure check: "kept", "attenuated", "overridden", or "exceeded" (only on arrays that emit no
    sound)."""
    take: OpenedTake | None = None
    """Re-recording with the sensor's calibration; None without a sensor."""
    report: PlayReport | None = None
    """Report of the array; None with a sensor."""
    error: Array | None = None
    """E of each frame that was solved while it played, shape (frame,); None for a drive."""
    exposure: Exposure | None = None
    """Exposure of a drive that was solved while it played."""
    followed: tuple[str, ...] = ()
    """When the palm was followed, and when the sound faded, one line each."""

    def __repr__(self) -> str:
        heard = "nothing listened" if self.take is None else f"heard: {self.take.recording!r}"
        return f"<Played {self.drive.frames} frames at {self.drive.rate:g} Hz, exposure {self.outcome}, {heard}>"


@dataclass(frozen=True, slots=True, eq=False)
class _ProgramWatcher:
    """Reports the progress of a recording to a program; lost frames are an error there."""

    sensor: SensorDevice
    progress: Progress | None

    def order(self) -> TakeOrder | None:
        """Give no commands."""

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
    named = {"duration": duration, "wiring": wiring, "sensor": sensor if isinstance(sensor, str) else None} | changes
    given = {name: value for name, value in named.items() if value is not None}
    chosen = (settings or RecordSettings(duration=1.0)).but(**given)
    if chosen.repeats > 1:
        raise InputError(f"repeats: expected 1 in one call, got {chosen.repeats}; call record once for each take")
    if not isinstance(sensor, SensorDevice):
        device = sensor_named(chosen.sensor, VirtualRig(seed=chosen.seed), wiring=chosen.wiring)
        with PacedSensor(device) if chosen.real_time and device.on_demand else device as opened:
            return record(opened, path=path, notes=notes, progress=progress, settings=chosen)
    target = None if path is None else Path(path)
    take = record_take(sensor, chosen, _ProgramWatcher(sensor, progress), path=target, notes=notes)
    if take.error is not None:
        raise take.error
    if take.memory is not None:
        return take.memory
    if take.path is None:
        raise DeviceError(f"{sensor.name}: expected a touch, got none; the sensor ended before")
    return open_take(take.path)


def play(
    what: Solution | Drive,
    rig: OpenRig | str | None = None,
    *,
    source: str | Path = "python",
    progress: Progress | None = None,
    settings: PlaySettings | None = None,
    **changes: Any,
) -> Played:
    """Play a drive after an exposure check, and re-record it if the rig has a sensor.

    Parameters
    ----------
    what : Solution or Drive
        Solved for the rig's array.
    rig : OpenRig or str, optional
        An entered rig, or the name of an array that is opened for this call, by default the device of `settings`; a
        virtual one gets the cells, the height and the band of the drive.
    source : str or Path
        Name of the drive in the play log; a file is hashed there.
    progress : callable, optional
        Called with (frames played, total frames).
    settings : PlaySettings, optional
        All settings; those of the rig if None.
    **changes
        Fields of `PlaySettings` that differ from them: ``repeats``, ``delay``, ``participant``, ``exposure`` and
        ``cooling``, and for a rig that is opened here also the others.

    Raises
    ------
    ExposureError
        If the drive exceeds the profile without an override.
    MismatchError
        If the drive was solved for another array.
    InputError
        If a value is out of range, or concerns the devices of an entered rig.
    DeviceStateError
        If the rig was not entered.
    """
    drive = what.drive if isinstance(what, Solution) else what
    check_type(drive, "drive", Drive)
    changes = {name: value for name, value in changes.items() if value is not None}
    if not isinstance(rig, OpenRig):
        wanted = (settings or PlaySettings()).but(**changes | ({} if rig is None else {"device": rig}))
        if wanted.follow is not None and wanted.device != "virtual":
            return _play_following(drive, wanted, source=source, progress=progress)
        with open_rig(rig, drive=drive, settings=settings, **changes) as opened:
            return play(drive, opened, source=source, progress=progress)
    of_devices = [one.name for one in fields(PlaySettings) if one.name in changes and "playback" not in one.metadata]
    if of_devices:
        raise InputError(f"play on an open rig: expected settings of a playback, got {of_devices[0]}; see open_rig")
    chosen = (settings or rig.settings).but(**changes)
    followed = list[str]()
    if rig.array.simulated and not rig.array.gated:
        drive, chosen = follow_as_set(drive, chosen, followed.append)
    elif chosen.follow is not None:
        raise InputError("follow: expected the virtual rig or the name of an array, got an open rig with a real array")
    rig.array.cooling, rig.array.participant = chosen.cooling, chosen.participant
    admission = check_exposure(drive, rig.array, chosen.exposure, repeats=chosen.repeats)
    return replace(_play(admission, rig, chosen, source=source, progress=progress), followed=tuple(followed))


def _play(admission: ExposureClearance, rig: OpenRig, chosen: PlaySettings, **how: Any) -> Played:
    """Play a cleared drive on an entered rig, and re-record it if that has a sensor."""
    played = admission.check_for(rig.array)
    how |= {"delay": chosen.delay, "room": chosen.exposure.room}
    if rig.sensor is None:
        report = play_cleared(admission, rig.array, **how)
        return Played(drive=played, outcome=admission.outcome, report=report)
    if chosen.delay and rig.sensor.simulated:
        raise InputError(f"delay: expected 0 on the virtual array, which plays at once, got {chosen.delay:g} s")
    heard = rerecord(admission, rig.array, rig.sensor, **how)
    take = OpenedTake(recording=heard, calibration=rig.sensor.calibration)
    return Played(drive=played, outcome=admission.outcome, take=take)


def play_pressure(
    pressure: PressureFrames,
    settings: Settings,
    rig: OpenRig,
    *,
    path: str | Path | None = None,
    source: str | Path = "python",
    report: Callable[[str], object] = print,
    progress: Progress | None = None,
) -> Played:
    """Solve a pressure and play it at the same time: the first sound comes as soon as no gap will follow.

    Every part is checked before it sounds; an error, also an exposure above the profile in a later part, silences the
    array. The drive is that of `midair.pipeline.reproduce_stream`, to the last bit.

    `pressure` is a calibrated recording with its lead (`add_lead`); `rig`, from `open_rig`, is not entered; `path` is a
    drive to write, complete or not at all; `report` is called with one line if this computer is too slow to begin at
    once. `source`, `progress` and the errors are those of `play`; InputError as in `SolvedAhead`.
    """
    # Without a placement the numbers are those of `midair solve`, to the last digit.
    transducers = one if (one := TransducerArray.autd3()).same_as(rig.array.array) else rig.array.array
    if rig.measured is not None:
        transducers, settings, pressure = rig.measured.applied(transducers, settings, pressure)
    solving = SolvedAhead(pressure, transducers, rig.array, settings, rig.settings, path)
    with signals_end_the_program(), solving, rig:
        played = _play(solving.in_time(report), rig, rig.settings, source=source, progress=progress)
        whole = solving.finish()
        return replace(played, outcome=whole.outcome, exposure=whole.exposure, error=np.concatenate(solving.error))


def _play_following(drive: Drive, settings: PlaySettings, *, source: str | Path, progress: Progress | None) -> Played:
    """Play a drive on a real array or an emulator while it follows a palm."""
    array, grid, followed = immediate_array(settings, drive.rate), grid_of(drive), list[str]()
    array.cooling, array.participant = settings.cooling, settings.participant
    with array, open_tracker(tracker_name(settings.follow, settings.tracker_latency)) as tracker:
        cleared = clear_followed(drive, array, settings, grid)
        done = play_followed(
            drive, array, tracker, settings, cleared, grid, source=source, report=followed.append, progress=progress
        )
    return Played(drive=drive, outcome=cleared.outcome, report=done.report, followed=tuple(followed))
