"""The command `info`: contents, origin and history of a file."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from midair import files, rig
from midair.cli.options import Json
from midair.cli.output import calibration_row, describe, describe_strokes, level_of_file, print_table, solve_error
from midair.model import Provenance, Setting
from midair.settings import format_setting
from midair.table import Line, Row
from midair.targets import frames_without_lead


def info_command(source: Path, /, *, json: Json = False) -> None:
    """Print the contents, origin and history of a recording, a drive or a calibration.

    Parameters
    ----------
    source
        NAME.h5, NAME.drive.h5, NAME.calibration.h5, NAME.array.h5, or any recording that midair can import.

    Examples
    --------
    $ midair info take.h5
    $ midair info take.drive.h5 --json
    """
    readers = {"drive": _drive, "calibration": _calibration, "array": _array}
    held = files.contents(source) if source.name.lower().endswith((".h5", ".hdf5")) else None
    table, life = readers.get("" if held is None else held.kind, _take)(source)
    if held is not None:
        table.append(Row("written", held.created, text=f"{held.created} by {held.created_by}"))
        table.append({"written_by": held.created_by})
    table += [(f"step: {step.stage}", _settings(step.settings)) for step in life.steps]
    steps = [{"stage": step.stage, **step.settings} for step in life.steps]
    table.append({"source": life.source, "notes": dict(life.notes), "steps": steps})
    print_table(table, simulated=life.simulated, json=json)


_Facts = tuple[list[Line], Provenance]


def _calibration(source: Path) -> _Facts:
    calibration = files.load_calibration(source)
    if calibration is None:
        return [{"kind": "calibration"}, Row("calibration", None, text="none")], Provenance()
    rows = [Row(name, text) for name, text in rig.calibration_rows(calibration)]
    known = calibration_row(calibration, hidden=True)
    return [{"kind": "calibration"}, known, *rows], calibration.provenance


def _array(source: Path) -> _Facts:
    known = files.load_array_calibration(source)
    return [{"kind": "array"}, *describe(known)], known.provenance


def _take(source: Path) -> _Facts:
    take = files.open_take(source)
    recording, calibration = take.recording, take.calibration
    life = recording.provenance
    pressure = files.load_pressure(source) if take.stored else None
    largest = None if pressure is None else float(np.abs(pressure.pressure).max())
    known = calibration is not None
    sure = rig.describe_uncertainty(calibration) if known else None
    return [
        {"kind": "recording"},
        Row("recording", str(source)),
        ("source", life.source),
        *describe(recording),
        calibration_row(calibration, hidden=recording.unit == "Pa" and not known),
        ("calibration id", f"{calibration.identifier}, version {calibration.version}" if known else ""),
        ("calibration date", (calibration.date or "not recorded") if known else ""),
        Row("uncertainty", sure, text=sure or ""),
        Row(
            "largest pressure", largest, key="largest_pressure_pa", text="" if largest is None else f"{largest:.3g} Pa"
        ),
        *describe_strokes(life, recording.rate),
        *_notes(life),
    ], life


def _notes(life: Provenance) -> list[Line]:
    return [(f"note: {name}", text) for name, text in life.notes.items()]


def _drive(source: Path) -> _Facts:
    solution = files.load_solution(source, streamed=True)
    drive, plays = solution.drive, solution.plays
    inside = frames_without_lead(drive.provenance, drive.frames, drive.rate)
    seconds, silent = drive.frames / drive.rate, int((~plays).sum())
    error = solution.error[inside][plays[inside]]
    mean, worst = (float(error.mean()), float(error.max())) if len(error) else (None, None)
    level = level_of_file(source) if plays.any() else None
    target = files.load_target(source, streamed=True) if plays.any() else None
    energy_error = None if target is None else solve_error(solution, target)
    error_text = "nothing plays" if mean is None else f"mean {100 * mean:.1f} %, worst {100 * (worst or 0):.1f} %"
    name, count = drive.array.name, drive.array.count
    low, high = float(drive.level.min()), float(drive.level.max())
    return [
        {"kind": "drive"},
        Row("drive", str(source)),
        ("source", drive.provenance.source),
        Row("frames", drive.frames, text=f"{drive.frames} at {drive.rate:g} Hz, {seconds:.3f} s, {silent} silent"),
        {"rate_hz": drive.rate, "duration_s": seconds, "silent_frames": silent},
        Row("array", {"name": name, "transducers": count}, text=f"{name}, {count} transducers"),
        Row("level", [low, high], text=f"{low:g} to {high:g} of full drive"),
        *([] if level is None else level.rows()),
        {"pressure": None if level is None else level.plain()},
        ("E", error_text if energy_error is None else str(energy_error)),
        {"E_mean": mean, "E_worst": worst},
        {} if energy_error is None else energy_error.plain(),
        *_notes(drive.provenance),
    ], drive.provenance


def _settings(settings: Mapping[str, Setting]) -> str:
    # Positions of a motion stage, ten a second: their number here, all of them with --json. Names without a dot carry
    # their unit.
    return ", ".join(
        f"{len(value)} {name}"
        if name == "stamps" and isinstance(value, tuple)
        else f"{name} {format_setting(name, value) if '.' in name else value}"
        for name, value in settings.items()
    )
