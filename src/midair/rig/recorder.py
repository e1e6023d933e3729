"""Record, play and loop from Python, each in one call, with devices given by name."""

from contextlib import ExitStack
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from midair.devices import ArrayDevice, ExposureChoices, PacedSensor, PlayReport, SensorDevice, check_exposure
from midair.errors import DeviceError, InputError
from midair.files import OpenedTake, open_take
from midair.model import (
    Drive,
    Event,
    PressureFrames,
    Progress,
    SensorWiring,
    Solution,
    TransducerArray,
)
from midair.physics import Transducers
from midair.pipeline import calibrated_pressure, required_lead
from midair.rig.correction import Loop, Stage, no_progress, run_loop
from midair.rig.names import VirtualRig, array_named, sensor_named
from midair.rig.playing import PlaySettings, play_cleared, rerecord
from midair.rig.takes import Drift, RecordSettings, TakeOrder, View, record_take
from midair.settings import MODES, Mode, Settings
from midair.targets import sensor_from_provenance


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class OpenRig:
    """An array, the sensor that records it, and their settings; made by `open_rig`.

    A context manager: entering opens both devices; leaving silences the array and closes both, also after an error.
    """

    array: ArrayDevice
    sensor: SensorDevice | None
    """Sensor that records the array, with its calibration; None for an array alone."""
    settings: PlaySettings = field(default_factory=PlaySettings)
    """Settings with which it was made, and of each playback unless `play` changes them."""
    measured: TransducerArray | None = None
    """Measured transducers of the array, for which `loop` solves; the model's if None."""
    _open: ExitStack = field(default_factory=ExitStack, repr=False)

    @property
    def exposure(self) -> ExposureChoices:
        """Exposure limits of every drive."""
        return self.settings.exposure

    def __enter__(self) -> Self:
        self.array.cooling, self.array.participant = self.settings.cooling, self.settings.participant
        self._open.enter_context(self.array)
        if self.sensor is not None:
            self._open.enter_context(self.sensor)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._open.__exit__(kind, error, trace)

    def __repr__(self) -> str:
        heard = "nothing listens" if self.sensor is None else f"heard by {self.sensor.name}"
        return f"<OpenRig {self.array.name}, {self.array.array.count} transducers, {heard}>"


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

    def __repr__(self) -> str:
        heard = "nothing listened" if self.take is None else f"heard: {self.take.recording!r}"
        return f"<Played {self.drive.frames} frames at {self.drive.rate:g} Hz, exposure {self.outcome}, {heard}>"


def open_rig(
    array: str | None = None,
    sensor: str | None = None,
    *,
    drive: Drive | None = None,
    settings: PlaySettings | None = None,
    **changes: Any,
) -> OpenRig:
    """Make a rig from the names of an array and a sensor; enter it with ``with``.

    Parameters
    ----------
    array, sensor : str, optional
        ``virtual``, the default: a simulated array and sensor, both slightly different from the solver's model. Others
        as in ``midair play --device`` and, for the sensor that records a real array, ``midair record``.
    drive : Drive, optional
        A drive to play: the virtual rig gets its array, cells, height and band.
    settings : PlaySettings, optional
        All settings; the defaults if None.
    **changes
        Fields of `PlaySettings` that differ from `settings`, such as ``silencer="off"``. Calibration and placement may
        be the path of a file.

    Raises
    ------
    UnknownDeviceError, MissingExtraError, DeviceError
        If a device is unknown or not found, or its package is not installed.
    InputError
        If a value is out of range, or a sensor, calibration or placement is given for the virtual array, which has its
        own.
    """
    named = {name: value for name, value in (("device", array), ("sensor", sensor)) if value is not None}
    chosen = (settings or PlaySettings()).but(**named, **changes)
    if chosen.device == "virtual":
        if chosen.sensor or chosen.calibration or chosen.placement:
            raise InputError("virtual array: expected no sensor, calibration or placement, since it has its own")
        virtual = _virtual_rig(chosen, drive)
        skin = virtual.skin()
        device = virtual.array_device(skin)
        device.silencer = chosen.silencer
        return OpenRig(array=device, sensor=virtual.sensor(skin), settings=chosen)
    if chosen.array_calibration is not None:
        raise InputError(
            f"array calibration: expected the virtual array, got {chosen.device}; for a real array solve with it"
        )
    real = array_named(chosen.device, chosen.placement, silencer=chosen.silencer)
    listens = None if chosen.sensor is None else sensor_named(chosen.sensor, _virtual_rig(chosen, drive))
    if listens is not None and chosen.calibration is not None:
        listens.calibration = chosen.calibration
    return OpenRig(array=real, sensor=listens, settings=chosen)


def _virtual_rig(chosen: PlaySettings, drive: Drive | None) -> VirtualRig:
    """The virtual rig of the settings, with array, cells, height and band of the drive if there is one."""
    rig = VirtualRig(seed=chosen.seed, height=chosen.height, cells=chosen.cells, acoustics=chosen.acoustics)
    band = chosen.band
    if drive is not None:
        known = Settings.of(drive.provenance) or Settings()
        cells, band = sensor_from_provenance(drive.provenance), known.calibration.band
        rig = replace(rig, array=drive.array.nominal, cells=cells, height=known.target.grid.height)
    rig = rig.hearing(band)
    if (measured := chosen.array_calibration) is None:
        return rig
    measured.applied(rig.array)  # raises if it was measured on another array
    return replace(rig, transducers=Transducers.measured(measured))


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

    def tell(self, event: Event, _: Drift | None = None) -> None:
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
    if take.path is None and take.memory is None:
        raise DeviceError(f"{sensor.name}: expected a touch, got none; the sensor ended before")
    return take.memory or open_take(take.path)


def play(
    what: Solution | Drive,
    rig: OpenRig | str = "virtual",
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
    rig : OpenRig or str
        An entered rig, or the name of an array that is opened for this call; a virtual one gets the cells, the height
        and the band of the drive.
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
    changes = {name: value for name, value in changes.items() if value is not None}
    if isinstance(rig, str):
        with open_rig(rig, drive=drive, settings=settings, **changes) as opened:
            return play(drive, opened, source=source, progress=progress)
    of_devices = [one.name for one in fields(PlaySettings) if one.name in changes and "playback" not in one.metadata]
    if of_devices:
        raise InputError(f"play on an open rig: expected settings of a playback, got {of_devices[0]}; see open_rig")
    chosen = (settings or rig.settings).but(**changes)
    rig.array.cooling, rig.array.participant = chosen.cooling, chosen.participant
    admission = check_exposure(drive, rig.array, chosen.exposure, repeats=chosen.repeats)
    played = admission.check_for(rig.array)
    if rig.sensor is None:
        report = play_cleared(
            admission,
            rig.array,
            source=source,
            delay=chosen.delay,
            progress=progress,
            room=chosen.exposure.room,
        )
        return Played(drive=played, outcome=admission.outcome, report=report)
    heard = rerecord(admission, rig.array, rig.sensor, source=source, progress=progress)
    take = OpenedTake(recording=heard, calibration=rig.sensor.calibration)
    return Played(drive=played, outcome=admission.outcome, take=take)


def loop(
    original: OpenedTake | PressureFrames | str | Path,
    settings: Settings | Mode = "paper",
    rig: OpenRig | str = "virtual",
    *,
    corrections: int = 1,
    iterate: int = 0,
    lead: float | None = None,
    stage: Stage = no_progress,
) -> Loop:
    """Run the paper's loop (5.2): solve, play, re-record, correct, play again, compare; optionally iterate.

    Parameters
    ----------
    original : OpenedTake, PressureFrames or path
        A recording with its calibration; or its pressure, in the settings' band and at their rate.
    settings : Settings or {"paper", "best", "quick", "finest"}
        Settings of every stage, or the name of a mode.
    rig : OpenRig or str
        An entered rig with a sensor, or the name of an array that is opened for this call.
    corrections : int
        Passes after the first that correct the amplitude; the paper has one.
    iterate : int
        Maximum number of passes after those that correct the waveform.
    lead : float, optional
        Silence in s around the original, in which a bias can rise; the mapping's own value if None.
    stage : callable
        Called with the name of each stage at its start; returns its progress callback.

    Raises
    ------
    InputError
        If the rig has no sensor, or the sensor has no calibration.
    ExposureError
        If a drive exceeds the profile without an override.
    """
    chosen = MODES[settings]() if isinstance(settings, str) else settings
    if isinstance(original, str | Path):
        original = open_take(original)
    if isinstance(original, OpenedTake):
        original = calibrated_pressure(original.recording, original.calibration, chosen)
    if isinstance(rig, str):
        height, band = chosen.target.grid.height, chosen.calibration.band
        with open_rig(rig, height=height, cells=original.sensor, band=band) as opened:
            return loop(original, chosen, opened, corrections=corrections, iterate=iterate, lead=lead, stage=stage)
    if rig.sensor is None:
        raise InputError(f"loop on {rig.array.name}: expected a rig with a sensor, got none; name one in open_rig")
    return run_loop(
        original,
        rig.array,
        rig.sensor,
        chosen,
        corrections=corrections,
        iterate=iterate,
        exposure=rig.exposure,
        lead=required_lead(chosen) if lead is None else lead,
        measured=rig.measured,
        stage=stage,
    )
