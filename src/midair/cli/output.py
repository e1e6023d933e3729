"""Output of the commands: writing recordings, rows and JSON values of recordings, calibrations and drives."""

from __future__ import annotations

from collections.abc import Generator, Iterable, Mapping
from contextlib import ExitStack, contextmanager, suppress
from functools import singledispatch
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

from midair import files
from midair.cli.console import banner, out, print_json, print_note, print_rows
from midair.cli.options import format_quantity
from midair.errors import InputError
from midair.evaluate import SolveError, error_by_energy
from midair.headroom import PressureLevel, band_of, level_of
from midair.model import (
    AmplitudeFrames,
    ArrayCalibration,
    Calibration,
    PressureFrames,
    Provenance,
    Recording,
    SensorGrid,
    Setting,
    Solution,
)
from midair.recordings import dead_channels
from midair.streaming import blocks
from midair.table import Line, Row, plain, printed
from midair.targets import frames_without_lead


def as_recording(pressure: PressureFrames) -> Recording:
    """Calibrated pressure as a recording in Pa."""
    return Recording(
        samples=pressure.pressure, rate=pressure.rate, sensor=pressure.sensor, unit="Pa", provenance=pressure.provenance
    )


def print_table(
    table: Iterable[Line],
    *,
    json: bool,
    simulated: bool | None = None,
    notes: Iterable[str] | None = None,
    lost: Iterable[files.FormatLoss] = (),
) -> None:
    """Print a table, or its values as JSON; `notes` and `lost`, if given, and `simulated` unless it is None."""
    if json:
        values = plain(table)
        if simulated is not None:
            values["simulated"] = simulated
        if notes is not None:
            values["notes"], values["lost"] = list(notes), [{"what": loss.what, "text": loss.text} for loss in lost]
        return print_json(values)
    banner(bool(simulated))
    print_rows(printed(table))
    for line in (*(f"note: {note}" for note in notes or ()), *(f"lost: {loss}" for loss in lost)):
        out().print(line)
    return None


def may_write(path: Path, force: bool, *endings: str) -> None:
    """Refuse an output before the work: wrong ending, missing folder, existing file, recording in progress."""
    if endings and not path.name.lower().endswith(endings):
        raise InputError(f"{path}: expected a name that ends in {' or '.join(endings)}")
    files.writable_path(path)
    if path.exists() and not force:
        raise InputError(f"{path}: already exists; give another name, or --force to overwrite it")
    files.check_not_recording(path)


def parameter_values(given: Iterable[str]) -> dict[str, float]:
    """Values of named parameters, typed as NAME=NUMBER."""
    values: dict[str, float] = {}
    for text in given:
        name, _, number = text.partition("=")
        try:
            values[name] = float(number)
        except ValueError:
            raise InputError(f"--parameter: expected NAME=NUMBER such as size=20, got {text!r}") from None
    return values


@contextmanager
def reserved(path: Path) -> Generator[None]:
    """Reserve an output for this program; a second one that computes it is refused before its work."""
    from midair.devices import state_folder

    folder = state_folder()
    lock = folder / f"writing-{sha256(str(path.resolve()).encode()).hexdigest()[:16]}.lock"
    with ExitStack() as held:
        with suppress(OSError):
            folder.mkdir(parents=True, exist_ok=True)
            handle = held.enter_context(lock.open("w"))
            files.lock_or_raise(
                handle.fileno(), f"{path}: another program computes this file; wait for it, or name another"
            )
            held.callback(lock.unlink, missing_ok=True)
        yield


def describe_strokes(provenance: Provenance, rate: float) -> list[Line]:
    """First frame, frames, duration and speed (m/s, None if unknown) of each stroke of a recording."""
    steps: dict[str, Mapping[str, Setting]] = {step.stage: step.settings for step in provenance.steps}
    frames: Any = steps.get("events", {}).get("strokes", ())
    speeds: Any = steps.get("stage", {}).get("speed_m_s", ())
    lines: list[Line] = []
    strokes: list[dict[str, Any]] = []
    for (first, count), speed in zip(frames, speeds, strict=False):
        strokes.append({"first_frame": first, "frames": count, "seconds": count / rate, "speed_m_s": speed})
        text = "speed unknown" if speed is None else f"{1e3 * speed:.2f} mm/s in its middle"
        lines.append(("stroke", f"frames {first} to {first + count}, {count / rate:.3f} s, {text}"))
    return [*lines, {"strokes": strokes}]


@singledispatch
def describe(thing: Any) -> list[Line]:
    """The table of a recording or of a calibration of an array."""
    raise TypeError(type(thing))


@describe.register
def _(recording: Recording) -> list[Line]:
    sensor, silent = recording.sensor, np.flatnonzero(dead_channels(recording)).tolist()
    low, high, unit = float(recording.samples.min()), float(recording.samples.max()), recording.unit
    # Constant cells of a synthetic field are not broken but untouched.
    synthetic = any(step.stage == "footprint" for step in recording.provenance.steps)
    channels = ", ".join(map(str, silent)) or "none"
    about = {"name": sensor.name, "rows": sensor.rows, "columns": sensor.columns, "pitch_m": sensor.pitch}
    frames = f"{recording.frames} at {recording.rate:.6g} Hz, {recording.duration:.3f} s"
    return [
        Row("frames", recording.frames, text=frames),
        {"rate_hz": recording.rate, "duration_s": recording.duration},
        Row("sensor", about, text=sensor_text(sensor)),
        Row("unit", unit),
        Row("range", [low, high], text=f"{low:.4g} to {high:.4g} {unit}"),
        Row("dead channels", [] if synthetic else silent, key="dead_channels", text="" if synthetic else channels),
        *([Row("untouched cells", silent, key="untouched_cells", text=channels)] if synthetic else []),
    ]


def sensor_text(sensor: SensorGrid) -> str:
    """Name, rows, columns and pitch of a sensor."""
    return f"{sensor.name}, {sensor.rows} x {sensor.columns}, pitch {format_quantity(sensor.pitch, 'm')}"


def calibration_row(calibration: Calibration | None, *, hidden: bool = False) -> Row:
    """Identity of a calibration, or advice without one; `hidden` rows are in JSON only."""
    if calibration is None:
        advice = "none; state one with midair calibrate --sensitivity or --peak"
        return Row("calibration", None, text="" if hidden else advice)
    source, date = calibration.provenance.source, calibration.date
    known = {"source": source, "id": calibration.identifier, "version": calibration.version, "date": date or None}
    return Row("calibration", known, text="" if hidden else " ".join(part for part in (source, date) if part))


def level_of_file(source: Path, *, limits: bool = True) -> PressureLevel | None:
    """Pressure level of the drive in a file, as `level_of`; None if the file has no target."""
    target = files.load_target(source, streamed=True)
    if target is None:
        return None
    return level_of(files.load_solution(source, streamed=True), target, band=band_of(target), limits=limits)


def solve_error(solution: Solution, target: AmplitudeFrames) -> SolveError:
    """Error of a solution without its lead, whose target is almost zero."""
    inside = frames_without_lead(target.provenance, target.frames, target.rate)
    power = np.concatenate([(block**2).sum(axis=1) for block in blocks(target.amplitude)])
    return error_by_energy(solution.error[inside], (power * solution.plays)[inside])


def level_rows(level: PressureLevel | None) -> list[tuple[str, str]]:
    """Pressure level as rows; prints a warning on stderr if the request is too high."""
    if level is None:
        return [("level", "unknown: the file has no target")]
    warn_level(level)
    return level.rows()


def warn_level(level: PressureLevel) -> None:
    """Print a warning and advice if the drive requests more pressure than the array can produce."""
    if level.too_loud:
        print_note(level.advice(), warn=True)


@describe.register
def _(known: ArrayCalibration) -> list[Line]:
    """With expanded uncertainties (k = 2)."""
    alive = ~known.dead

    def of(values: np.ndarray, errors: np.ndarray, unit: str, digits: int) -> str:
        some = values[alive]
        sure = 2 * float(np.median(errors[alive]))
        return f"{some.mean():.{digits}f} {unit}, each ± {some.std():.2g}, uncertainty {sure:.2g} {unit} (k = 2)"

    quality = known.quality_uncertainty * known.quality
    dead = np.flatnonzero(known.dead)
    named = ", ".join(str(number) for number in dead[:20]) + (" and more" if len(dead) > 20 else "")
    rows = [
        ("array", f"{known.array.name}, {known.array.count} transducers"),
        ("dead", f"{len(dead)}: {named}" if len(dead) else "none"),
        ("strength", of(known.strength, known.strength_uncertainty, "of the model's", 3)),
        ("level of all", f"uncertainty {200 * known.level_uncertainty:.2g} % (k = 2)"),
        ("phase", of(known.phase, known.phase_uncertainty, "rad", 3)),
        ("resonance", of(known.resonance, known.resonance_uncertainty, "Hz", 0)),
        ("quality factor", of(known.quality, quality, "", 1)),
        *_unit_rows(known),
        ("calibration id", f"{known.identifier}, {known.date or 'no date'}"),
    ]
    return [Row(name, text) for name, text in rows]


def _unit_rows(known: ArrayCalibration) -> list[tuple[str, str]]:
    """Position, angle and time offset of each unit off its nominal place, k = 2, and what cannot be told apart."""
    if not known.pose_covariance.any():
        return []
    rows: list[tuple[str, str]] = []
    scales = ((slice(0, 3), 1e3, "mm"), (slice(3, 6), 180 / np.pi, "°"), (slice(6, 7), 1e9, "ns"))
    for unit, (pose, sure) in enumerate(zip(known.pose, known.pose_uncertainty, strict=True)):
        parts = [
            f"{', '.join(f'{each:+.3g}' for each in scale * pose[part])} {name} (± {2 * scale * sure[part].max():.2g})"
            for part, scale, name in scales
        ]
        rows.append((f"unit {unit}", "; ".join(parts)))
    rows.append(("of the units", "x, y, z, rotation about x, y, z, time offset; off their nominal places, k = 2"))
    shared = "the array as a whole from the sensor's place and angle"
    weak = [f"{names} (up to {times:.1f} times the aim)" for names, times in known.inseparable().items()]
    rows.append(("not told apart", "; ".join([shared, *weak])))
    return rows
