"""Open an array, and the sensor that records it, by their names."""

from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from typing import Any, Self

from midair.devices import ArrayDevice, ExposureChoices, ImmediateArray, SensorDevice
from midair.errors import DeviceStateError, InputError
from midair.model import ArrayCalibration, Drive, Placement, TransducerArray
from midair.physics import Transducers
from midair.rig.names.array_names import KeptCalibration, array_calibration_for, array_named
from midair.rig.names.sensor_names import VirtualRig, sensor_named
from midair.rig.playing.following import immediate_array
from midair.rig.playing.play_settings import PlaySettings
from midair.settings import Settings
from midair.targets import sensor_from_provenance
from midair.validation import checked_call


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
    measured: KeptCalibration | None = None
    """Calibration of the array for which `loop` solves; by default the stored one of a real array. The model's
    transducers if None."""
    _open: ExitStack = field(default_factory=ExitStack, repr=False)

    @property
    def exposure(self) -> ExposureChoices:
        """Exposure limits of every drive."""
        return self.settings.exposure

    @property
    def transducers(self) -> TransducerArray:
        """Transducers to solve for: those of the model, or as they were measured."""
        return self.array.array if self.measured is None else self.measured.known.applied(self.array.array)

    @property
    def by_frames(self) -> bool:
        """Whether the array plays single frames, each at its instant."""
        return isinstance(self.array, ImmediateArray)

    @property
    def frames(self) -> ImmediateArray:
        """The array, if it plays single frames; DeviceStateError if not."""
        if not isinstance(self.array, ImmediateArray):
            raise DeviceStateError(f"{self.array.name}: expected an array that plays single frames; see frame_rig")
        return self.array

    def listening(self) -> SensorDevice:
        """The sensor; InputError if there is none."""
        if self.sensor is None:
            raise InputError(f"{self.array.name}: expected a rig with a sensor, got none; name one in open_rig")
        return self.sensor

    def __enter__(self) -> Self:
        self.array.cooling, self.array.participant = self.settings.cooling, self.settings.participant
        with ExitStack() as opened:
            opened.enter_context(self.array)
            if self.sensor is not None:
                opened.enter_context(self.sensor)
            # Only now both are open; an error of the sensor has closed the array.
            self._open.push(opened.pop_all())
        return self

    def __exit__(self, *error: Any) -> None:
        self._open.__exit__(*error)

    def __repr__(self) -> str:
        heard = "nothing listens" if self.sensor is None else f"heard by {self.sensor.name}"
        known = "" if self.measured is None else f", array calibration {self.measured.described(Settings())}"
        return f"<OpenRig {self.array.name}, {self.array.array.count} transducers, {heard}{known}>"


@checked_call
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
        Fields of `PlaySettings` that differ from `settings`, such as ``silencer="off"``. Calibrations and placement may
        be the path of a file; ``array_calibration="none"`` leaves out the stored calibration of a real array.

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
    if chosen.palm_path is not None:
        raise InputError(f"palm path: expected the virtual array, got {chosen.device}, above which a real palm moves")
    real = array_named(chosen.device, chosen.placement, silencer=chosen.silencer)
    listens = None if chosen.sensor is None else sensor_named(chosen.sensor, _virtual_rig(chosen, drive))
    if listens is not None and chosen.calibration is not None:
        listens.calibration = chosen.calibration
    measured = array_calibration_for(chosen.device, chosen.array_calibration)
    return OpenRig(array=real, sensor=listens, settings=chosen, measured=measured)


def bench_devices(
    sensor: str, device: str, virtual: VirtualRig, placement: Placement | None = None
) -> tuple[SensorDevice, ArrayDevice]:
    """Make the sensor and the array of a measurement from their names, each of them virtual or not, silencer off."""
    skin = virtual.skin()
    listens = virtual.sensor(skin) if sensor == "virtual" else sensor_named(sensor, virtual)
    return listens, virtual.array_device(skin) if device == "virtual" else array_named(device, placement)


def frame_rig(settings: PlaySettings, rate: float, *, hold: float | None = None) -> OpenRig:
    """Make a rig of an array that plays single frames at a rate in Hz, without a sensor: to follow a palm, or live.

    `hold` as in `ImmediateArray`. Raises UnknownDeviceError if the array takes no single frames.
    """
    array = immediate_array(settings, rate, hold=hold)
    measured = array_calibration_for(settings.device, settings.array_calibration)
    return OpenRig(array=array, sensor=None, settings=settings, measured=measured)


def _virtual_rig(chosen: PlaySettings, drive: Drive | None) -> VirtualRig:
    """The virtual rig of the settings, with array, cells, height and band of the drive if there is one."""
    cells, height, band = chosen.cells, chosen.height, chosen.band
    if drive is not None:
        known = Settings.of(drive.provenance) or Settings()
        cells, height, band = sensor_from_provenance(drive.provenance), known.target.grid.height, known.calibration.band
    rig = VirtualRig(
        array=TransducerArray.autd3() if drive is None else drive.array.nominal,
        cells=cells,
        height=height,
        acoustics=chosen.acoustics,
        seed=chosen.seed,
        spread=chosen.spread,
        palm=chosen.palm_path,
    ).hearing(band)
    if not isinstance(measured := chosen.array_calibration, ArrayCalibration):
        return rig
    measured.applied(rig.array)  # raises if it was measured on another array
    return replace(rig, transducers=Transducers.measured(measured))
