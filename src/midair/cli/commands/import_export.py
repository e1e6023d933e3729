"""Commands that make and change recordings: import, mend, export, repair."""

from pathlib import Path
from typing import Annotated

from midair.cli.terminal import (
    FileOptions,
    Force,
    Json,
    Time,
    as_recording,
    bring,
    calibrated_by,
    calibration_figures,
    keep,
    may_write,
    nominal_calibration,
    out,
    print_rows,
    quantity,
    recording_figures,
    recording_rows,
    say_kept,
)
from midair.datasets import sample_path
from midair.errors import InputError
from midair.files import format_of, load_pressure, open_take, repair
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
    force: Force = False,
    json: Json = False,
) -> None:
    """Bring a file of any program into a recording, and say what was assumed.

    CSV, WAV (also Wave64 and RF64), NPZ, NPY, MAT, NetCDF and HDF5 of midair, XDF, TDMS, MCAP. Without a calibration
    nobody knows the pressure: state the scale, the sensitivity, or the peak that the recording is to have. A recording
    of one channel becomes a field by --footprint circle:20mm --speed 50mm/s.

    Parameters
    ----------
    source
        The file; or sample:denim, a recording of a fabric that comes with midair.
    output
        The recording; the source's name with .h5 in this folder if not given.
    options
        What the file does not say.
    sensitivity
        Output of every channel per pressure, such as 20mV/Pa or 2count/Pa.
    peak
        The largest change of any channel is to mean this pressure, such as 30Pa.
    json
        Print JSON for a program.

    Examples
    --------
    $ midair import sample:denim --peak 30Pa
    $ midair import towel.wav --scale 30Pa --footprint circle:20mm --speed 50mm/s
    """
    _take_in(source, output, options or FileOptions(), sensitivity, peak, force=force, json=json)


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
    force: bool,
    json: bool,
) -> None:
    file = sample_path(source.removeprefix("sample:")) if source.startswith("sample:") else Path(source)
    target = output or Path(file.with_suffix(".h5").name)
    may_write(target, force)
    imported = bring(file, options, streamed=True, mending=mending)
    calibration = imported.calibration
    stated = nominal_calibration(imported.recording, sensitivity, peak)
    pressure = load_pressure(file, streamed=True) if imported.stored and stated is None else None
    lost = keep(
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
    say_kept(rows, figures, imported.report, lost, simulated=imported.recording.provenance.simulated, json=json)


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
    lost = keep(recording, output, calibration=calibration, pressure=made)
    rows = [("written", str(output)), ("format", format_of(output).name)]
    say_kept(
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
