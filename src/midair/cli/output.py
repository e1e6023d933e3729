"""Output of the commands: writing recordings, rows and JSON values of recordings, calibrations and drives."""

from __future__ import annotations

import shlex
import shutil
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from midair import files
from midair.cli.console import print_answer, print_json, print_note, print_rows, verbosity
from midair.cli.options import format_quantity
from midair.errors import InputError
from midair.evaluate import error_by_energy
from midair.model import (
    ArrayCalibration,
    Calibration,
    PressureFrames,
    Provenance,
    Recording,
    SensorGrid,
    Setting,
    frames_without_lead,
)
from midair.pressure_level import PressureLevel, power_of, predicted
from midair.recordings import dead_channels
from midair.settings import Settings
from midair.streaming import blocks
from midair.table import Details, Line, Row, describe, plain, printed


def as_recording(pressure: PressureFrames) -> Recording:
    """Calibrated pressure as a recording in Pa."""
    return Recording(
        samples=pressure.pressure, rate=pressure.rate, sensor=pressure.sensor, unit="Pa", provenance=pressure.provenance
    )


def print_table(
    table: Iterable[Line],
    *,
    json: bool,
    answer: str = "",
    simulated: bool = False,
    notes: Iterable[str] | None = None,
    lost: Iterable[files.FormatLoss] = (),
) -> None:
    """Print the answer of a command and its table, or the values of the table as JSON, with the notes if given."""
    if json:
        values = plain(table) | {"simulated": simulated}
        if notes is not None:
            values["notes"], values["lost"] = list(notes), [{"what": loss.what, "text": loss.text} for loss in lost]
        return print_json(values)
    if answer or simulated:
        print_answer(answer, simulated=simulated)
    more = [*(("note", note) for note in notes or ()), *(("lost", str(loss)) for loss in lost)]
    return print_rows([*printed(table, all=verbosity().all), *more])


def next_row(*words: object) -> tuple[str, str]:
    """The command to type next: by its path where it is not on the path, names quoted where a shell needs that."""
    typed = sys.argv[0] if shutil.which("midair") is None and Path(sys.argv[0]).stem == "midair" else "midair"
    return "next", shlex.join([typed, *map(str, words)])


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
    return [Details(lines), {"strokes": strokes}]


@describe.register
def _(recording: Recording) -> list[Line]:
    sensor, silent = recording.sensor, np.flatnonzero(dead_channels(recording)).tolist()
    low, high, unit = float(recording.samples.min()), float(recording.samples.max()), recording.unit
    # Constant cells of a synthetic field are not broken but untouched.
    life = recording.provenance
    synthetic = life.simulated or any(step.stage == "footprint" for step in life.steps)
    channels = ", ".join(map(str, silent))
    touched_text = f"{sensor.count - len(silent)} of {sensor.count} cells" if silent else ""
    about = {"name": sensor.name, "rows": sensor.rows, "columns": sensor.columns, "pitch_m": sensor.pitch}
    return [
        {"frames": recording.frames, "rate_hz": recording.rate, "duration_s": recording.duration, "unit": unit},
        Row("range", [low, high], text=f"{low:.4g} to {high:.4g} {unit}"),
        Row("dead channels", [] if synthetic else silent, key="dead_channels", text="" if synthetic else channels),
        *([Row("touched", silent, key="untouched_cells", text=touched_text)] * synthetic),
        Details([Row("sensor", about, text=sensor_text(sensor))]),
    ]


def duration_text(sensor: SensorGrid, frames: int, rate: float, thing: str = "") -> str:
    """Duration, object, cells and rate of a recording in one line."""
    cells = "1 cell" if sensor.count == 1 else f"{sensor.count} cells"
    return f"{frames / rate:.4g} s{thing and f' of {thing}'}, {cells} at {rate:.6g} Hz"


def recording_text(recording: Recording) -> str:
    """Duration, object, cells and rate of a recording in one line."""
    notes = recording.provenance.notes
    return duration_text(recording.sensor, recording.frames, recording.rate, notes.get("object", ""))


def sensor_text(sensor: SensorGrid) -> str:
    """Name, rows, columns and pitch of a sensor."""
    return f"{sensor.name}, {sensor.rows} x {sensor.columns}, pitch {format_quantity(sensor.pitch, 'm')}"


def calibration_row(calibration: Calibration | None, file: Path | None = None, *, hidden: bool = False) -> Row:
    """Identity of a calibration, or advice without one for a file; `hidden` rows are in JSON only."""
    if calibration is None:
        advice = f"none: state one with midair calibrate {shlex.quote(str(file or 'FILE'))} --sensitivity 20mV/Pa"
        return Row("calibration", None, text="" if hidden else advice)
    source, date = calibration.provenance.source, calibration.date
    known = {"source": source, "id": calibration.identifier, "version": calibration.version, "date": date or None}
    return Row("calibration", known, text="" if hidden else " ".join(part for part in (source, date) if part))


def pressure_lines(level: PressureLevel) -> list[Line]:
    """Pressure of a drive; prints a warning on stderr if it is too much for the array."""
    if level.too_loud:
        print_note(level.advice(), warn=True)
    return [level.row(), lambda: Details([*level.rows()[1:], {"level": level.plain()}])]


def left_out_row(provenance: Provenance) -> tuple[str, str]:
    """The part of a recording that its drive does not reproduce; not printed where it is small."""
    return "left out", str(provenance.last("not reproduced").get("text", ""))


def describe_drive(path: Path, *, change: float = 0.0) -> tuple[str, list[Line]]:
    """Duration and array of the drive in a file, and its table; it is felt with `change` dB of pressure."""
    solution, target = files.load_solution(path, streamed=True), files.load_target(path, streamed=True)
    drive, plays, life = solution.drive, solution.plays, solution.drive.provenance
    inside = frames_without_lead(life, drive.frames, drive.rate)
    power = np.ones(drive.frames) if target is None else power_of(target)
    error = error_by_energy(solution.error[inside], (power * plays)[inside])
    pressure: list[Line] = [{"level": None}]
    if target is not None and plays.any():
        level, feeling = predicted(path, solution, target)
        feeling = feeling.at(change)
        pressure = [Row("predicted", feeling.plain(), key="felt", text=f"felt {feeling}"), *pressure_lines(level)]
    settings, silent = Settings.of(life), int((~plays).sum())
    ears = None if settings is None else settings.target.ears
    name, count, rate = drive.array.name, drive.array.count, drive.rate
    low, *_, high = sorted(float(end) for each in blocks(drive.level) for end in (each.min(), each.max()))
    iterations = float(solution.iterations[plays].mean()) if plays.any() else 0.0
    frames = f"{drive.frames} at {rate:g} Hz, {silent} silent, {inside.start} of lead at either end"
    about = f"{(inside.stop - inside.start) / rate:.4g} s at {rate:g} Hz for {name}, {count} transducers"
    return about, [
        *pressure,
        error.plain(),
        ("field error", str(error) if plays.any() else "nothing plays"),
        left_out_row(life),
        {"not_reproduced": dict(life.last("not reproduced"))},
        Row("ears", ears, key="ears_db", text="" if ears is None else f"at most {ears:g} dB there and at a bystander"),
        Details(
            [
                Row("frames", drive.frames, text=frames),
                {"rate_hz": rate, "duration_s": drive.frames / rate},
                {"silent_frames": silent, "lead_frames": inside.start},
                Row("array", {"name": name, "transducers": count}, text=f"{name}, {count} transducers"),
                Row("level", [low, high], key="drive_level", text=f"{low:g} to {high:g} of full drive"),
                ("faint frames", error.faint_text()),
                ("solver", f"{settings.solver.name}, {iterations:.1f} iterations a frame" if settings else ""),
            ]
        ),
    ]


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
        ("calibration id", f"{known.identifier}, {known.date or 'no date'}"),
    ]
    if sure := 2 * known.reflection_uncertainty:
        rows.append(("reflection", f"{abs(known.reflection):.2f} of the array's face, ± {sure:.2f} (k = 2)"))
    return [*(Row(name, text) for name, text in rows), Details([Row(name, text) for name, text in _unit_rows(known)])]


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
