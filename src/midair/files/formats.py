"""Supported file formats by file name suffix, and the functions `open_take`, `load` and `save`."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from midair.errors import InputError, UnknownFormatError
from midair.files.atomic import existing_file, parse_errors
from midair.files.file_format import Format, FormatLoss
from midair.files.native import (
    ARRAY_SUFFIX,
    CALIBRATION_SUFFIX,
    DRIVE_SUFFIX,
    HDF5,
    load_solution,
    write_recording,
)
from midair.files.opened_take import ImportOptions, OpenedTake
from midair.files.size_limits import check_memory_for
from midair.model import Calibration, Event, PressureFrames, Recording, SensorGrid, Solution, Unit
from midair.recordings import Mending, suspicious
from midair.registry import Registry
from midair.streaming import LazyFrames

FORMATS: Registry[Format] = Registry(
    "midair.formats",
    {
        ".h5": "midair.files.native:HDF5",
        ".hdf5": "midair.files.native:HDF5",
        ".csv": "midair.files.importers.csv_file:CSV",
        ".wav": "midair.files.importers.sound_file:WAV",
        ".npz": "midair.files.importers.numpy_files:NPZ",
        ".mat": "midair.files.importers.mat_file:MAT",
        ".nc": "midair.files.native:NETCDF4",
        ".npy": "midair.files.importers.numpy_files:NPY",
        ".w64": "midair.files.importers.sound_file:WAVE64",
        ".rf64": "midair.files.importers.sound_file:RF64",
        ".flac": "midair.files.importers.sound_file:FLAC",
        ".aiff": "midair.files.importers.sound_file:AIFF",
        ".aif": "midair.files.importers.sound_file:AIFF",
        ".ogg": "midair.files.importers.sound_file:OGG",
        ".mp3": "midair.files.importers.sound_file:MP3",
        ".xdf": "midair.files.importers.xdf_file:XDF",
        ".tdms": "midair.files.importers.tdms_file:TDMS",
        ".mcap": "midair.files.importers.mcap_file:MCAP",
        ".hjif": "midair.files.effects:HJIF",
        ".ahap": "midair.files.effects:AHAP",
    },
)
"""File formats by the ending of a name, in small letters."""

OTHERS: Mapping[str, str] = {
    DRIVE_SUFFIX: "a drive: load_solution() and save_solution()",
    ARRAY_SUFFIX: "an array's calibration: load_array_calibration() and save_array_calibration()",
    CALIBRATION_SUFFIX: "a calibration: load_calibration() and save_calibration()",
}
"""Suffixes of files other than recordings, and the functions for them."""


def load(
    path: str | os.PathLike[str],
    *,
    rate: float | None = None,
    unit: Unit | None = None,
    sensor: SensorGrid | None = None,
    scale: float | None = None,
    channels: Sequence[str] | None = None,
    stream: str | None = None,
    packed: int | None = None,
    mending: Mending | None = None,
) -> Recording | Solution:
    """Read a recording in any supported format, or the solution in a ``.drive.h5``.

    The options supply facts that a file of another program does not contain; a contradiction raises an error.
    `open_take` also returns the calibration, the journal and a report of assumptions.

    Parameters
    ----------
    path : str or PathLike
        Suffix .h5, .hdf5, .csv, .wav, .w64, .rf64, .npz, .npy, .mat, .nc, .flac, .aiff, .ogg, .mp3, .xdf, .tdms or
        .mcap; .ahap and .hjif effects are rendered to waves.
    rate : float, optional
        In Hz.
    unit : {"V", "count", "Pa"}, optional
        Unit of the samples.
    sensor : SensorGrid, optional
        Layout of the channels.
    scale : float, optional
        Pressure in Pa that corresponds to 1 in the file: to full scale, to 1 V, to 1 m/s2.
    channels : sequence of str, optional
        Channels to read, in this order, by name or by number from 0.
    stream : str, optional
        Which one to read from a file with several: a stream of XDF, a group of TDMS, a topic of MCAP, an array of NPZ
        or MAT.
    packed : int, optional
        Number of channels that are interleaved in a row of numbers. The axes of the file are ignored; its rate, if it
        has one, is the rate of its rows.
    mending : Mending, optional
        How to fill gaps (NaN, infinite or, in text, missing numbers); None raises an error for gaps.

    Returns
    -------
    Recording or Solution
        With the provenance from the file, or with the file's name as its source.

    Raises
    ------
    MissingFileError, BrokenFileError, UnknownFormatError
        If the file does not exist, is damaged or of another type, or its format is unknown.
    InputError
        A subclass that names the missing or unusable fact.
    """
    given = {
        "rate": rate,
        "unit": unit,
        "sensor": sensor,
        "scale": scale,
        "channels": channels,
        "stream": stream,
        "packed": packed,
        "mending": mending,
    }
    if os.fspath(path).lower().endswith(DRIVE_SUFFIX):
        if any(value is not None for value in given.values()):
            raise InputError(f"{path}: expected no options for a drive, got {_listed(given)}")
        return load_solution(path)
    return open_take(
        path,
        rate=rate,
        unit=unit,
        sensor=sensor,
        scale=scale,
        channels=channels,
        stream=stream,
        packed=packed,
        mending=mending,
    ).recording


def open_take(
    path: str | os.PathLike[str],
    *,
    rate: float | None = None,
    unit: Unit | None = None,
    sensor: SensorGrid | None = None,
    scale: float | None = None,
    channels: Sequence[str] | None = None,
    stream: str | None = None,
    packed: int | None = None,
    mending: Mending | None = None,
    streamed: bool = False,
) -> OpenedTake:
    """Read a recording with its calibration, its journal and a report of all assumptions.

    The content of a file decides what it is; the case of its suffix does not matter.

    Parameters
    ----------
    path, rate, unit, sensor, scale, channels, stream, packed, mending
        As in `load`.
    streamed : bool
        Whether to return lazy samples where the format supports it (HDF5 of midair, WAV), so that a recording of any
        length needs the memory of one block. Checks for suspicious channels are then left to
        `midair.recordings.suspicious`.

    Returns
    -------
    OpenedTake
        Its report has a sentence for each assumption, change, omission or suspicious channel.

    Raises
    ------
    MissingFileError, BrokenFileError, UnknownFormatError, InputError
        As in `load`.
    """
    form = format_of(path)
    file = existing_file(path)
    if form.memory:
        advice = "cut it, or convert it to .h5 or WAV, which are read in parts"
        check_memory_for(form.memory * file.stat().st_size, f"{path}, a {form.name} file", advice)
    # Damaged numbers may overflow here; Recording rejects numbers that are not finite.
    with parse_errors(file, f"a {form.name} file"), np.errstate(all="ignore"):
        chosen = None if channels is None else tuple(channels)
        given = ImportOptions(
            rate=rate,
            unit=unit,
            sensor=sensor,
            scale=scale,
            channels=chosen,
            stream=stream,
            packed=packed,
            mending=mending,
            streamed=streamed and mending is None,
        )
        imported = form.read(file, given)
    # The check would read all lazy frames.
    if isinstance(imported.recording.samples, LazyFrames):
        return imported
    return replace(imported, report=(*imported.report, *suspicious(imported.recording)))


def save(
    recording: Recording,
    path: str | os.PathLike[str],
    *,
    calibration: Calibration | None = None,
    pressure: PressureFrames | None = None,
    journal: Sequence[Event] = (),
) -> tuple[FormatLoss, ...]:
    """Write a recording atomically, in the format of the suffix of `path`.

    Parameters
    ----------
    path : str or PathLike
        Suffix .h5, .hdf5, .csv, .wav, .npz, .mat, .nc, .hjif or .ahap; an existing file is replaced.
    calibration : Calibration, optional
        Calibration of its sensor, stored in the same file.
    pressure : PressureFrames, optional
        Calibrated pressure, stored in the same file.
    journal : sequence of Event
        Events during the recording; only HDF5 of midair stores them.

    Returns
    -------
    tuple of FormatLoss
        One for each fact that the format cannot store.

    Raises
    ------
    UnknownFormatError
        If the suffix is unknown.
    FileError
        If the file cannot be written.
    """
    form = format_of(path)
    if form.write is None:
        known = ", ".join(ending for ending, each in FORMATS.items() if each.write)
        raise UnknownFormatError(f"{path}: {form.name} can be read, not written; writable formats are {known}")
    if journal and form is HDF5:
        return write_recording(recording, Path(path), calibration, pressure, journal=journal)
    if pressure is None:
        return form.write(recording, Path(path), calibration)
    if form is HDF5:
        return write_recording(recording, Path(path), calibration, pressure)
    lost = form.write(recording, Path(path), calibration)
    return (
        *lost,
        FormatLoss(what="pressure", text="The calibrated pressure was left out; --pressure exports it instead."),
    )


def format_of(path: str | os.PathLike[str]) -> Format:
    """Format by the suffix of a file name.

    Raises
    ------
    UnknownFormatError
        If the suffix is unknown, or is not that of a recording.
    """
    name = os.fspath(path).lower()
    for ending, other in OTHERS.items():
        if name.endswith(ending):
            raise UnknownFormatError(f"{path}: expected a recording; names that end in {ending} are for {other}")
    if Path(name).suffix not in FORMATS:
        known = ", ".join(FORMATS)
        raise UnknownFormatError(
            f"{path}: expected a name that ends in {known}, got {Path(name).suffix or 'no ending'!r}"
        )
    return FORMATS[Path(name).suffix]


def _listed(given: Mapping[str, object]) -> str:
    return ", ".join(f"{name}={value!r}" for name, value in given.items() if value is not None)
