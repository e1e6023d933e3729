"""The tape recorder for programs: record, play and the whole loop, each in one call, on devices by their names."""

from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Self

from midair.devices import ArrayDevice, ExposureChoices, PlayReport, SensorDevice, SilencerChoice, check_exposure
from midair.errors import InputError
from midair.files import OpenedTake, load_calibration, open_take
from midair.model import (
    Acoustics,
    Calibration,
    Drive,
    Placement,
    PressureFrames,
    Progress,
    SensorGrid,
    SensorWiring,
    Solution,
    TransducerArray,
)
from midair.pipeline import calibrated_pressure, lead_of
from midair.rig.correction import Loop, Stage, quiet, run_loop
from midair.rig.names import VirtualRig, array_named, sensor_named
from midair.rig.playing import play_cleared, rerecord, usual_exposure
from midair.rig.takes import capture_recording
from midair.settings import MODES, Mode, Settings


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class OpenRig:
    """An array, the sensor that hears it, and what may be exposed to it. `open_rig` makes one.

    A context manager: entering opens both devices; leaving silences the array and closes both, on errors too.

    Attributes
    ----------
    array : ArrayDevice
        That plays.
    sensor : SensorDevice or None
        That hears it, with its calibration; None where nothing listens.
    exposure : ExposureChoices
        That every drive has to keep.
    measured : TransducerArray or None
        The array's transducers as they were measured, for which `loop` solves; None takes the model's.
    """

    array: ArrayDevice
    sensor: SensorDevice | None
    exposure: ExposureChoices
    measured: TransducerArray | None = None
    _open: ExitStack = field(default_factory=ExitStack, repr=False)

    def __enter__(self) -> Self:
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
    """How playing went, and what was heard of it.

    Attributes
    ----------
    drive : Drive
        What was played; weaker than what was asked if it had to be attenuated.
    outcome : {"kept", "attenuated", "overridden", "exceeded"}
        Of the exposure; "exceeded" only where no sound can come out.
    take : OpenedTake or None
        The re-recording and its sensor's calibration; None where nothing listened.
    report : PlayReport or None
        Of the array; None where a sensor listened.
    """

    drive: Drive
    outcome: str
    take: OpenedTake | None = None
    report: PlayReport | None = None

    def __repr__(self) -> str:
        heard = "nothing listened" if self.take is None else f"heard: {self.take.recording!r}"
        return f"<Played {self.drive.frames} frames at {self.drive.rate:g} Hz, exposure {self.outcome}, {heard}>"


def open_rig(
    array: str = "virtual",
    sensor: str | None = None,
    *,
    calibration: Calibration | str | Path | None = None,
    placement: Placement | None = None,
    silencer: SilencerChoice | None = None,
    exposure: ExposureChoices | None = None,
    height: float = 0.2,
    cells: SensorGrid | None = None,
    band: tuple[float, float] = (20.0, 470.0),
    acoustics: Acoustics | None = None,
    seed: int = 0,
) -> OpenRig:
    """An array and a sensor by their names, to be entered by ``with``.

    Parameters
    ----------
    array : str
        ``virtual``: an array and a sensor that exist only here, each a little different from what the solver assumes.
        Others as in ``midair play --device``: ``autd3``, ``autd3:emulator``, ``pyautd3`` and so on.
    sensor : str, optional
        That hears a real array: ``lsl:NAME``, ``audio:DEVICE``, ``serial:PORT``, ``ni:CHANNELS``.
    calibration : Calibration or path, optional
        Of that sensor.
    placement : Placement, optional
        Of the array's units; two by two if None.
    silencer : {"auto", "off", "quarter", "half", "default"}, optional
        How phase steps are spread, on the virtual array as on a real one; auto if None.
    exposure : ExposureChoices, optional
        That every drive has to keep; the usual profile, with nobody answering for more, if None.
    height : float
        Of a virtual sensor above the array, in m.
    cells : SensorGrid, optional
        Of a virtual sensor; the paper's 4 x 4 if None.
    band : tuple of float
        (low, high) that a virtual sensor has to hear, in Hz.
    acoustics : Acoustics, optional
        Of the virtual rig: the air in which it plays, whatever a drive was solved for; each drive's own air if None.
    seed : int
        Of the virtual rig's strengths and noise.

    Raises
    ------
    UnknownDeviceError, MissingExtraError, DeviceError
        If nothing answers to a name, or what it needs is not installed.
    InputError
        If a sensor, calibration or placement is given for the virtual array, which brings its own.
    """
    virtual = VirtualRig(seed=seed, height=height, cells=cells or SensorGrid(), acoustics=acoustics).hearing(band)
    choices = exposure or usual_exposure()
    if array == "virtual":
        if sensor or calibration or placement:
            raise InputError("virtual array: expected no sensor, calibration or placement; it brings its own")
        skin = virtual.skin()
        device = virtual.array_device(skin)
        device.silencer = silencer or "auto"
        return OpenRig(array=device, sensor=virtual.sensor(skin), exposure=choices)
    real = array_named(array, placement, silencer=silencer or "auto")
    if sensor is None:
        return OpenRig(array=real, sensor=None, exposure=choices)
    listens = sensor_named(sensor, virtual)
    if calibration is not None:
        known = calibration if isinstance(calibration, Calibration) else load_calibration(calibration)
        listens.calibration = known
    return OpenRig(array=real, sensor=listens, exposure=choices)


def record(
    sensor: str | SensorDevice = "virtual:towel",
    duration: float = 1.0,
    *,
    path: str | Path | None = None,
    notes: dict[str, str] | None = None,
    wiring: SensorWiring | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> OpenedTake:
    """Record a sensor for a while.

    Parameters
    ----------
    sensor : str or SensorDevice
        By name, as in ``midair record``: ``virtual:towel``, ``replay:take.h5``, ``lsl:NAME``, ``audio:DEVICE``,
        ``serial:PORT``, ``ni:CHANNELS``; or one that is open.
    duration : float
        In s; less if the sensor ends before.
    path : str or Path, optional
        Of a file that is written as the frames come, so that whatever was recorded survives a crash.
    notes : dict of str to str, optional
        What people want to remember: object, surface, speed, operator.
    wiring : SensorWiring, optional
        Which channel is which cell.
    seed : int
        Of a virtual sensor.
    progress : callable, optional
        Called with (frames done, frames in all).

    Returns
    -------
    OpenedTake
        ``.recording``, ``.calibration`` and ``.journal``.

    Raises
    ------
    UnknownDeviceError, MissingExtraError, DeviceError
        If nothing answers to the name, or the sensor gives nothing or loses frames.
    InputError
        If the duration holds no frame.
    """
    if isinstance(sensor, str):
        named = sensor_named(sensor, VirtualRig(seed=seed), wiring=wiring)
        with named as opened:
            return record(opened, duration, path=path, notes=notes, progress=progress)
    target = None if path is None else Path(path)
    recording = capture_recording(sensor, duration, path=target, notes=notes, progress=progress)
    return OpenedTake(recording=recording, calibration=sensor.calibration) if target is None else open_take(target)


def play(
    what: Solution | Drive,
    rig: OpenRig | str = "virtual",
    *,
    repeats: int = 1,
    exposure: ExposureChoices | None = None,
    source: str | Path = "python",
    progress: Progress | None = None,
) -> Played:
    """Play a drive, after its exposure was checked, and record what a sensor hears of it where one listens.

    Parameters
    ----------
    what : Solution or Drive
        Made for the rig's array.
    rig : OpenRig or str
        Entered; or the name of an array that is opened for this alone.
    repeats : int
        How often, one time after the other without a gap.
    exposure : ExposureChoices, optional
        What it has to keep, in place of the rig's own.
    source : str or Path
        What to call it in the log of what was played; a file is hashed there.
    progress : callable, optional
        Called with (frames played, frames in all).

    Raises
    ------
    ExposureError
        If it exceeds the profile and nobody answers for it.
    MismatchError
        If it was made for another array.
    DeviceStateError
        If the rig was not entered.
    """
    if isinstance(rig, str):
        with open_rig(rig, exposure=exposure) as opened:
            return play(what, opened, repeats=repeats, source=source, progress=progress)
    drive = what.drive if isinstance(what, Solution) else what
    admission = check_exposure(drive, rig.array, exposure or rig.exposure, repeats=repeats)
    played = admission.check_for(rig.array)
    if rig.sensor is None:
        report = play_cleared(admission, rig.array, source=source, progress=progress)
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
    stage: Stage = quiet,
) -> Loop:
    """Solve, play, re-record, correct, play again, compare (paper, 5.2); and again, until it no longer helps.

    Parameters
    ----------
    original : OpenedTake, PressureFrames or path
        A recording with its calibration; or its pressure, in the settings' band and at their rate.
    settings : Settings or {"paper", "best", "quick", "finest"}
        Of every stage, or a mode by name.
    rig : OpenRig or str
        Entered, with a sensor; or the name of an array that is opened for this alone.
    corrections : int
        Passes after the first that correct the amplitude; the paper's loop has one.
    iterate : int
        Largest number of passes after those that correct the waveform.
    lead : float, optional
        Silence around what is played, in which a bias can rise, in s; what the mapping needs if None.
    stage : callable
        Told the name of each stage as it begins; gives the progress to report to.

    Raises
    ------
    InputError
        If the rig has no sensor, or a sensor without a calibration where one is needed.
    ExposureError
        If a drive exceeds the profile and nobody answers for it.
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
        raise InputError(f"loop on {rig.array.name}: expected a rig with a sensor, which must hear the array; got none")
    return run_loop(
        original,
        rig.array,
        rig.sensor,
        chosen,
        corrections=corrections,
        iterate=iterate,
        exposure=rig.exposure,
        lead=lead_of(chosen) if lead is None else lead,
        measured=rig.measured,
        stage=stage,
    )
