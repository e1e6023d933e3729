"""File formats of recordings: the result of reading one, options for files of other programs, losses of writing."""

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array
from midair.errors import InputError, MismatchError, RateError, ShapeError, UnitError
from midair.model import Calibration, Event, Provenance, Recording, SensorGrid, Setting, Unit, known_unit
from midair.recordings import Mended, Mending, is_clock, mend, repeated_rows, seconds, to_fixed_rate
from midair.validation import Declared, documented, setting

Decimal = Literal["point", "comma"]
"""Sign of decimals in text."""

ONE = SensorGrid(rows=1, columns=1)
"""Default sensor of a file with one channel."""


@dataclass(frozen=True, slots=True, kw_only=True)
class OpenedTake:
    """A recording with its calibration, journal and import report."""

    recording: Recording
    calibration: Calibration | None = None
    """Calibration of its sensor, if the file contains one; only formats of midair do."""
    journal: tuple[Event, ...] = ()
    """Events during the recording: lost frames, clipping, drift."""
    report: tuple[str, ...] = ()
    """One sentence for each assumption, change, omission or suspicious channel."""
    stored: bool = False
    """True for an HDF5 file of midair, which may contain calibrated pressure too (`load_pressure`)."""

    def __repr__(self) -> str:
        known = "no calibration" if self.calibration is None else "with calibration"
        return f"<OpenedTake {self.recording!r}, {known}, {len(self.journal)} events>"


@documented
@dataclass(frozen=True, slots=True, kw_only=True)
class ImportOptions(Declared):
    """Facts about a file that it does not contain, and how to read it; None if not given.

    A contradiction between the file and an option raises an error.
    """

    rate: float | None = setting(None, "Frame rate.", unit="Hz")
    unit: Unit | None = setting(None, "Unit of the samples.")
    sensor: SensorGrid | None = setting(None, "Layout of the channels.", option="")
    scale: float | None = setting(
        None, "Pressure per unit of the file, such as 30Pa: per full scale, per volt, per 1 m/s2.", unit="Pa"
    )
    channels: Sequence[str] | None = setting(
        None, "Channels to read, in this order, by name or by number from 0.", option=""
    )
    field: str | None = setting(
        None, "One of several data sets: a stream of XDF, a group of TDMS, an array of NPZ or MAT such as S.data."
    )
    transpose: bool = setting(False, "Take the last axis of an array as time, not the one that fits or is longest.")
    time: str | None = setting(None, "Column of time stamps, by name or by number from 0; none to ignore them.")
    separator: str | None = setting(None, "Separator of a text: comma, semicolon, tab, space, bar or one character.")
    decimal: Decimal | None = setting(None, "Sign of decimals in a text.")
    skip: int = setting(0, "Number of lines of a text to leave out at its start.")
    unit_row: int | None = setting(None, "Line of a text that holds the units, from 1 on; 0 for none.")
    mending: Mending | None = setting(None, "How to fill gaps (NaN, infinite or missing numbers).", option="")

    def __post_init__(self) -> None:
        if self.skip < 0 or (self.unit_row or 0) < 0:
            raise InputError(f"skip, unit_row: expected lines from 0 on, got {self.skip}, {self.unit_row}")
        if self.scale is not None and not (np.isfinite(self.scale) and self.scale != 0):
            raise InputError(f"scale: expected a number other than 0 Pa, got {self.scale:g}")
        if self.scale is not None and self.unit not in (None, "Pa"):
            raise MismatchError(f"scale: it converts numbers to Pa, got the unit {self.unit}; leave the unit out")

    def check(self, recording: Recording) -> None:
        """Raise MismatchError if an option contradicts a file of midair, which needs no options."""
        for name in (one.name for one in fields(self)):
            value, stated = getattr(self, name), getattr(recording, name, None)
            if name in ("rate", "unit", "sensor") and value not in (None, stated):
                raise MismatchError(f"the file states {name} {stated}, got {name} {value}; leave {name} out")
            if name not in ("rate", "unit", "sensor") and value not in (None, False):
                raise MismatchError(f"a file of midair has no gaps and needs no options; leave {name} out")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ImportedData:
    """Data that an importer read from a file of another program; facts that the file lacks are None or empty."""

    samples: NDArray[np.float64]
    """Shape (frame, channel) or (frame, row, column)."""
    form: str
    """Name of the format for messages and the provenance."""
    rate: float | None = None
    stamps: NDArray[np.float64] | None = None
    """Time of each row; without a rate and stamps, the first column whose name is that of a clock."""
    clock: str = "time [s]"
    """Name of the stamps, with their unit if it is known."""
    nominal: float | None = None
    """Fixed rate that the file states, in Hz, where stamps may have jitter."""
    missing: int = 0
    """Number of frames that are NaN, because their rows are missing."""
    simulated: bool = False
    sensor: SensorGrid | None = None
    names: tuple[str, ...] = ()
    """Channel names."""
    units: tuple[str, ...] = ()
    """Unit of each channel as the file states it, "" for none; () if it states none."""
    notes: Mapping[str, str] = field(default_factory=dict[str, str])
    """Notes on the experiment, from the file or its name."""
    settings: Mapping[str, Setting] = field(default_factory=dict[str, Setting])
    """Settings of the import, for the provenance."""
    report: tuple[str, ...] = ()
    """Sentences for the user so far."""

    def resolve(self, given: ImportOptions, path: Path) -> OpenedTake:
        """Build the recording; facts that the file lacks come from the options or a stated assumption, or raise."""
        if not len(self.samples):
            raise InputError("expected one frame or more, got none; is the file complete?")
        found = self if self.rate is not None else self._at_fixed_rate(given)
        found = found if given.channels is None else found._select(given.channels)
        return found._recording(given, path)

    def _recording(self, given: ImportOptions, path: Path) -> OpenedTake:
        facts: list[Any] = []
        lacking: list[InputError] = []
        for find in (self._rate, self._unit, self._sensor):
            try:
                facts.append(find(given))
            except InputError as wrong:
                if not wrong.parameters:
                    raise
                lacking.append(wrong)
        if lacking:
            raise InputError(*lacking) if len(lacking) > 1 else lacking[0]
        rate, unit, (sensor, assumed) = facts
        mended, mending = Mended(samples=self.samples, journal=()), given.mending
        if mending is None and self.missing:
            mending = Mending(fill="line")
        if mending is not None:
            whole = np.asarray(self.samples, np.float64)
            mended = mend(whole.reshape(len(whole), -1), rate, mending)
        report = (*self.report, *([assumed] if assumed else []), *_gap_report(mended, rate))
        with path.open("rb") as file:
            settings = {"format": self.form, "sha256": hashlib.file_digest(file, "sha256").hexdigest(), **self.settings}
        if given.scale is not None:
            settings["scale_pa"] = given.scale
        provenance = Provenance(source=path.name, simulated=self.simulated, notes=self.notes)
        provenance = provenance.then("import", {**settings, "report": report})
        if mending is not None:
            # The positions of the first thousand gaps.
            gaps = tuple((event.channel, event.frame, event.frames) for event in mended.journal)
            said = {"longest_s": mending.longest, "fill": mending.fill, "gaps": len(gaps)}
            said |= {"numbers": sum(frames for *_, frames in gaps), "channel_frame_frames": gaps[:1000]}
            provenance = provenance.then("mend", said)
        scale: float | Array = given.scale or 1.0
        if self.units and given.scale is None:
            scale = np.reshape([known_unit(text)[1] for text in self.units], sensor.shape)
        samples = np.asarray(mended.samples).reshape(-1, *sensor.shape) * scale
        recording = Recording(samples=samples, rate=rate, sensor=sensor, unit=unit, provenance=provenance)
        return OpenedTake(recording=recording, report=report, journal=mended.journal)

    def _at_fixed_rate(self, given: ImportOptions) -> "ImportedData":
        """Place rows on frames by their stamps, or by the first column of stamps; other such columns are left out."""
        stamps, clock, report, found = self.stamps, self.clock, self.report, self
        at = [i for i, name in enumerate(self.names) if is_clock(name)]
        at = at or [0] * bool(self.names and self.units and is_clock(f"t [{self.units[0]}]"))
        if given.time is not None:
            stamps, at = None, [] if given.time == "none" else [self._index_of(given.time, self.samples.shape[1])]
        if at:
            found = self._only([i for i in range(self.samples.shape[1]) if i not in at])
            found = replace(found, settings={**self.settings, "columns": found.names})
            if not found.samples.size:
                raise ShapeError(f"expected a channel beside the time, got none. {' '.join(self.report)}")
        if stamps is None and at:
            place, *at = at
            stamps, clock = self.samples[:, place], self.names[place] if self.names else str(place)
            unit = f"time [{self.units[place]}]" if self.units else ""
            clock = unit if is_clock(unit) else clock
            if any(self.names[i] == self.names[place] and (self.samples[:, i] != stamps).any() for i in at):
                raise RateError(f"expected one time for all channels, got columns {clock!r} that differ")
        if at:
            report = (*report, f"Other columns of time were left out: {', '.join(self.names[i] for i in at)}.")
        if stamps is None:
            stated = () if self.nominal is None else (f"Rate {self.nominal:g} Hz, as the file states.",)
            return replace(found, rate=self.nominal, report=(*report, *stated))
        time, guess = seconds(stamps, clock, rate=given.rate or self.nominal)
        rows = found.samples.reshape(len(time), -1)
        even = to_fixed_rate(time, rows, rate=given.rate, nominal=self.nominal)
        return replace(
            found,
            samples=even.samples.reshape(-1, *found.samples.shape[1:]),
            rate=even.rate,
            missing=even.missing,
            settings={**found.settings, "rate_hz": even.rate, "interpolation": "linear"},
            report=(*report, *guess, *even.report),
        )

    def _only(self, places: Sequence[int]) -> "ImportedData":
        """These channels in this order."""
        return replace(
            self,
            samples=self.samples.reshape(len(self.samples), -1)[:, places],
            names=tuple(self.names[i] for i in places) if self.names else tuple(map(str, places)),
            units=tuple(self.units[i] for i in places) if self.units else (),
        )

    def _rate(self, given: ImportOptions) -> float:
        rate = given.rate if self.rate is None else self.rate
        if rate is None:
            raise RateError("the file does not state its frame rate", parameters={"rate": "rate=1000 (Hz)"})
        if given.rate not in (None, rate):
            raise MismatchError(f"the file states {rate:g} Hz, got {given.rate:g} Hz; leave the rate out")
        return rate

    def _unit(self, given: ImportOptions) -> Unit:
        texts = sorted(set(self.units))
        known: set[Unit | None] = {known_unit(text)[0] for text in texts} or {None}
        alike = len(self.units) == np.prod(self.samples.shape[1:]) and given.scale is None and None not in known
        if len(known) > 1 or (len(texts) > 1 and not alike):
            got = ", ".join(text or "none" for text in texts)
            raise UnitError(f"expected one unit in all channels, got {got}; choose channels of one")
        stated, said = known.pop(), texts[0] if texts else ""
        if given.scale is not None:
            if stated == "Pa":
                raise MismatchError("the file states Pa, got a scale; leave it out")
            return "Pa"
        # Numbers of an unknown unit can be counts, but no volts.
        if given.unit not in (None, stated) and (stated or (said and given.unit != "count")):
            advice = "leave the unit out" if stated else "give a scale, the pressure of the value 1, or correct it"
            raise MismatchError(f"the file states {stated or said}, got {given.unit}; {advice}")
        unit = stated or given.unit
        if unit is None:
            scale = {"scale": "scale=2, the pressure in Pa of the value 1"}
            if said:
                raise UnitError(f"expected V, Pa or count, the file states {said}", parameters=scale)
            raise UnitError(
                "the file does not state the unit of its samples",
                parameters={"unit": 'unit="V", "count" or "Pa"', **scale},
            )
        return unit

    def _sensor(self, given: ImportOptions) -> tuple[SensorGrid, str]:
        channels = int(np.prod(self.samples.shape[1:]))
        if given.sensor is not None:
            rows_differ = self.samples.ndim == 3 and self.samples.shape[1:] != given.sensor.shape
            if given.sensor.count != channels or rows_differ:
                have = " x ".join(map(str, self.samples.shape[1:]))
                want = f"{given.sensor.rows} x {given.sensor.columns}"
                raise MismatchError(f"the file has {have} channels, got a sensor of {want}; give one that fits")
            return given.sensor, ""
        if self.sensor is not None:
            return self.sensor, ""
        pitch = SensorGrid().pitch
        if self.samples.ndim == 3:
            sensor = SensorGrid(rows=self.samples.shape[1], columns=self.samples.shape[2])
            return sensor, f"The file does not state the pitch of the sensor: {pitch * 1e3:g} mm was assumed."
        if channels == 1:
            return ONE, ""
        if channels == SensorGrid().count:
            layout = f"4 x 4, row by row, {pitch * 1e3:g} mm apart"
            return SensorGrid(), f"The file does not state the layout of its 16 channels: {layout} was assumed."
        named = f" ({', '.join(self.names[:20])})" if self.names else ""
        raise ShapeError(
            f"the file has {channels} channels{named} and does not state their layout",
            parameters={
                "channels": "channels=(...) to choose some",
                "sensor": "sensor=SensorGrid(rows=..., columns=..., pitch=...)",
            },
        )

    def _select(self, channels: Sequence[str]) -> "ImportedData":
        """Keep only these channels; their layout becomes unknown."""
        places = [self._index_of(channel, int(np.prod(self.samples.shape[1:]))) for channel in channels]
        if not places or len(set(places)) != len(places):
            raise ShapeError(f"expected different channels, got {', '.join(channels) or 'none'}")
        found = self._only(places)
        some = found.samples[:_COMPARED]
        fine = len(np.unique(some, axis=0)) > len(some) / 2  # coarse numbers repeat by themselves
        repeats = tuple(text for text in repeated_rows(found.samples) if fine and text not in self.report)
        settings = {**self.settings, "channels": found.names}
        return replace(found, report=(*self.report, *repeats), sensor=None, settings=settings)

    def _index_of(self, channel: str, count: int) -> int:
        if channel in self.names:
            return self.names.index(channel)
        if channel.isdecimal() and int(channel) < count:
            return int(channel)
        known = ", ".join(self.names[:40]) or "no names"
        raise ShapeError(f"expected a channel by name ({known}) or number 0 to {count - 1}, got {channel!r}")


def _gap_report(mended: Mended, rate: float) -> tuple[str, ...]:
    if not mended.journal:
        return ()
    missing = sum(event.frames for event in mended.journal)
    longest = max(mended.journal, key=lambda event: event.frames)
    return (
        f"{missing} numbers were missing in {len(mended.journal)} gaps and were interpolated, the longest "
        f"{longest.frames / rate * 1e3:.4g} ms from {longest.frame / rate:.4g} s on in channel {longest.channel}.",
    )


_COMPARED = 2**14
"""Frames in which equal rows are counted."""

Lost = Literal["calibration", "pressure", "provenance", "sensor", "scale", "rate", "channels", "waveform"]
"""Kinds of lost information, as keys for programs."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FormatLoss:
    """Information that a file does not contain, or that only midair can read from it."""

    what: Lost
    text: str
    """Description in one sentence."""

    def __str__(self) -> str:
        return self.text


Writer = Callable[[Recording, Path], tuple[FormatLoss, ...]]
"""Writes a recording; returns what the format cannot store."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Format:
    """A file format of recordings, registered under the endings of its names."""

    name: str
    read: Callable[[Path, ImportOptions], OpenedTake | ImportedData]
    """Read a file with what the user states about it; `open_take` resolves what a file of another program lacks."""
    write: "Writer | None" = None
    """Write a recording; returns what the format cannot store. None if it is only read."""
    memory: float = 0
    """Least number of bytes that reading takes for each byte of the file; 0 if it is read in parts."""
