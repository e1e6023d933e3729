"""The command `info`, and what other commands say of a file that they made."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from midair.cli.terminal import Json, banner, calibrated_by, print_json, print_rows, recording_rows, stroke_rows
from midair.files import contents, load_calibration, load_pressure, load_solution, open_take
from midair.model import Provenance, Setting
from midair.reel import moments
from midair.rig import calibration_rows, uncertainty_of


def info_command(source: Path, /, *, json: Json = False) -> None:
    """Say what a recording, a drive or a calibration holds, where it came from, and what was done to it.

    Parameters
    ----------
    source
        NAME.h5, NAME.drive.h5, NAME.calibration.h5, or any recording that can be imported.

    Examples
    --------
    $ midair info take.h5
    $ midair info take.drive.h5 --json
    """
    rows, provenance = _rows_of_file(source)
    if json:
        steps = [{"stage": step.stage, **step.settings} for step in provenance.steps]
        return print_json({**dict(rows), "simulated": provenance.simulated, "steps": steps})
    banner(provenance.simulated)
    print_rows([*rows, *((f"step: {step.stage}", _settings(step.settings)) for step in provenance.steps)])
    return None


def _rows_of_file(source: Path) -> tuple[list[tuple[str, str]], Provenance]:
    """What a file of any kind holds, and its life."""
    if not source.name.lower().endswith((".h5", ".hdf5", ".nc")):
        return _take_rows(source)
    held = contents(source)
    readers = {"drive": _drive_rows, "calibration": _calibration_rows}
    rows, provenance = readers.get(held.kind, _take_rows)(source)
    rows.append(
        ("written", f"{held.created} by {held.created_by}" + ("" if held.finished else ", not closed in order"))
    )
    return rows, provenance


def _calibration_rows(source: Path) -> tuple[list[tuple[str, str]], Provenance]:
    calibration = load_calibration(source)
    if calibration is None:
        return [("calibration", "none")], Provenance()
    rows = calibration_rows(calibration)
    return rows, calibration.provenance


def _take_rows(source: Path) -> tuple[list[tuple[str, str]], Provenance]:
    take = open_take(source, streamed=True)
    recording, calibration = take.recording, take.calibration
    pressure = load_pressure(source, streamed=True) if take.stored else None
    rows = [("recording", str(source)), ("source", recording.provenance.source), *recording_rows(recording)]
    rows.append(("calibration", calibrated_by(calibration)))
    if calibration is not None:
        rows.append(("calibration id", f"{calibration.identifier}, version {calibration.version}"))
        rows.append(("calibration date", calibration.date or "not written down"))
        rows.append(("uncertainty", uncertainty_of(calibration)))
    if pressure is not None:
        rows.append(("largest pressure", f"{moments(pressure.pressure).largest:.3g} Pa"))
    rows += stroke_rows(recording.provenance, recording.rate)
    rows += [(f"note: {name}", text) for name, text in recording.provenance.notes.items()]
    return rows, recording.provenance


def _drive_rows(source: Path) -> tuple[list[tuple[str, str]], Provenance]:
    solution = load_solution(source, streamed=True)
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


def _settings(settings: Mapping[str, Setting]) -> str:
    # Places of a stage, ten a second, are for programs (--json).
    return ", ".join(
        f"{len(value)} {name}" if name == "stamps" and isinstance(value, tuple) else f"{name} {value}"
        for name, value in settings.items()
    )
