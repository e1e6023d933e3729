"""Commands that convert and repair recordings: import, export, repair."""

from dataclasses import replace
from json import dumps
from pathlib import Path
from typing import Any

import numpy as np

from midair import files
from midair.cli.console import out, print_rows
from midair.cli.import_options import (
    ChannelNumbers,
    FileOptions,
    ask_missing,
    calibration_from_options,
    channel_numbers,
)
from midair.cli.options import Force, Json, OptionalTime, Peak, Sensitivity, Source, given
from midair.cli.output import as_recording, calibration_row, may_write, next_row, print_table, recording_text
from midair.datasets import SAMPLES, sample, sample_path, with_credits
from midair.errors import InputError
from midair.recordings import GapFill, Mending, select
from midair.table import Details, Line, Row, describe


def import_command(
    source: str,
    output: Path | None = None,
    /,
    *,
    options: FileOptions | None = None,
    sensitivity: Sensitivity = None,
    peak: Peak = None,
    mend: OptionalTime = None,
    fill: GapFill = "spectrum",
    force: Force = False,
    json: Json = False,
) -> None:
    """Convert a file of another program to a recording.

    Reads CSV and other text (.tsv, .txt, .lvm), NPZ, NPY, MAT, XDF, TDMS, XML of HaTT, and HDF5 files of midair.
    Reads WAV (also RF64), FLAC, AIFF, Ogg and MP3, and renders effects from .ahap and .haptic.
    To get pressure without a calibration, give --felt, --scale, --sensitivity or --peak.
    A single channel becomes a field with --footprint circle:20mm --speed 50mm/s.
    The command prints all assumptions that it made. On a terminal it asks for the facts that the file does not state.

    Parameters
    ----------
    source
        File to read, or one of these samples:
        sample:brush, sample:sponge, sample:towel: synthetic strokes.
        sample:ridges: a real board of ridges, ten times as fast.
        sample:denim: a real fabric, too slow to be felt.
        sample:connect: an effect.
    output
        Recording to write. [default: name of the source with .h5, in this folder]
    mend
        Fill gaps (NaN, infinite or empty values) up to this length, such as 20ms. The recording stores each gap in its
        journal and provenance. [default: a file with gaps is refused]
    fill
        How --mend fills: spectrum continues the vibration around the gap; line interpolates without vibration.

    Examples
    --------
    $ midair import sample:towel
    $ midair import sample:denim --peak 30Pa
    $ midair import towel.wav --felt medium --footprint circle:20mm --speed 50mm/s
    $ midair import gaps.csv --unit V --mend 20ms
    """
    options = options or FileOptions()
    ways: dict[str, object] = {f"--{name}": getattr(options, name) for name in ("scale", "unit")}
    ways |= {"--sensitivity": sensitivity, "--peak": peak}
    stated = [name for name, value in ways.items() if value is not None]
    if options.felt is not None and stated:
        raise InputError(f"--felt: expected it without {' and '.join(stated)}; give only one")
    mending = None if mend is None else Mending(longest=mend, fill=fill)
    name = source.removeprefix("sample:") if source.startswith("sample:") else ""
    ready = name in SAMPLES and SAMPLES[name].ready
    if ready:
        if named := given(options) or "--mend" * (mending is not None):
            raise InputError(f"{named}: only for other files; {source} states all of it; leave it out")
        file = Path(name)
    else:
        file = sample_path(name) if source.startswith("sample:") else Path(source)
    target = output or Path(file.with_suffix(".h5").name)
    if output is None and target.exists() and file.resolve() == target.resolve():
        raise InputError(f"{file}: is a file of midair already; name the result to write another one")
    may_write(target, force)
    asked = {"ask": not json, "counts": peak is not None}
    imported = files.OpenedTake(recording=sample(name)) if ready else ask_missing(file, options, mending, **asked)
    credits: list[Line] = []
    if name in SAMPLES:
        imported = replace(imported, recording=with_credits(name, imported.recording))
        about = SAMPLES[name]
        more = [Row(key, text) for key, text in {"origin": about.source, **about.notes}.items()]
        credits = [Row("licence", about.licence), Details(more)]
    recording = imported.recording
    stated = calibration_from_options(recording, sensitivity, peak)
    known = stated or imported.calibration
    pressure = files.load_pressure(file) if imported.stored and stated is None else None
    lost = files.save(recording, target, calibration=known, pressure=pressure, journal=imported.journal, force=True)
    stated_by = calibration_row(known, target, hidden=recording.unit == "Pa" and not known)
    ready = recording.unit == "Pa" or known is not None
    then = [next_row("solve", target)] if ready else []
    file_row = Row("file", str(target), key="recording")
    table: list[Line] = [file_row, *describe(recording), *credits, stated_by, *then]
    notes = imported.report
    if recording.duration < 0.02:  # one period of the lowest frequency of the modes, in s
        notes = (*notes, f"It lasts {1e3 * recording.duration:.3g} ms: too short to be felt; is the file complete?")
    how: Any = {"notes": notes, "lost": lost, "simulated": recording.provenance.simulated}
    print_table(table, answer=recording_text(recording), json=json, **how)


def export_command(
    source: Source,
    output: Path,
    /,
    *,
    pressure: bool = False,
    channels: ChannelNumbers = (),
    force: Force = False,
    json: Json = False,
) -> None:
    """Convert a recording or a drive to another file format.

    The ending of the output selects the format; the command prints which data the format cannot hold.

    Parameters
    ----------
    output
        File to write: NAME.csv, .wav, .flac (at most 8 channels), .npz, .mat or .h5.
        For a drive NAME.npz or NAME.json: phase in rad and level of every transducer in every frame.
    pressure
        Write the calibrated pressure instead of the raw samples.
    channels
        Write only these channels, as one row of cells: numbers from 0, separated by commas.

    Examples
    --------
    $ midair export take.h5 take.csv
    $ midair export take.rerecorded.h5 felt.flac --channels 5,6
    $ midair export take.drive.h5 take.npz
    """
    if source.name.lower().endswith(files.DRIVE_SUFFIX):
        return _export_drive(source, output, force=force, json=json)
    files.writer_of(output)
    may_write(output, force)
    take = files.open_take(source)
    recording, calibration = take.recording, take.calibration
    made = files.load_pressure(source) if take.stored else None
    if pressure:
        if made is None:
            raise InputError(f"{source}: expected calibrated pressure in it, got none; run midair calibrate first")
        recording, calibration, made = as_recording(made), None, None
    notes = ()
    if channels:
        recording = select(recording, channel_numbers(channels, recording))
        calibration, made, notes = None, None, ("Calibration and places of the chosen channels were left out.",)
    lost = files.save(recording, output, calibration=calibration, pressure=made, force=True)
    table = [Row("written", str(output)), Row("format", files.format_of(output).name)]
    how: Any = {"notes": notes, "lost": lost, "simulated": recording.provenance.simulated, "json": json}
    return print_table(table, answer=recording_text(recording), **how)


def _export_drive(source: Path, output: Path, *, force: bool, json: bool) -> None:
    """Write phases and levels of a drive for other programs, in SI units."""
    may_write(output, force, ".npz", ".json")
    drive = files.load_solution(source, streamed=True).drive
    text = output.suffix.lower() == ".json"
    files.check_memory_for(
        (80 if text else 32) * drive.frames * drive.array.count, f"{source}, as {output.suffix}", "cut it"
    )
    plain: dict[str, Any] = {
        "simulated": drive.provenance.simulated,
        "source": drive.provenance.source,
        "rate_hz": drive.rate,
        "array": drive.array.name,
        "position_m": np.asarray(drive.array.position),
        "normal": np.asarray(drive.array.normal),
        "phase_rad": np.round(np.asarray(drive.phase), 4),
        "level": np.round(np.asarray(drive.level), 4),
    }
    if text:
        files.write_file(output, dumps(plain, default=np.ndarray.tolist))
    else:
        with files.atomic_file(output) as partial, partial.open("wb") as file:
            np.savez_compressed(file, **plain)
    frames = f"{drive.frames} frames at {drive.rate:g} Hz, {drive.array.count} transducers"
    table = [Row("written", str(output)), Row("frames", frames, text="")]
    print_table(table, answer=frames, notes=(), simulated=drive.provenance.simulated, json=json)


def repair_command(source: Path, /) -> None:
    """Convert an interrupted recording to HDF5; any command that reads it does the same.

    The whole file is read, so that damage is found. A recording that is still in progress is refused.

    Parameters
    ----------
    source
        Recording, NAME.h5; the file is replaced atomically.

    Examples
    --------
    $ midair repair take.h5
    """
    found = files.repair(source)
    print_rows([("recording", str(source)), ("state", "no repair needed" if not found else "repaired")])
    for sentence in found:
        out().print(f"note: {sentence}")
