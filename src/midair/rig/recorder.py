"""Record, play and loop from Python, each in one call, with devices given by name."""

from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Self

from midair.devices import ArrayDevice, ExposureChoices, PlayReport, SensorDevice, SilencerChoice, check_exposure
from midair.errors import InputError
from midair.files import OpenedTake, load_calibration, open_take
from midair.model import (
    BAND,
    HEIGHT,
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
from midair.pipeline import calibrated_pressure, required_lead
from midair.rig.correction import Loop, Stage, no_progress, run_loop
from midair.rig.names import VirtualRig, array_named, sensor_named
from midair.rig.playing import default_exposure, play_cleared, rerecord
from midair.rig.takes import capture_recording
from midair.settings import MODES, Mode, Settings


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class OpenRig:
    """An array, the sensor that records it, and the exposure limits; made by `open_rig`.

    A context manager: entering opens both devices; leaving silences the array and closes both, also after an error.
    """

    array: ArrayDevice
    sensor: SensorDevice | None
    """Sensor that records the array, with its calibration; None for an array alone."""
    exposure: ExposureChoices
    """Exposure limits of every drive."""
    measured: TransducerArray | None = None
    """Measured transducers of the array, for which `loop` solves; the model's if None."""
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
    array: str = "virtual",
    sensor: str | None = None,
    *,
    calibration: Calibration | str | Path | None = None,
    placement: Placement | None = None,
    silencer: SilencerChoice | None = None,
    exposure: ExposureChoices | None = None,
    height: float = HEIGHT,
    cells: SensorGrid | None = None,
    band: tuple[float, float] = BAND,
    acoustics: Acoustics | None = None,
    seed: int = 0,
) -> OpenRig:
    """Make a rig from the names of an array and a sensor; enter it with ``with``.

    Parameters
    ----------
    array : str
        ``virtual``: a simulated array and sensor, both slightly different from the solver's model. Others as in
        ``midair play --device``: ``autd3``, ``autd3:emulator``, ``pyautd3`` and so on.
    sensor : str, optional
        Sensor that records a real array: ``lsl:NAME``, ``audio:DEVICE``, ``serial:PORT``, ``ni:CHANNELS``.
    calibration : Calibration or path, optional
        Calibration of that sensor.
    placement : Placement, optional
        Placement of the array's units; two by two if None.
    silencer : {"auto", "off", "quarter", "half", "default"}, optional
        How phase steps are spread, also on the virtual array; auto if None.
    exposure : ExposureChoices, optional
        Exposure limits of every drive; the default profile without override if None.
    height : float
        Height of a virtual sensor above the array in m.
    cells : SensorGrid, optional
        Cells of a virtual sensor; the paper's 4 x 4 if None.
    band : tuple of float
        (low, high) in Hz that a virtual sensor must record.
    acoustics : Acoustics, optional
        Air and directivity of the virtual rig; the air of each drive if None.
    seed : int
        Seed of the virtual rig's transducer strengths and noise.

    Raises
    ------
    UnknownDeviceError, MissingExtraError, DeviceError
        If a device is unknown or not found, or its package is not installed.
    InputError
        If a sensor, calibration or placement is given for the virtual array, which has its own.
    """
    virtual = VirtualRig(seed=seed, height=height, cells=cells or SensorGrid(), acoustics=acoustics).hearing(band)
    choices = exposure or default_exposure()
    if array == "virtual":
        if sensor or calibration or placement:
            raise InputError("virtual array: expected no sensor, calibration or placement, since it has its own")
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
    """Record a sensor for `duration` seconds, or until the sensor ends.

    Parameters
    ----------
    sensor : str or SensorDevice
        A name as in ``midair record``: ``virtual:towel``, ``replay:take.h5``, ``lsl:NAME``, ``audio:DEVICE``,
        ``serial:PORT``, ``ni:CHANNELS``; or an open device.
    path : str or Path, optional
        File that is written during the recording, so that the frames survive a crash.
    notes : dict of str to str, optional
        Notes such as object, surface, speed and operator.
    wiring : SensorWiring, optional
        Assignment of channels to cells.
    seed : int
        Seed of a virtual sensor.
    progress : callable, optional
        Called with (frames done, total frames).

    Returns
    -------
    OpenedTake
        ``.recording``, ``.calibration`` and ``.journal``.

    Raises
    ------
    UnknownDeviceError, MissingExtraError, DeviceError
        If the device is unknown or not found, or the sensor gives no frames or loses frames.
    InputError
        If the duration is shorter than one frame.
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
    """Play a drive after an exposure check, and re-record it if the rig has a sensor.

    Parameters
    ----------
    what : Solution or Drive
        Solved for the rig's array.
    rig : OpenRig or str
        An entered rig, or the name of an array that is opened for this call.
    repeats : int
        Number of repetitions, without a gap.
    exposure : ExposureChoices, optional
        Exposure limits, if not the rig's.
    source : str or Path
        Name of the drive in the play log; a file is hashed there.
    progress : callable, optional
        Called with (frames played, total frames).

    Raises
    ------
    ExposureError
        If the drive exceeds the profile without an override.
    MismatchError
        If the drive was solved for another array.
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
