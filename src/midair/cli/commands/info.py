"""The command `info`: contents, origin and history of a file."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from midair.cli.console import banner, print_json, print_rows
from midair.cli.options import Json
from midair.cli.output import (
    array_rows,
    calibration_figures,
    calibration_text,
    level_of_file,
    recording_figures,
    recording_rows,
    solve_error,
)
from midair.cli.stage_options import recorded_strokes, stroke_rows
from midair.files import (
    contents,
    load_array_calibration,
    load_calibration,
    load_pressure,
    load_solution,
    load_target,
    open_take,
)
from midair.model import Provenance, Setting
from midair.rig import calibration_rows, describe_uncertainty
from midair.settings import format_setting
from midair.streaming import moments
from midair.targets import frames_without_lead


@dataclass(frozen=True, slots=True, kw_only=True)
class _FileFacts:
    """Facts about a file: rows to print, values for JSON, provenance."""

    rows: list[tuple[str, str]]
    figures: dict[str, object]
    provenance: Provenance = field(default_factory=Provenance)


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
    facts = _facts_of_file(source)
    steps = facts.provenance.steps
    if json:
        life = {
            "source": facts.provenance.source,
            "notes": dict(facts.provenance.notes),
            "simulated": facts.provenance.simulated,
            "steps": [{"stage": step.stage, **step.settings} for step in steps],
        }
        return print_json({**facts.figures, **life})
    banner(facts.provenance.simulated)
    print_rows([*facts.rows, *((f"step: {step.stage}", _settings(step.settings)) for step in steps)])
    return None


def _facts_of_file(source: Path) -> _FileFacts:
    if not source.name.lower().endswith((".h5", ".hdf5")):
        return _facts_of_take(source)
    held = contents(source)
    readers = {"drive": _facts_of_drive, "calibration": _facts_of_calibration, "array": _facts_of_array}
    facts = readers.get(held.kind, _facts_of_take)(source)
    facts.rows.append(("written", f"{held.created} by {held.created_by}"))
    facts.figures.update(written=held.created, written_by=held.created_by)
    return facts


def _facts_of_calibration(source: Path) -> _FileFacts:
    calibration = load_calibration(source)
    if calibration is None:
        return _FileFacts(rows=[("calibration", "none")], figures={"kind": "calibration", "calibration": None})
    rows = calibration_rows(calibration)
    figures: dict[str, object] = {"kind": "calibration", "calibration": calibration_figures(calibration), **dict(rows)}
    return _FileFacts(rows=rows, figures=figures, provenance=calibration.provenance)


def _facts_of_array(source: Path) -> _FileFacts:
    known = load_array_calibration(source)
    rows = array_rows(known)
    return _FileFacts(rows=rows, figures={"kind": "array", **dict(rows)}, provenance=known.provenance)


def _facts_of_take(source: Path) -> _FileFacts:
    take = open_take(source, streamed=True)
    recording, calibration = take.recording, take.calibration
    life = recording.provenance
    pressure = load_pressure(source, streamed=True) if take.stored else None
    rows = [("recording", str(source)), ("source", life.source), *recording_rows(recording)]
    if recording.unit != "Pa" or calibration is not None:
        rows.append(("calibration", calibration_text(calibration)))
    if calibration is not None:
        rows.append(("calibration id", f"{calibration.identifier}, version {calibration.version}"))
        rows.append(("calibration date", calibration.date or "not recorded"))
        rows.append(("uncertainty", describe_uncertainty(calibration)))
    largest = None if pressure is None else float(moments(pressure.pressure).largest)
    if largest is not None:
        rows.append(("largest pressure", f"{largest:.3g} Pa"))
    rows += stroke_rows(life, recording.rate)
    rows += [(f"note: {name}", text) for name, text in life.notes.items()]
    figures: dict[str, object] = {
        "kind": "recording",
        "recording": str(source),
        **recording_figures(recording),
        "calibration": calibration_figures(calibration),
        "uncertainty": None if calibration is None else describe_uncertainty(calibration),
        "largest_pressure_pa": largest,
        "strokes": recorded_strokes(life, recording.rate),
    }
    return _FileFacts(rows=rows, figures=figures, provenance=life)


def _facts_of_drive(source: Path) -> _FileFacts:
    solution = load_solution(source, streamed=True)
    drive = solution.drive
    plays = solution.plays
    inside = frames_without_lead(drive.provenance, drive.frames, drive.rate)
    seconds, silent = drive.frames / drive.rate, int((~plays).sum())
    error = solution.error[inside][plays[inside]]
    mean, worst = (float(error.mean()), float(error.max())) if len(error) else (None, None)
    level = level_of_file(source) if plays.any() else None
    target = load_target(source, streamed=True) if plays.any() else None
    energy_error = None if target is None else solve_error(solution, target)
    error_text = "nothing plays" if mean is None else f"mean {100 * mean:.1f} %, worst {100 * (worst or 0):.1f} %"
    rows = [
        ("drive", str(source)),
        ("source", drive.provenance.source),
        ("frames", f"{drive.frames} at {drive.rate:g} Hz, {seconds:.3f} s, {silent} silent"),
        ("array", f"{drive.array.name}, {drive.array.count} transducers"),
        ("level", f"{drive.level.min():g} to {drive.level.max():g} of full drive"),
        *([] if level is None else level.rows()),
        ("E", error_text if energy_error is None else str(energy_error)),
        *((f"note: {name}", text) for name, text in drive.provenance.notes.items()),
    ]
    figures: dict[str, object] = {
        "kind": "drive",
        "drive": str(source),
        "frames": drive.frames,
        "rate_hz": drive.rate,
        "duration_s": seconds,
        "silent_frames": silent,
        "array": {"name": drive.array.name, "transducers": drive.array.count},
        "level": [float(drive.level.min()), float(drive.level.max())],
        "pressure": None if level is None else level.plain(),
        "E_mean": mean,
        "E_worst": worst,
        **({} if energy_error is None else energy_error.plain()),
    }
    return _FileFacts(rows=rows, figures=figures, provenance=drive.provenance)


def _settings(settings: Mapping[str, Setting]) -> str:
    # Positions of a motion stage, ten a second: their number here, all of them with --json. Names without a dot carry
    # their unit.
    return ", ".join(
        f"{len(value)} {name}"
        if name == "stamps" and isinstance(value, tuple)
        else f"{name} {format_setting(name, value) if '.' in name else value}"
        for name, value in settings.items()
    )
