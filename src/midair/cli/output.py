"""Writing recordings, and printing notes and format losses."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from midair.cli.console import banner, out, print_json, print_rows
from midair.errors import InputError
from midair.files import FormatLoss, check_not_recording, save, writable_path
from midair.model import Calibration, Event, PressureFrames, Recording


def write_recording(
    recording: Recording,
    path: Path,
    *,
    calibration: Calibration | None,
    pressure: PressureFrames | None = None,
    journal: Sequence[Event] = (),
) -> tuple[FormatLoss, ...]:
    """Write a recording with calibration, pressure and journal; return what its format cannot hold."""
    return save(recording, path, calibration=calibration, pressure=pressure, journal=journal)


def as_recording(pressure: PressureFrames) -> Recording:
    """Calibrated pressure as a recording in Pa."""
    return Recording(
        samples=pressure.pressure,
        rate=pressure.rate,
        sensor=pressure.sensor,
        unit="Pa",
        provenance=pressure.provenance,
    )


def print_written(
    rows: list[tuple[str, str]],
    figures: Mapping[str, object],
    notes: Iterable[str],
    lost: Iterable[FormatLoss],
    *,
    simulated: bool,
    json: bool,
) -> None:
    """Print rows, notes and losses, or JSON."""
    if json:
        losses = [{"what": loss.what, "text": loss.text} for loss in lost]
        return print_json({**figures, "simulated": simulated, "notes": list(notes), "lost": losses})
    banner(simulated)
    print_rows(rows)
    for note in notes:
        out().print(f"note: {note}")
    for loss in lost:
        out().print(f"lost: {loss}")
    return None


def may_write(path: Path, force: bool, *endings: str) -> None:
    """Refuse an output before the work: wrong ending, missing folder, existing file, recording in progress."""
    if endings and not path.name.lower().endswith(endings):
        raise InputError(f"{path}: expected a name that ends in {' or '.join(endings)}")
    writable_path(path)
    if path.exists() and not force:
        raise InputError(f"{path}: already exists; give another name, or --force to overwrite it")
    check_not_recording(path)
