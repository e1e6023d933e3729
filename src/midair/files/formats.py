"""Supported file formats by file name suffix, and the functions `open_take`, `load`, `save` and `contents`."""

import os
import tomllib
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, get_args

import numpy as np

from midair.errors import BrokenFileError, FileError, InputError, UnknownFormatError
from midair.files.atomic import atomic_file, existing_file, parse_errors
from midair.files.native.calibration_file import ARRAY_SUFFIX, CALIBRATION_SUFFIX, save_calibration
from midair.files.native.drive_file import DRIVE_SUFFIX, load_solution, load_target, save_solution
from midair.files.native.hdf5 import check_kind, kind_of, plain_text, stored_dataset
from midair.files.native.raw_recording import open_file
from midair.files.native.recording_file import HDF5, write_recording
from midair.files.native.schema import Kind
from midair.files.opened_take import Format, FormatLoss, ImportedData, ImportOptions, OpenedTake, Writer
from midair.files.size_limits import check_memory_for
from midair.model import Calibration, Drive, Event, PressureFrames, Recording, Solution, Status
from midair.recordings import suspicious
from midair.registry import Registry
from midair.validation import checked_call

Place = str | os.PathLike[str]
_STORED = tomllib.loads(Path(__file__).with_name("formats.toml").read_text(encoding="utf-8"))
FORMATS: Registry[Format] = Registry("midair.formats", _STORED)
"""File formats by the ending of a name, in small letters."""

OTHERS: Mapping[str, str] = {
    DRIVE_SUFFIX: "a drive: midair solve writes it, midair play and show read it; in Python load_solution()",
    ARRAY_SUFFIX: "an array's calibration: midair calibrate array writes it; in Python load_array_calibration()",
    CALIBRATION_SUFFIX: "a calibration: midair calibrate measure writes it; in Python load_calibration()",
}
"""Suffixes of files other than recordings, and what is for them."""


@checked_call
def load(path: Place, **given: Any) -> Recording | Solution:
    """Read a recording in any supported format, or the solution in a ``.drive.h5``.

    `open_take` also returns the calibration, the journal and a report of assumptions.

    Parameters
    ----------
    path : str or PathLike
        Suffix .h5, .hdf5, .csv, .tsv, .txt, .lvm, .xml, .wav, .rf64, .npz, .npy, .mat, .flac, .aiff, .ogg, .mp3, .xdf,
        .tdms; .ahap and .haptic effects are rendered to waves.
    rate, unit, sensor, scale, channels, field, transpose, time, separator, decimal, skip, unit_row, mending
        Facts that a file of another program does not contain: the fields of `ImportOptions`.

    Raises
    ------
    MissingFileError, BrokenFileError, UnknownFormatError
        If the file does not exist, is damaged or of another type, or its format is unknown.
    InputError
        A subclass that names the missing or unusable fact.
    """
    if os.fspath(path).lower().endswith(DRIVE_SUFFIX):
        if given:
            got = ", ".join(f"{name}={value!r}" for name, value in given.items())
            raise InputError(f"{path}: expected no options for a drive, got {got}")
        return load_solution(path)
    return open_take(path, **given).recording


@checked_call
def open_take(path: Place, **given: Any) -> OpenedTake:
    """Read a recording with its calibration, its journal and a report of all assumptions.

    The content of a file decides what it is; the case of its suffix does not matter. Parameters and errors are those of
    `load`.
    """
    options = ImportOptions(**given)
    file = existing_file(path)
    form = format_of(path)
    if form.memory:
        check_memory_for(form.memory * file.stat().st_size, f"{path}, a {form.name} file", "cut it, or decimate it")
    # Damaged numbers may overflow here; Recording rejects numbers that are not finite.
    with parse_errors(file, f"a {form.name} file"), np.errstate(all="ignore"):
        imported = form.read(file, options)
        if isinstance(imported, ImportedData):
            imported = imported.resolve(options, file)
    return replace(imported, report=(*imported.report, *suspicious(imported.recording)))


@checked_call
def save(
    what: Recording | PressureFrames | Solution | Drive | Calibration | OpenedTake,
    path: str | os.PathLike[str],
    *,
    calibration: Calibration | None = None,
    pressure: PressureFrames | None = None,
    journal: Sequence[Event] = (),
    force: bool = False,
) -> tuple[FormatLoss, ...]:
    """Write data atomically, in the format of the suffix of `path`; returns each loss of the format.

    Over a file of the same samples or phases, all that it holds besides stays: calibration, pressure, events, live
    touch; the errors and the target of a drive. Any other file is replaced.

    Raises UnknownFormatError if the suffix is unknown and FileError if the file cannot be written; InputError if the
    file holds a calibration for other samples that would be lost, unless `force`.

    Parameters
    ----------
    what : Recording, PressureFrames, Solution, Drive, Calibration or OpenedTake
        A pressure is written as a recording in Pa; the error of a drive alone is not known (NaN). An opened take brings
        its calibration and its journal.
    path : str or PathLike
        Suffix .h5, .hdf5, .csv, .wav, .flac, .npz or .mat of a recording or a pressure, .drive.h5 of a solution or a
        drive, or .csv for a table of time in s, level, and phases in rad, .calibration.h5.
    calibration, pressure
        Calibration of its sensor and calibrated pressure, stored in the same file.
    journal : sequence of Event
        Events during the recording; only HDF5 of midair stores them.
    """
    if isinstance(what, OpenedTake):
        calibration, journal, what = calibration or what.calibration, journal or what.journal, what.recording
    if isinstance(what, Solution | Drive):
        if os.fspath(path).lower().endswith(".csv"):
            _write_table(what if isinstance(what, Drive) else what.drive, path)
        else:
            _save_drive(what, path)
        return ()
    if isinstance(what, Calibration):
        save_calibration(what, path)
        return ()
    if isinstance(what, PressureFrames):
        what = Recording(
            samples=what.pressure, rate=what.rate, sensor=what.sensor, unit="Pa", provenance=what.provenance
        )
    write = writer_of(path)
    if write is HDF5.write:
        return write_recording(what, Path(path), calibration, pressure, journal=journal, force=force)
    text = f"{format_of(path).name} holds no provenance and no distance of cells; .h5 holds both."
    lost = [FormatLoss(what="provenance", text=text), *write(what, Path(path))]
    if calibration is not None:
        text = f"{format_of(path).name} holds no calibration; .h5 does."
        lost.append(FormatLoss(what="calibration", text=text))
    if pressure is not None:
        text = "The calibrated pressure was left out; --pressure exports it instead."
        lost.append(FormatLoss(what="pressure", text=text))
    return tuple(lost)


def _save_drive(what: Solution | Drive, path: Place) -> None:
    """Write a drive with the errors and the target of the file that it replaces, if that holds the same drive."""
    drive, target = what if isinstance(what, Drive) else what.drive, None
    status: tuple[Status, ...] = ("iterations",) * drive.frames
    nothing: Any = {"error": np.full(drive.frames, np.nan), "iterations": np.zeros(drive.frames, np.int64)}
    made = Solution(drive=drive, status=status, **nothing)
    with suppress(FileError, InputError):  # a missing or damaged file, or one of another kind
        stored = load_solution(path)
        if np.array_equal(stored.drive.phase, drive.phase) and np.array_equal(stored.drive.level, drive.level):
            made, target = stored, load_target(path)
    save_solution(made if isinstance(what, Drive) else what, path, target=target)


def _write_table(drive: Drive, path: Place) -> None:
    columns = {"level": np.asarray(drive.level).reshape(drive.frames, -1), "phase": np.asarray(drive.phase)}
    names = [f"{name}_{number}" for name, values in columns.items() for number in range(values.shape[1])]
    head = ",".join(["time_s", *(["level", *names[1:]] if drive.level.ndim == 1 else names)])
    with atomic_file(path) as file:
        np.savetxt(file, np.column_stack([drive.time, *columns.values()]), "%.6f", ",", header=head, comments="")


def write_errors(solution: Solution, path: Place) -> None:
    """Write the errors of a solution as a new CSV table; see `Solution.to_csv`."""
    if Path(path).exists():
        raise InputError(f"{path}: already exists; give another name")
    columns = np.column_stack([solution.drive.time, solution.error, solution.iterations, solution.plays])
    with atomic_file(path) as file:
        np.savetxt(file, columns, ("%.6f", "%.6g", "%d", "%d"), ",", header="time_s,E,iterations,plays", comments="")


def format_of(path: str | os.PathLike[str]) -> Format:
    """Format by the suffix of a file name; raises UnknownFormatError if it is not that of a recording."""
    name = os.fspath(path).lower()
    for ending, other in OTHERS.items():
        if name.endswith(ending):
            raise UnknownFormatError(f"{path}: expected a recording; names that end in {ending} are for {other}")
    if Path(name).suffix not in FORMATS:
        got = Path(name).suffix or "a name without an ending"
        raise UnknownFormatError(
            f"{path}: expected a recording such as .h5, .csv or .wav, got {got}; midair import --help lists all formats"
        )
    return FORMATS[Path(name).suffix]


def writer_of(path: str | os.PathLike[str]) -> Writer:
    """Function that writes the format of a suffix; UnknownFormatError names the suffixes that can be written."""
    known = {ending: form.write for ending, form in FORMATS.items() if form.write is not None}
    ending = Path(path).suffix.lower()
    if ending in known:
        format_of(path)  # refuses the names of drives and calibrations
        return known[ending]
    if ending in FORMATS:
        said = f"{FORMATS[ending].name} can be read, not written; writable formats are {', '.join(known)}"
        raise UnknownFormatError(f"{path}: {said}")
    raise UnknownFormatError(f"{path}: expected a name that ends in {', '.join(known)}; got {ending or 'no ending'!r}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Contents:
    """Summary of an HDF5 file of midair."""

    kind: Kind
    created: str
    """ISO 8601, UTC."""
    created_by: str
    """Program and version."""
    frames: int | None
    """None for a calibration of a sensor or an array."""
    parts: tuple[str, ...]
    """Other contents: "calibration" and "pressure" of a recording, "target" of a drive."""


def contents(path: str | os.PathLike[str]) -> Contents:
    """Summary of an HDF5 file of midair.

    Raises MissingFileError, BrokenFileError or UnknownFormatError if the file does not exist, is damaged or of another
    program, or was written by a newer midair.
    """
    with open_file(path) as file:
        text, kinds = kind_of(file), {f"midair {kind}": kind for kind in get_args(Kind)}
        if text not in kinds:
            raise BrokenFileError(f"{path}: expected a file of midair, got {text or 'an HDF5 file of another program'}")
        kind: Kind = kinds[text]
        check_kind(file, kind)
        return Contents(
            kind=kind,
            created=plain_text(file.attrs.get("created")),
            created_by=plain_text(file.attrs.get("created_by")),
            frames=None if kind in ("calibration", "array") else int(stored_dataset(file, "time").shape[0]),
            parts=tuple(part for part in ("calibration", "pressure", "target") if part in file),
        )
