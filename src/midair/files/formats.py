"""Which format a file name means, and the doors of the store: `open_take`, `load` and `save`."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from midair.errors import InputError, UnknownFormatError
from midair.files.atomic import existing_file, refusing
from midair.files.format_loss import FormatLoss
from midair.files.native import (
    ARRAY_SUFFIX,
    CALIBRATION_SUFFIX,
    DRIVE_SUFFIX,
    HDF5,
    load_solution,
    write_recording,
)
from midair.files.opened_take import Format, ImportOptions, OpenedTake
from midair.files.size_check import check_fits
from midair.lazy_frames import LazyFrames
from midair.model import Calibration, Event, PressureFrames, Recording, SensorGrid, Solution, Unit
from midair.recordings import Mending, suspicious
from midair.registry import Registry

FORMATS: Registry[Format] = Registry(
    "midair.formats",
    {
        ".h5": "midair.files.native:HDF5",
        ".hdf5": "midair.files.native:HDF5",
        ".csv": "midair.files.importers.csv_file:CSV",
        ".wav": "midair.files.importers.wav_file:WAV",
        ".npz": "midair.files.importers.npz_file:NPZ",
        ".mat": "midair.files.importers.mat_file:MAT",
        ".nc": "midair.files.native:NETCDF4",
        ".npy": "midair.files.importers.npy_file:NPY",
        ".w64": "midair.files.importers.wav_file:WAVE64",
        ".rf64": "midair.files.importers.wav_file:RF64",
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
"""Names that end like a recording's and mean something else."""


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
    """The recording in a file of any format that midair knows, or the solution in a ``.drive.h5``.

    The options state what a file of another program does not say; what contradicts the file is refused. `open_take`
    also returns the calibration and the journal, what was assumed and what looks wrong.

    Parameters
    ----------
    path : str or PathLike
        Its ending tells the format: .h5, .hdf5, .csv, .wav, .w64, .rf64, .npz, .npy, .mat, .nc, .flac, .aiff, .ogg,
        .mp3, .xdf, .tdms, .mcap; effects of .ahap and .hjif are rendered to waves.
    rate : float, optional
        Frames per second, in Hz.
    unit : {"V", "count", "Pa"}, optional
        Of the samples.
    sensor : SensorGrid, optional
        How the channels are laid out.
    scale : float, optional
        Pressure that 1 of the file's numbers means, in Pa: of full scale, of a volt, of 1 m/s2.
    channels : sequence of str, optional
        The ones to take, in this order, by name or by number from 0.
    stream : str, optional
        Which one to take of a file that holds several: a stream of XDF, a group of TDMS, a topic of MCAP, an array of
        NPZ or MAT.
    packed : int, optional
        How many channels stand one after another in a row of numbers, frame behind frame: the file's axes do not count,
        and its rate, if it says one, is that of its rows.
    mending : Mending, optional
        How to fill gaps, numbers that are NaN, infinite or (in text) missing; without it they are refused.

    Returns
    -------
    Recording or Solution
        With its provenance, or with the file's name as its source if the file has none; a Solution of a drive.

    Raises
    ------
    MissingFileError, BrokenFileError, UnknownFormatError
        If the file is not there, is damaged or of another kind, or its format is unknown.
    InputError
        Its leaf that says what is missing or cannot be used.
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
            raise InputError(f"{path}: expected nothing to be said about a drive, got {_said(given)}")
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
    """Recording, calibration and journal of a file together, and a sentence for each thing that was assumed.

    The only way in: what a file holds is told by what is in it, and its ending counts in any case.

    Parameters
    ----------
    path, rate, unit, sensor, scale, channels, stream, packed, mending
        As in `load`.
    streamed : bool
        Whether the samples are a reel where the format allows it (midair's own, WAV): read when somebody asks for them,
        so that a recording of any length takes the memory of a block. What looks wrong is then left to
        `midair.recordings.suspicious`.

    Returns
    -------
    OpenedTake
        Its report has one sentence for each thing that was assumed, changed, left out or looks wrong.

    Raises
    ------
    MissingFileError, BrokenFileError, UnknownFormatError, InputError
        As in `load`.
    """
    form = format_of(path)
    file = existing_file(path)
    if form.memory:
        advice = "cut it, or bring it as .h5 or WAV, which are read in parts"
        check_fits(form.memory * file.stat().st_size, f"{path}, a {form.name} file", advice)
    # Damaged numbers may overflow on the way; the recording refuses what is not finite.
    with refusing(file, f"a {form.name} file"), np.errstate(all="ignore"):
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
    # To look at all of a reel would be to read all of it.
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
    """Write a recording in the format that the ending of `path` tells, whole or not at all.

    Parameters
    ----------
    recording : Recording
        To write.
    path : str or PathLike
        Ends in .h5, .hdf5, .csv, .wav, .npz, .mat, .nc, .hjif or .ahap; replaced in one piece if it is there.
    calibration : Calibration, optional
        Of its sensor, to keep in the same file.
    pressure : PressureFrames, optional
        What was made of it, to keep in the same file.
    journal : sequence of Event
        What happened in it; only HDF5 of midair has a place for it.

    Returns
    -------
    tuple of Loss
        One for each thing that the format cannot hold; empty when nothing is lost.

    Raises
    ------
    UnknownFormatError
        If the ending is unknown.
    FileError
        If the file cannot be written.
    """
    form = format_of(path)
    if form.write is None:
        known = ", ".join(ending for ending, each in FORMATS.items() if each.write)
        raise UnknownFormatError(f"{path}: {form.name} is read, not written; what can be written is {known}")
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
    """The format that the ending of a file's name tells.

    Raises
    ------
    UnknownFormatError
        If it tells none, or something else than a recording.
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


def _said(given: Mapping[str, object]) -> str:
    return ", ".join(f"{name}={value!r}" for name, value in given.items() if value is not None)
