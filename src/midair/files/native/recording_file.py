"""Recordings, `name.h5`: samples, calibration, provenance, events, calibrated pressure and live touch."""

import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from midair.errors import FileError, InputError, MismatchError
from midair.files.native.hdf5 import check_kind, new_file, read_group, read_part, write_group
from midair.files.native.journal import journal_from, with_journal
from midair.files.native.provenance_json import from_json
from midair.files.native.raw_recording import complete, open_file
from midair.files.native.schema import Kind, built, single, stored_values
from midair.files.opened_take import Format, FormatLoss, ImportOptions, OpenedTake
from midair.model import (
    Calibration,
    Event,
    PlayedTouch,
    PressureFrames,
    Provenance,
    Recording,
    SensorGrid,
    StageStamp,
    Unit,
)


def load_played(path: str | os.PathLike[str]) -> PlayedTouch | None:
    """Read the live touch that was played during a recording; None if there was none.

    Errors are those of `load_solution`.
    """
    with open_file(path) as file:
        check_kind(file, "recording")
        return read_part(file, "played", PlayedTouch, Path(path))


def write_recording(
    recording: Recording,
    path: Path,
    calibration: Calibration | None = None,
    pressure: PressureFrames | None = None,
    *,
    journal: Sequence[Event] = (),
    force: bool = False,
) -> tuple[FormatLoss, ...]:
    """Write a recording with its calibration and pressure, atomically and without loss.

    Over a file of the same samples, what is not given stays: calibration, pressure, events, stage, live touch. Raises
    InputError over a file of others with a calibration that would be lost, unless `force`. Samples are stored as
    float32 if that holds all of them.
    """
    if pressure is not None and pressure.sensor.shape != recording.sensor.shape:
        raise MismatchError(
            f"{path}: expected pressure of {recording.sensor.shape} cells, got {pressure.sensor.shape}; "
            "save the pressure of this recording"
        )
    parts: dict[Kind, Any] = {"calibration": calibration, "pressure": pressure, "played": None}
    kept = _kept(recording, path, calibration, force=force)
    rows = SimpleNamespace(events=journal or kept.get("events"), stamps=kept.get("stamps"))
    values = stored_values("recording", rows) | stored_values("recording", recording)
    values["samples"] = single(recording.samples)
    with new_file(path, room=2 * recording.samples.nbytes) as file:
        write_group(file, "recording", values)
        for kind, part in parts.items():
            if (part := part or kept.get(kind)) is not None:
                write_group(file.create_group(kind), kind, stored_values(kind, part))
    return ()


def _kept(recording: Recording, path: Path, calibration: Calibration | None, *, force: bool) -> dict[str, Any]:
    """Events, stage and parts that stay of the file that a recording replaces, as `write_recording` says."""
    made: dict[Kind, Any] = {"calibration": Calibration, "pressure": PressureFrames, "played": PlayedTouch}
    try:
        with open_file(path) as file:
            values = read_group(file, "recording", path)
            parts = {kind: read_part(file, kind, each, path) for kind, each in made.items()}
    except (FileError, InputError):  # a missing or damaged file, or one of another kind
        return {}
    known = parts["calibration"]
    if values["rate_hz"] != recording.rate or not np.array_equal(values["samples"], recording.samples):
        if known and calibration is None and not force:
            raise InputError(f"{path}: holds a calibration; give calibration=, force=True to lose it, or another name")
        return {}
    if calibration is not None and calibration.identifier != getattr(known, "identifier", ""):
        parts["pressure"] = None
    return parts | dict(zip(("events", "stamps"), journal_from(values), strict=True))


def read_recording(path: Path, given: ImportOptions) -> OpenedTake:
    """Read a recording; an interrupted one is converted first, and reported."""
    report = complete(path)
    with open_file(path) as file:
        values = read_group(file, "recording", path)
        journal, stamps = journal_from(values)
        life = from_json(values["provenance"])
        life = with_journal(life, journal, stamps, len(values["time"]), values["rate_hz"])
        recording = built(Recording, "recording", values, provenance=life)
        given.check(recording)
        calibration = read_part(file, "calibration", Calibration, path)
        return OpenedTake(recording=recording, calibration=calibration, journal=journal, report=report, stored=True)


def repair(path: str | os.PathLike[str]) -> tuple[str, ...]:
    """Convert a recording that was interrupted to HDF5, as `open_take` does, and read the whole file.

    Returns a sentence on what is kept, or nothing if the recording was complete. Raises MissingFileError,
    BrokenFileError or FileError if the file is damaged, or a program is still recording into it.
    """
    report = read_recording(Path(path), ImportOptions()).report
    load_pressure(path)
    load_played(path)
    return report


class RecordingBuffer:
    """Keeps a growing recording in memory, with the parameters and methods of `RecordingWriter`."""

    def __init__(
        self,
        *,
        rate: float,
        sensor: SensorGrid,
        unit: Unit,
        provenance: Provenance,
        calibration: Calibration | None = None,
    ) -> None:
        self.rate, self.sensor, self.provenance, self.calibration = rate, sensor, provenance, calibration
        self.unit: Unit = unit
        self.frames = 0
        self._blocks: list[np.ndarray] = []
        self._events: list[Event] = []
        self._stamps: list[StageStamp] = []

    def append(self, block: ArrayLike) -> None:
        """Append frames, shape (frame, row, column)."""
        self._blocks.append(np.array(block, np.float64))
        self.frames += len(self._blocks[-1])

    def note(self, events: Iterable[Event]) -> None:
        """Store events."""
        self._events.extend(events)

    def stamp(self, stamps: Iterable[StageStamp]) -> None:
        """Store stage positions with times from frame 0 on."""
        self._stamps.extend(stamps)

    def take(self) -> OpenedTake:
        """The recording so far, as it would be read from a file."""
        journal = tuple(self._events)
        life = with_journal(self.provenance, journal, self._stamps, self.frames, self.rate)
        recording = Recording(
            samples=np.concatenate(self._blocks), rate=self.rate, sensor=self.sensor, unit=self.unit, provenance=life
        )
        return OpenedTake(recording=recording, calibration=self.calibration, journal=journal)


def load_pressure(path: str | os.PathLike[str]) -> PressureFrames | None:
    """Read the calibrated pressure in a recording's file; None if it has none.

    Errors are those of `load_solution`.
    """
    with open_file(path) as file:
        check_kind(file, "recording")
        return read_part(file, "pressure", PressureFrames, Path(path))


HDF5 = Format(name="HDF5 of midair", read=read_recording, write=write_recording)
