"""Commands that make and change recordings: record, import, export, calibrate, repair."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter

from midair.calibrate import calibrate
from midair.cli.app import app
from midair.cli.info import calibrated_by, recording_rows
from midair.cli.options import BandOptions
from midair.cli.quantity import parse_quantity, quantity
from midair.cli.show import banner, out, print_rows, stages
from midair.datasets import sample_path
from midair.errors import InputError, MismatchError
from midair.model import Calibration, Provenance, Recording, Unit
from midair.rig.capture import record
from midair.rig.names import sensor_named
from midair.rig.virtual import VirtualRig
from midair.store import load, load_calibration, read, repair, save, save_pressure

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
    print_rows([("recording", str(output)), *recording_rows(recording)])


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
    print_rows(
        [("recording", str(target)), *recording_rows(imported.recording), ("calibration", calibrated_by(calibration))]
    )
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
            ("calibration", calibrated_by(known)),
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
