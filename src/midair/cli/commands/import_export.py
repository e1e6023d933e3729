"""Commands that make and change recordings: import, mend, export, repair."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

from midair.cli.terminal import (
    FileOptions,
    Force,
    Json,
    Time,
    as_recording,
    calibrated_by,
    calibration_figures,
    calibration_from_options,
    import_recording,
    may_write,
    out,
    print_rows,
    print_written,
    quantity,
    recording_figures,
    recording_rows,
    scale_by,
    write_recording,
)
from midair.datasets import SAMPLES, credited, sample, sample_path
from midair.errors import InputError
from midair.files import OpenedTake, format_of, load_pressure, open_take, repair
from midair.recordings import GapFill, Mending

Pressure = Annotated[float | None, quantity("Pa")]


def import_command(
    source: str,
    output: Path | None = None,
    /,
    *,
    options: FileOptions | None = None,
    sensitivity: str | None = None,
    peak: Pressure = None,
    reference: Path | None = None,
    tone: str = "94dB",
    drop: str | None = None,
    force: Force = False,
    json: Json = False,
) -> None:
    """Bring a file of any program into a recording, and say what was assumed.

    CSV, WAV (also Wave64 and RF64), FLAC, AIFF, Ogg, MP3, NPZ, NPY, MAT, NetCDF and HDF5 of midair, XDF, TDMS, MCAP;
    effects of .ahap and .hjif are rendered to waves. Without a calibration
    nobody knows the pressure: state the scale, the sensitivity, or the peak that the recording is to have. A recording
    of one channel becomes a field by --footprint circle:20mm --speed 50mm/s.

    Parameters
    ----------
    source
        The file; or what comes with midair: sample:brush, sample:sponge, sample:towel (synthetic strokes),
        sample:ridges (a real board of ridges, ten times as fast), sample:connect (an effect), sample:denim (a real
        fabric, too slow to be felt).
    output
        The recording; the source's name with .h5 in this folder if not given.
    options
        What the file does not say.
    sensitivity
        Output of every channel per pressure, such as 20mV/Pa or 2count/Pa.
    peak
        The largest change of any channel is to mean this pressure, such as 30Pa.
    reference
        In place of a scale: a take of the same microphone at the same gain, of something known.
    tone
        What is known: the level of a tone in it, such as a calibrator's.
    drop
        Or a weight that drops on the skin over the microphone: mass, height, diameter that it hits, as 2g:50mm:10mm.
    json
        Print JSON for a program.

    Examples
    --------
    $ midair import sample:towel
    $ midair import sample:ridges
    $ midair import sample:denim --peak 30Pa
    $ midair import towel.wav --scale 30Pa --footprint circle:20mm --speed 50mm/s
    $ midair import towel.wav pa.h5 --reference tone.wav --tone 94dB
    """
    options, notes = options or FileOptions(), ()
    if reference is not None:
        if options.scale is not None or sensitivity is not None or peak is not None:
            raise InputError("--reference: expected it alone, got --scale, --sensitivity or --peak beside it")
        found = scale_by(reference, options, tone, drop)
        options, notes = replace(options, scale=found.scale), (f"{reference.name}: {found.words}",)
    _take_in(source, output, options, sensitivity, peak, notes=notes, force=force, json=json)


def mend_command(
    source: str,
    output: Path | None = None,
    /,
    *,
    options: FileOptions | None = None,
    longest: Time = 20e-3,
    fill: GapFill = "spectrum",
    sensitivity: str | None = None,
    peak: Pressure = None,
    force: Force = False,
    json: Json = False,
) -> None:
    """Bring a file with gaps into a recording: NaN, infinite or empty numbers are filled, and the recording says where.

    As midair import, which refuses them. Every gap stands in the journal and in the provenance of the recording.

    Parameters
    ----------
    source
        The file of another program.
    output
        The recording; the source's name with .h5 in this folder if not given.
    options
        What the file does not say.
    longest
        Gap that is filled; one that is longer is refused.
    fill
        spectrum goes on as the neighbourhood vibrates, line leaves out what vibrates.
    sensitivity
        Output of every channel per pressure, such as 20mV/Pa or 2count/Pa.
    peak
        The largest change of any channel is to mean this pressure, such as 30Pa.
    json
        Print JSON for a program.

    Examples
    --------
    $ midair mend gaps.csv --unit V
    """
    mending = Mending(longest=longest, fill=fill)
    _take_in(source, output, options or FileOptions(), sensitivity, peak, mending, force=force, json=json)


def _take_in(
    source: str,
    output: Path | None,
    options: FileOptions,
    sensitivity: str | None,
    peak: float | None,
    mending: Mending | None = None,
    *,
    notes: tuple[str, ...] = (),
    force: bool,
    json: bool,
) -> None:
    name = source.removeprefix("sample:") if source.startswith("sample:") else ""
    ready = name in SAMPLES and SAMPLES[name].ready
    if ready:
        if options != FileOptions() or mending is not None:
            raise InputError(f"{source}: expected no options of files, since it comes as it is felt; leave them out")
        file = Path(name)
    else:
        file = sample_path(name) if source.startswith("sample:") else Path(source)
    target = output or Path(file.with_suffix(".h5").name)
    may_write(target, force)
    imported = (
        OpenedTake(recording=sample(name)) if ready else import_recording(file, options, streamed=True, mending=mending)
    )
    if name in SAMPLES:
        imported, notes = _credited(name, imported), (*notes, *_known_of(name))
    calibration = imported.calibration
    stated = calibration_from_options(imported.recording, sensitivity, peak)
    pressure = load_pressure(file, streamed=True) if imported.stored and stated is None else None
    lost = write_recording(
        imported.recording, target, calibration=stated or calibration, pressure=pressure, journal=imported.journal
    )
    rows = [("recording", str(target)), *recording_rows(imported.recording)]
    if imported.recording.unit != "Pa" or stated or calibration:
        rows.append(("calibration", calibrated_by(stated or calibration)))
    figures = {
        "recording": str(target),
        **recording_figures(imported.recording),
        "calibration": calibration_figures(stated or calibration),
    }
    print_written(
        rows, figures, (*notes, *imported.report), lost, simulated=imported.recording.provenance.simulated, json=json
    )


def _credited(name: str, taken: OpenedTake) -> OpenedTake:
    return replace(taken, recording=credited(name, taken.recording))


def _known_of(name: str) -> tuple[str, ...]:
    """What should be known of a sample, a line each."""
    about = SAMPLES[name]
    return (
        f"licence: {about.licence}",
        f"origin: {about.source}",
        *(f"{key}: {it}" for key, it in about.notes.items()),
    )


def export_command(
    source: Path, output: Path, /, *, pressure: bool = False, force: Force = False, json: Json = False
) -> None:
    """Write a recording to the format that the output's name says, and say what that format cannot hold.

    Parameters
    ----------
    source
        A recording.
    output
        NAME.csv, .wav, .npz, .mat, .nc (NetCDF), .hjif (MPEG haptics), .ahap (Apple) or .h5.
    pressure
        Write the calibrated pressure instead of what the sensor said.
    json
        Print JSON for a program.

    Examples
    --------
    $ midair export take.h5 take.csv
    """
    may_write(output, force)
    take = open_take(source, streamed=True)
    recording, calibration = take.recording, take.calibration
    made = load_pressure(source, streamed=True) if take.stored else None
    if pressure:
        if made is None:
            raise InputError(f"{source}: expected calibrated pressure in it, got none; run midair calibrate first")
        recording, calibration, made = as_recording(made), None, None
    lost = write_recording(recording, output, calibration=calibration, pressure=made)
    rows = [("written", str(output)), ("format", format_of(output).name)]
    print_written(
        rows,
        {"written": str(output), "format": format_of(output).name},
        (),
        lost,
        simulated=recording.provenance.simulated,
        json=json,
    )


def repair_command(source: Path, /) -> None:
    """Close a recording whose program was killed, so that any program can open it.

    A recording that still runs is refused.

    Parameters
    ----------
    source
        NAME.h5; it is replaced in one piece.

    Examples
    --------
    $ midair repair take.h5
    """
    found = repair(source)
    print_rows([("recording", str(source)), ("state", "was closed in order" if not found else "repaired")])
    for sentence in found:
        out().print(f"note: {sentence}")
