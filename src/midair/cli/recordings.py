"""Commands about recordings: record, import, export, info, calibrate."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter

from midair.calibrate import calibrate, dead_channels
from midair.cli.app import app
from midair.cli.options import BandOptions
from midair.cli.quantity import parse_quantity, quantity, spell
from midair.cli.show import banner, out, print_json, print_rows, stages
from midair.datasets import sample_path
from midair.errors import InputError, MismatchError
from midair.model import Calibration, Provenance, Recording, Setting, Unit
from midair.rig.capture import record
from midair.rig.names import sensor_named
from midair.rig.virtual import VirtualRig
from midair.store import (
    contents,
    load,
    load_calibration,
    load_pressure,
    load_solution,
    read,
    repair,
    save,
    save_pressure,
)

Pressure = Annotated[float | None, quantity("Pa")]


@app.command(name="record")
def record_command(
    sensor: str,
    output: Path,
    /,
    *,
    duration: Annotated[float | None, quantity("s")] = None,
    object_name: Annotated[str | None, Parameter(name="--object")] = None,
    operator: str | None = None,
    seed: int = 0,
) -> None:
    """Record a sensor into a file, which is written as the frames come.

    Parameters
    ----------
    sensor
        virtual:towel (or brush, sponge; +groove for the grooved surface), virtual:am-i, am-ii, am-iii (the modulated
        foci of the paper's section 5.2), or replay:FILE.
    output
        The recording, NAME.h5.
    duration
        How long; the whole stroke or file if not given.
    object_name
        What is touched, for the notes.
    operator
        Who records, for the notes.
    seed
        Of a virtual sensor's noise and texture.
    """
    device = sensor_named(sensor, VirtualRig(seed=seed), duration=duration)
    notes = {key: value for key, value in (("object", object_name), ("operator", operator)) if value}
    notes = notes if "object" in notes else {"object": sensor.partition(":")[2], **notes}
    length = duration or (1.28 if "am-" not in sensor else 0.5)
    if sensor.startswith("replay:") and duration is None:
        length = load(sensor.partition(":")[2]).duration
    banner(device.simulated)
    with stages() as stage, device:
        recording = record(device, length, path=output, notes=notes, progress=stage("record"))
    print_rows([("recording", str(output)), *_rows(recording)])


@app.command(name="import")
def import_command(
    source: str,
    output: Path | None = None,
    /,
    *,
    rate: Annotated[float | None, quantity("Hz")] = None,
    unit: Unit | None = None,
    sensitivity: str | None = None,
    peak: Pressure = None,
    force: bool = False,
) -> None:
    """Bring a CSV, WAV, NPZ, MAT or HDF5 file into a recording, and say what was assumed.

    Without a calibration nobody knows the pressure: state the sensitivity, or the peak that the recording is to have.

    Parameters
    ----------
    source
        The file; or sample:denim, a recording of a fabric that comes with midair.
    output
        The recording; the source's name with .h5 in this folder if not given.
    rate
        Frames per second, where the file does not say.
    unit
        Of the samples, where the file does not say.
    sensitivity
        Output of every channel per pressure, such as 20mV/Pa or 2count/Pa.
    peak
        The largest change of any channel is to mean this pressure, such as 30Pa.
    force
        Write over a file that is there.
    """
    file = sample_path(source.removeprefix("sample:")) if source.startswith("sample:") else Path(source)
    target = output or Path(file.with_suffix(".h5").name)
    may_write(target, force)
    imported = read(file, rate=rate, unit=unit)
    calibration = load_calibration(file) if file.suffix == ".h5" else None
    calibration = _nominal(imported.recording, sensitivity, peak) or calibration
    save(imported.recording, target, calibration=calibration)
    print_rows([("recording", str(target)), *_rows(imported.recording), ("calibration", _calibrated_by(calibration))])
    for sentence in imported.report:
        out().print(f"note: {sentence}", markup=False)


@app.command(name="export")
def export_command(source: Path, output: Path, /, *, force: bool = False) -> None:
    """Write a recording to the format that the output's name says, and say what that format cannot hold.

    Parameters
    ----------
    source
        A recording.
    output
        NAME.csv, .wav, .npz, .mat or .h5.
    force
        Write over a file that is there.
    """
    may_write(output, force)
    lost = save(load(source), output)
    print_rows([("written", str(output))])
    for sentence in lost:
        out().print(f"lost: {sentence}", markup=False)


@app.command(name="info")
def info_command(source: Path, /, *, json: bool = False) -> None:
    """Say what a recording, a drive or a calibration holds, where it came from, and what was done to it.

    Parameters
    ----------
    source
        NAME.h5, NAME.drive.h5, NAME.calibration.h5, or any recording that can be imported.
    json
        Print JSON for a program.
    """
    rows, provenance = _rows_of_file(source)
    if json:
        steps = [{"stage": step.stage, **step.settings} for step in provenance.steps]
        return print_json({**dict(rows), "simulated": provenance.simulated, "steps": steps})
    banner(provenance.simulated)
    print_rows([*rows, *((f"step: {step.stage}", _settings(step.settings)) for step in provenance.steps)])
    return None


@app.command(name="calibrate")
def calibrate_command(
    source: Path,
    /,
    *,
    options: BandOptions | None = None,
    sensitivity: str | None = None,
    peak: Pressure = None,
    calibration: Path | None = None,
) -> None:
    """Turn a recording into pressure, and keep the calibration and the pressure in its file.

    Parameters
    ----------
    source
        A recording, NAME.h5.
    options
        The band.
    sensitivity
        Output of every channel per pressure, such as 20mV/Pa or 2count/Pa.
    peak
        The largest change of any channel is to mean this pressure, such as 30Pa.
    calibration
        NAME.calibration.h5, or a recording that has the right one.
    """
    options = options or BandOptions()
    recording = load(source)
    known = _nominal(recording, sensitivity, peak)
    known = known or (load_calibration(calibration) if calibration else load_calibration(source))
    pressure = calibrate(recording, known, band=options.band, method=options.inverse)
    if known is not None:
        save(recording, source, calibration=known)
    save_pressure(pressure, source)
    banner(recording.provenance.simulated)
    largest = np.abs(pressure.pressure).max()
    print_rows(
        [
            ("recording", str(source)),
            ("calibration", _calibrated_by(known)),
            ("band", f"{options.band[0]:g} to {options.band[1]:g} Hz"),
            ("largest pressure", f"{largest:.3g} Pa"),
            ("rms of the strongest cell", f"{np.sqrt((pressure.pressure**2).mean(axis=0)).max():.3g} Pa"),
        ]
    )


@app.command(name="repair")
def repair_command(source: Path, /) -> None:
    """Close a recording whose program was killed, so that any program can open it.

    Do not use it on a recording that still runs.

    Parameters
    ----------
    source
        NAME.h5; it is replaced in one piece.
    """
    found = repair(source)
    print_rows([("recording", str(source)), ("state", "was closed in order" if not found else "repaired")])
    for sentence in found:
        out().print(f"note: {sentence}", markup=False)


def may_write(path: Path, force: bool) -> None:
    """Refuse to write over a file unless told to."""
    if path.exists() and not force:
        raise InputError(f"{path}: is there already; give another name, or --force to write over it")


def _nominal(recording: Recording, sensitivity: str | None, peak: float | None) -> Calibration | None:
    """The calibration that a stated sensitivity or peak means, if one was stated."""
    if sensitivity is not None and peak is not None:
        raise MismatchError("expected --sensitivity or --peak, got both; state one")
    if sensitivity is not None:
        try:
            value = parse_quantity(sensitivity, f"{recording.unit}/Pa")
        except ValueError as wrong:
            raise InputError(f"--sensitivity: {wrong}") from None
        return Calibration.flat(recording.sensor, sensitivity=value, unit=recording.unit)
    if peak is None:
        return None
    change = np.abs(recording.samples - np.median(recording.samples, axis=0)).max()
    if change == 0 or peak <= 0:
        raise InputError(
            f"--peak: expected a pressure above 0 and a recording that changes, got {peak:g} Pa, {change:g}"
        )
    flat = Calibration.flat(recording.sensor, sensitivity=float(change / peak), unit=recording.unit)
    stated = f"stated: the largest change of any channel, {change:.4g} {recording.unit}, is {peak:g} Pa"
    return replace(flat, provenance=Provenance(source=stated))


def _rows(recording: Recording) -> list[tuple[str, str]]:
    rows, columns = recording.sensor.shape
    dead = np.flatnonzero(dead_channels(recording))
    return [
        ("frames", f"{recording.frames} at {recording.rate:.6g} Hz, {recording.duration:.3f} s"),
        ("sensor", f"{recording.sensor.name}, {rows} x {columns}, pitch {spell(recording.sensor.pitch, 'm')}"),
        ("unit", recording.unit),
        ("range", f"{recording.samples.min():.4g} to {recording.samples.max():.4g} {recording.unit}"),
        ("dead channels", ", ".join(str(channel) for channel in dead) or "none"),
    ]


def _rows_of_file(source: Path) -> tuple[list[tuple[str, str]], Provenance]:
    """What a file of any kind holds, and its life."""
    if source.suffix not in (".h5", ".hdf5"):
        return _recording_rows(source, stored=False)
    held = contents(source)
    readers = {"drive": _drive_rows, "calibration": _calibration_rows}
    rows, provenance = readers.get(held.kind, _recording_rows)(source)
    rows.append(
        ("written", f"{held.created} by {held.created_by}" + ("" if held.finished else ", not closed in order"))
    )
    return rows, provenance


def _calibration_rows(source: Path) -> tuple[list[tuple[str, str]], Provenance]:
    calibration = load_calibration(source)
    if calibration is None:
        return [("calibration", "none")], Provenance()
    frequency = calibration.frequency
    rows = [
        ("calibration", _calibrated_by(calibration)),
        ("sensor", calibration.sensor.name),
        ("frequencies", f"{len(frequency)} from {frequency[0]:g} to {frequency[-1]:g} Hz"),
        ("unit", f"{calibration.unit}/Pa"),
    ]
    return rows, calibration.provenance


def _recording_rows(source: Path, *, stored: bool = True) -> tuple[list[tuple[str, str]], Provenance]:
    recording = load(source)
    calibration = load_calibration(source) if stored else None
    pressure = load_pressure(source) if stored else None
    rows = [("recording", str(source)), ("source", recording.provenance.source), *_rows(recording)]
    rows.append(("calibration", _calibrated_by(calibration)))
    if pressure is not None:
        rows.append(("largest pressure", f"{np.abs(pressure.pressure).max():.3g} Pa"))
    rows += [(f"note: {name}", text) for name, text in recording.provenance.notes.items()]
    return rows, recording.provenance


def _drive_rows(source: Path) -> tuple[list[tuple[str, str]], Provenance]:
    solution = load_solution(source)
    drive = solution.drive
    plays = np.array([status != "silent" for status in solution.status])
    error = 100 * solution.error[plays]
    rows = [
        ("drive", str(source)),
        ("source", drive.provenance.source),
        (
            "frames",
            f"{drive.frames} at {drive.rate:g} Hz, {drive.frames / drive.rate:.3f} s, {int((~plays).sum())} silent",
        ),
        ("array", f"{drive.array.name}, {drive.array.count} transducers"),
        ("level", f"{drive.level.min():g} to {drive.level.max():g}"),
        ("E", f"mean {error.mean():.1f} %, worst {error.max():.1f} %" if plays.any() else "nothing plays"),
        *((f"note: {name}", text) for name, text in drive.provenance.notes.items()),
    ]
    return rows, drive.provenance


def _calibrated_by(calibration: Calibration | None) -> str:
    if calibration is None:
        return "none; state one with midair calibrate --sensitivity or --peak"
    return " ".join(part for part in (calibration.provenance.source, calibration.date) if part)


def _settings(settings: Mapping[str, Setting]) -> str:
    return ", ".join(f"{name} {value}" for name, value in settings.items())
