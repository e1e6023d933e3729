"""What comes out of a file, what was noticed on the way, and what the reader was told beforehand."""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from midair.errors import MismatchError, RateError, ShapeError, UnitError
from midair.model import Provenance, Recording, SensorGrid, Setting, Unit


@dataclass(frozen=True, slots=True, kw_only=True)
class Imported:
    """A recording that was read from a file.

    Attributes
    ----------
    recording : Recording
        What the file holds.
    report : tuple of str
        One sentence for each thing that was assumed, changed, left out or looks wrong; empty when there is nothing.
    """

    recording: Recording
    report: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Given:
    """What a person says about a file that does not say it itself; None where they say nothing.

    Attributes
    ----------
    rate : float or None
        Frames per second, in Hz.
    unit : {"V", "count", "Pa"} or None
        Of the samples.
    sensor : SensorGrid or None
        How the channels are laid out.
    """

    rate: float | None = None
    unit: Unit | None = None
    sensor: SensorGrid | None = None

    def check(self, recording: Recording, path: Path) -> None:
        """Raise if anything given contradicts a file that says everything itself.

        Raises
        ------
        MismatchError
            If it does.
        """
        pairs = (
            ("rate", self.rate, recording.rate),
            ("unit", self.unit, recording.unit),
            ("sensor", self.sensor, recording.sensor),
        )
        for name, given, stated in pairs:
            if given is not None and given != stated:
                raise MismatchError(f"{path}: the file says {name} {stated}, got {name} {given}; leave {name} out")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Foreign:
    """What a file of another program says.

    Attributes
    ----------
    samples : ndarray, shape (frame, channel) or (frame, row, column)
        As in the file.
    form : str
        What to call the format in messages and in the provenance.
    rate, unit, sensor
        None where the file does not say.
    notes : mapping of str to str
        What the file or its name says about the experiment.
    settings : mapping
        What was done while reading, for the provenance.
    report : tuple of str
        What was noticed so far.
    """

    samples: NDArray[np.float64]
    form: str
    rate: float | None = None
    unit: Unit | None = None
    sensor: SensorGrid | None = None
    notes: Mapping[str, str] = field(default_factory=dict[str, str])
    settings: Mapping[str, Setting] = field(default_factory=dict[str, Setting])
    report: tuple[str, ...] = ()

    def settle(self, given: Given, path: Path) -> Imported:
        """The recording, once every gap of the file is filled by what was given or by a stated assumption.

        Raises
        ------
        RateError, UnitError, ShapeError
            If the file does not say something, nobody gave it, and there is no sound assumption.
        MismatchError
            If what was given contradicts the file.
        """
        rate = self._rate(given, path)
        unit = self._unit(given, path)
        sensor, assumed = self._sensor(given, path)
        report = (*self.report, assumed) if assumed else self.report
        settings = {"format": self.form, "sha256": hashlib.sha256(path.read_bytes()).hexdigest(), **self.settings}
        provenance = Provenance(source=path.name, notes=self.notes).then("import", {**settings, "report": report})
        samples = self.samples.reshape(len(self.samples), *sensor.shape)
        recording = Recording(samples=samples, rate=rate, sensor=sensor, unit=unit, provenance=provenance)
        return Imported(recording=recording, report=report)

    def _rate(self, given: Given, path: Path) -> float:
        rate = given.rate if self.rate is None else self.rate
        if rate is None:
            raise RateError(f"{path}: the file does not say its frame rate; give it, such as rate=1000 (Hz)")
        if given.rate not in (None, rate):
            raise MismatchError(f"{path}: the file says {rate:g} Hz, got rate={given.rate:g}; leave rate out")
        return rate

    def _unit(self, given: Given, path: Path) -> Unit:
        unit = self.unit or given.unit
        if unit is None:
            raise UnitError(f'{path}: the file does not say the unit of its samples; give unit="V", "count" or "Pa"')
        if given.unit not in (None, unit):
            raise MismatchError(f"{path}: the file says {unit}, got unit={given.unit!r}; leave unit out")
        return unit

    def _sensor(self, given: Given, path: Path) -> tuple[SensorGrid, str]:
        channels = int(np.prod(self.samples.shape[1:]))
        if given.sensor is not None:
            rows_differ = self.samples.ndim == 3 and self.samples.shape[1:] != given.sensor.shape
            if given.sensor.count != channels or rows_differ:
                have = " x ".join(map(str, self.samples.shape[1:]))
                want = f"{given.sensor.rows} x {given.sensor.columns}"
                raise MismatchError(f"{path}: the file has {have} channels, got a sensor of {want}; give one that fits")
            return given.sensor, ""
        if self.sensor is not None:
            return self.sensor, ""
        return self._assumed_sensor(channels, path)

    def _assumed_sensor(self, channels: int, path: Path) -> tuple[SensorGrid, str]:
        pitch = SensorGrid().pitch
        if self.samples.ndim == 3:
            sensor = SensorGrid(rows=self.samples.shape[1], columns=self.samples.shape[2])
            return sensor, f"The file does not say the pitch of the sensor: {pitch * 1e3:g} mm was assumed."
        if channels == 1:
            return SensorGrid(rows=1, columns=1), ""
        if channels == SensorGrid().count:
            lie = f"4 x 4, row by row, {pitch * 1e3:g} mm apart"
            return SensorGrid(), f"The file does not say how its 16 channels lie: {lie} was assumed."
        raise ShapeError(
            f"{path}: the file has {channels} channels and does not say how they lie; "
            "give sensor=SensorGrid(rows=..., columns=..., pitch=...)"
        )
