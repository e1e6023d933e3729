"""What comes out of a file, what was noticed on the way, and what the reader was told beforehand."""

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from midair.errors import InputError, MismatchError, RateError, ShapeError, UnitError
from midair.files.timestamps import held
from midair.lazy_frames import blocks, each_frame
from midair.model import Calibration, Event, Provenance, Recording, SensorGrid, Setting, Unit
from midair.recordings import Mended, Mending, mend

ONE = SensorGrid(rows=1, columns=1)
"""What a file of one channel is taken for."""


@dataclass(frozen=True, slots=True, kw_only=True)
class OpenedTake:
    """What a file gives of a recording, all of it together, so that no calibration is left behind.

    Attributes
    ----------
    recording : Recording
        What the file holds.
    calibration : Calibration or None
        Of its sensor, where the file carries one; formats of other programs have no place for it.
    journal : tuple of Event
        What happened while it was recorded: lost frames, clipping, drift.
    report : tuple of str
        One sentence for each thing that was assumed, changed, left out or looks wrong; empty when there is nothing.
    stored : bool
        Whether it is a file of midair's own, which may hold calibrated pressure too (`load_pressure`).
    """

    recording: Recording
    calibration: Calibration | None = None
    journal: tuple[Event, ...] = ()
    report: tuple[str, ...] = ()
    stored: bool = False

    def __repr__(self) -> str:
        known = "no calibration" if self.calibration is None else "with calibration"
        return f"<OpenedTake {self.recording!r}, {known}, {len(self.journal)} events>"


@dataclass(frozen=True, slots=True, kw_only=True)
class ImportOptions:
    """What a person says about a file that does not say it itself; None where they say nothing.

    Attributes
    ----------
    rate : float or None
        Frames per second, in Hz.
    unit : {"V", "count", "Pa"} or None
        Of the samples.
    sensor : SensorGrid or None
        How the channels are laid out.
    scale : float or None
        Pressure that 1 of the file's numbers means, in Pa.
    channels : tuple of str or None
        The ones to take, in this order, by name or by number from 0.
    stream : str or None
        Which one to take of a file that holds several: a stream of XDF, a group of TDMS, a topic of MCAP, an array of
        NPZ or MAT.
    packed : int or None
        Channels whose numbers stand one after another, frame behind frame, whatever axes the file has.
    mending : Mending or None
        How gaps are filled, numbers that are NaN, infinite or missing; None refuses them.
    streamed : bool
        Whether its samples may be a reel, read when somebody asks for them.
    """

    rate: float | None = None
    unit: Unit | None = None
    sensor: SensorGrid | None = None
    scale: float | None = None
    channels: tuple[str, ...] | None = None
    stream: str | None = None
    packed: int | None = None
    mending: Mending | None = None
    streamed: bool = False

    def __post_init__(self) -> None:
        if self.packed is not None and self.packed < 1:
            raise InputError(f"packed: expected a number of channels from 1 on, got {self.packed}")
        if self.scale is not None and not (np.isfinite(self.scale) and self.scale != 0):
            raise InputError(f"scale: expected a number other than 0 Pa, got {self.scale:g}")
        if self.scale is not None and self.unit not in (None, "Pa"):
            raise MismatchError(f"scale: it makes pressure of the numbers, got unit={self.unit!r}; leave unit out")

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
        for name in ("scale", "channels", "stream", "packed"):
            if getattr(self, name) is not None:
                raise MismatchError(f"{path}: the file is midair's own and says everything; leave {name} out")
        if self.mending is not None:
            raise MismatchError(f"{path}: the file is midair's own, in which nothing is missing; leave mend out")
        for name, given, stated in pairs:
            if given is not None and given != stated:
                raise MismatchError(f"{path}: the file says {name} {stated}, got {name} {given}; leave {name} out")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ImportedData:
    """What a file of another program says.

    Attributes
    ----------
    samples : ndarray, shape (frame, channel) or (frame, row, column)
        As in the file.
    form : str
        What to call the format in messages and in the provenance.
    rate, unit, sensor
        None where the file does not say.
    names : tuple of str
        Of the channels; () where they have none.
    units : tuple of {"V", "count", "Pa", None}
        Of each channel, where the file says that instead of `unit`.
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
    names: tuple[str, ...] = ()
    units: tuple[Unit | None, ...] = ()
    notes: Mapping[str, str] = field(default_factory=dict[str, str])
    settings: Mapping[str, Setting] = field(default_factory=dict[str, Setting])
    report: tuple[str, ...] = ()

    def settle(self, given: ImportOptions, path: Path) -> OpenedTake:
        """The recording, once every gap of the file is filled by what was given or by a stated assumption.

        Raises
        ------
        RateError, UnitError, ShapeError
            If the file does not say something, nobody gave it, and there is no sound assumption.
        MismatchError
            If what was given contradicts the file.
        """
        if given.packed is not None:
            return self._unpacked(given.packed, path).settle(replace(given, packed=None), path)
        if given.channels is not None:
            return self._chosen(given.channels, path).settle(replace(given, channels=None), path)
        rate = self._rate(given, path)
        unit = self._unit(given, path)
        sensor, assumed = self._sensor(given, path)
        mended = self._mended(given.mending, rate)
        report = (*self.report, *([assumed] if assumed else []), *_patches(mended, rate))
        settings = {"format": self.form, "sha256": _sha256(path), **self.settings}
        if given.scale is not None:
            settings["scale_pa"] = given.scale
        provenance = Provenance(source=path.name, notes=self.notes).then("import", {**settings, "report": report})
        if given.mending is not None:
            provenance = provenance.then("mend", _mend_settings(mended, given.mending))
        scale = given.scale or 1.0
        samples = each_frame(
            mended.samples, lambda block: block.reshape(len(block), *sensor.shape) * scale, exact=of_two(scale)
        )
        recording = Recording(samples=samples, rate=rate, sensor=sensor, unit=unit, provenance=provenance)
        return OpenedTake(recording=recording, report=report, journal=mended.journal)

    def _mended(self, mending: Mending | None, rate: float) -> Mended:
        """The samples with their gaps filled; as they are if nobody asked for that, to be refused if there are any."""
        if mending is None:
            return Mended(samples=self.samples, journal=())
        whole = np.asarray(self.samples, np.float64)
        return mend(whole.reshape(len(whole), -1), rate, mending)

    def _unpacked(self, channels: int, path: Path) -> "ImportedData":
        """Frames of so many channels, of numbers that stand one after another: c0 c1 c2 ... c0 c1 c2 ..."""
        whole = np.asarray(self.samples, np.float64)
        wide = int(np.prod(whole.shape[1:]))
        if whole.size % channels:
            raise ShapeError(
                f"{path}: expected a multiple of {channels} packed numbers, got {whole.size}; was it cut, or is it "
                "another number of channels?"
            )
        if "interpolation" in self.settings and wide % channels:
            # Between the stamps of two channels there is no line.
            raise ShapeError(
                f"{path}: expected whole frames of {channels} channels in each row with a time, got {wide} numbers; "
                "leave the time out and state the rate"
            )
        sentence = f"{whole.size} numbers were taken as {whole.size // channels} frames of {channels} channels in turn."
        return replace(
            self,
            samples=whole.reshape(-1, channels),
            rate=None if self.rate is None else self.rate * wide / channels,
            sensor=None,
            names=(),
            units=self.units if len(set(self.units)) == 1 else (),
            settings={**self.settings, "packed": channels},
            report=(*self.report, sentence),
        )

    def _rate(self, given: ImportOptions, path: Path) -> float:
        rate = given.rate if self.rate is None else self.rate
        if rate is None:
            raise RateError(f"{path}: the file does not say its frame rate; give it, such as rate=1000 (Hz)")
        if given.rate not in (None, rate):
            raise MismatchError(f"{path}: the file says {rate:g} Hz, got rate={given.rate:g}; leave rate out")
        return rate

    def _unit(self, given: ImportOptions, path: Path) -> Unit:
        stated = self.unit
        if self.units and len(set(self.units)) == 1:
            stated = self.units[0]
        if given.scale is not None:
            if stated == "Pa":
                raise MismatchError(f"{path}: the file says Pa, got scale={given.scale:g}; leave scale out")
            return "Pa"
        unit = stated or given.unit
        if unit is None:
            raise UnitError(
                f'{path}: the file does not say the unit of its samples; give unit="V", "count" or "Pa", or for '
                "another quantity the pressure that 1 of its unit means, such as scale=2 (Pa)"
            )
        if given.unit not in (None, unit):
            raise MismatchError(f"{path}: the file says {unit}, got unit={given.unit!r}; leave unit out")
        return unit

    def _sensor(self, given: ImportOptions, path: Path) -> tuple[SensorGrid, str]:
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
            return ONE, ""
        if channels == SensorGrid().count:
            lie = f"4 x 4, row by row, {pitch * 1e3:g} mm apart"
            return SensorGrid(), f"The file does not say how its 16 channels lie: {lie} was assumed."
        named = f" ({', '.join(self.names[:20])})" if self.names else ""
        raise ShapeError(
            f"{path}: the file has {channels} channels{named} and does not say how they lie; "
            "give sensor=SensorGrid(rows=..., columns=..., pitch=...), or choose some with channels=(...)"
        )

    def _chosen(self, channels: tuple[str, ...], path: Path) -> "ImportedData":
        """Only these channels, of which nobody says any more how they lie."""
        places = [self._place(channel, int(np.prod(self.samples.shape[1:])), path) for channel in channels]
        if not places or len(set(places)) != len(places):
            raise ShapeError(f"{path}: expected channels that are there once each, got {', '.join(channels) or 'none'}")
        names = tuple(self.names[i] for i in places) if self.names else tuple(str(i) for i in places)
        samples = each_frame(self.samples, lambda block: block.reshape(len(block), -1)[:, places], exact=True)
        some = next(blocks(samples))
        fine = len(np.unique(some, axis=0)) > len(some) / 2  # coarse numbers repeat by themselves
        repeats = tuple(sentence for sentence in held(samples) if fine and sentence not in self.report)
        return replace(
            self,
            samples=samples,
            report=(*self.report, *repeats),
            sensor=None,
            names=names,
            units=tuple(self.units[i] for i in places) if self.units else (),
            settings={**self.settings, "channels": names},
        )

    def _place(self, channel: str, count: int, path: Path) -> int:
        if channel in self.names:
            return self.names.index(channel)
        if channel.isdecimal() and int(channel) < count:
            return int(channel)
        known = ", ".join(self.names[:40]) or "no names"
        raise ShapeError(f"{path}: expected a channel by name ({known}) or number 0 to {count - 1}, got {channel!r}")


def _patches(mended: Mended, rate: float) -> tuple[str, ...]:
    """A sentence for the gaps that were filled."""
    if not mended.journal:
        return ()
    missing = sum(event.frames for event in mended.journal)
    longest = max(mended.journal, key=lambda event: event.frames)
    return (
        f"{missing} numbers were missing in {len(mended.journal)} gaps and are made up, the longest "
        f"{longest.frames / rate * 1e3:.4g} ms from {longest.frame / rate:.4g} s on in channel {longest.channel}.",
    )


def _mend_settings(mended: Mended, mending: Mending) -> dict[str, Setting]:
    """How gaps were filled and where the first thousand of them are, for the provenance."""
    places = tuple((event.channel, event.frame, event.frames) for event in mended.journal)
    return {
        "longest_s": mending.longest,
        "fill": mending.fill,
        "gaps": len(places),
        "numbers": sum(frames for *_, frames in places),
        "channel_frame_frames": places[:1000],
    }


def of_two(scale: float) -> bool:
    """Whether a factor is a power of two, which leaves every digit of a number as it is."""
    return abs(np.frexp(scale)[0]) == 0.5


def _sha256(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


@dataclass(frozen=True, slots=True, kw_only=True)
class Format:
    """A file format of recordings, registered under the endings of its names."""

    name: str
    read: Callable[[Path, ImportOptions], OpenedTake]
    """Read a file with what the user states about it."""
    write: Callable[[Recording, Path, Calibration | None], Sequence[Any]] | None = None
    """Write a recording; returns a `FormatLoss` for each thing that the format cannot hold. None if it is only read."""
    memory: float = 0
    """Least number of bytes that reading takes for each byte of the file; 0 if it is read in parts."""
    effect: bool = False
    """Whether it holds effects that are rendered, so that reading does not return the samples that were written."""
