"""The command `info`: contents, origin and history of a file."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from midair import files, rig
from midair.cli.options import Json
from midair.cli.output import calibration_row, describe_drive, describe_strokes, print_table, recording_text
from midair.model import Provenance, Setting
from midair.settings import Settings, format_setting, nearest_mode, typed_options
from midair.table import Details, Line, Row, describe


def info_command(source: Path, /, *, json: Json = False) -> None:
    """Print the contents, origin and history of a recording, a drive or a calibration.

    Parameters
    ----------
    source
        NAME.h5, NAME.drive.h5, NAME.calibration.h5, NAME.array.h5, or any recording that midair can import.

    Examples
    --------
    $ midair info take.h5
    $ midair info take.drive.h5 --all
    """
    readers = {"drive": _drive, "calibration": _calibration, "array": _array}
    held = files.contents(source) if source.name.lower().endswith((".h5", ".hdf5")) else None
    answer, table, life = readers.get("" if held is None else held.kind, _take)(source)
    steps = [{"stage": step.stage, **step.settings} for step in life.steps]
    table = [
        ("file", str(source)),
        ("from", life.source),
        ("notes", ", ".join(f"{name} {text}" for name, text in life.notes.items())),
        *([] if held is None else [Row("written", held.created, text=f"{held.created} by {held.created_by}")]),
        *table,
        {} if held is None else {"written_by": held.created_by},
        Details([(f"step: {step.stage}", _settings(step.settings)) for step in life.steps]),
        {"source": life.source, "notes": dict(life.notes), "steps": steps},
    ]
    print_table(table, answer=answer, simulated=life.simulated, json=json)


_Facts = tuple[str, list[Line], Provenance]


def _calibration(source: Path) -> _Facts:
    calibration = files.load_calibration(source)
    if calibration is None:
        return "no calibration", [{"kind": "calibration"}, Row("calibration", None, text="")], Provenance()
    rows = [Row(name, text) for name, text in rig.calibration_rows(calibration)]
    known = calibration_row(calibration, hidden=True)
    return "calibration of a sensor", [{"kind": "calibration"}, known, *rows], calibration.provenance


def _array(source: Path) -> _Facts:
    known = files.load_array_calibration(source)
    return "calibration of an array", [{"kind": "array"}, *describe(known)], known.provenance


def _take(source: Path) -> _Facts:
    take = files.open_take(source)
    recording, calibration = take.recording, take.calibration
    pressure = files.load_pressure(source) if take.stored else None
    largest = None if pressure is None else float(np.abs(pressure.pressure).max())
    sure = None if calibration is None else rig.describe_uncertainty(calibration)
    identity = "" if calibration is None else f"{calibration.identifier}, version {calibration.version}"
    return (
        f"recording of {recording_text(recording)}",
        [
            {"kind": "recording", "recording": str(source)},
            *describe(recording),
            Row("largest pressure", largest, key="largest_pressure_pa", text=f"{largest:.3g} Pa" if largest else ""),
            calibration_row(calibration, source, hidden=recording.unit == "Pa" and calibration is None),
            Row("uncertainty", sure, text=sure or ""),
            Details([("calibration id", identity), *describe_strokes(recording.provenance, recording.rate)]),
        ],
        recording.provenance,
    )


def _drive(source: Path) -> _Facts:
    life = files.load_solution(source, streamed=True).drive.provenance
    settings, (about, lines) = Settings.of(life), describe_drive(source)
    near = None if settings is None else nearest_mode(settings)
    rows: list[Line] = []
    if near is not None:
        mode, changed = near
        rows = [
            ("settings", f"{mode} mode" + (f", {len(changed)} changed: midair info --all" if changed else "")),
            Details([("changed", option) for option in typed_options(changed)]),
        ]
    return f"drive of {about}", [{"kind": "drive", "drive": str(source)}, *lines, *rows], life


def _settings(settings: Mapping[str, Setting]) -> str:
    # Positions of a motion stage, ten a second: their number here, all of them with --json. Names without a dot carry
    # their unit.
    return ", ".join(
        f"{len(value)} {name}"
        if name == "stamps" and isinstance(value, tuple)
        else f"{name} {format_setting(name, value) if '.' in name else value}"
        for name, value in settings.items()
    )
