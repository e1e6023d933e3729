"""Writing a recording with what belongs to it, and saying what was noticed and what was lost."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from midair.cli.terminal.console import banner, out, print_json, print_rows
from midair.errors import InputError
from midair.files import FormatLoss, check_unclaimed, save, writable_path
from midair.model import Calibration, Event, PressureFrames, Recording


def write_recording(
    recording: Recording,
    path: Path,
    *,
    calibration: Calibration | None,
    pressure: PressureFrames | None = None,
    journal: Sequence[Event] = (),
) -> tuple[FormatLoss, ...]:
    """Write a recording with its calibration, pressure and journal, and return what its format cannot hold."""
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
    """Print rows, notes and losses for a person, or figures in place of rows for a program."""
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
    """Refuse a name before the work: without its folder, of a file that is there, or that is being recorded.

    Parameters
    ----------
    path : Path
        What is to be written.
    force : bool
        Whether a file may be written over; never one that is being recorded.
    *endings : str
        Of names that the writer takes; any if none is given.

    Raises
    ------
    MidairError
        Its leaf that says what is wrong with the name.
    """
    if endings and not path.name.lower().endswith(endings):
        raise InputError(f"{path}: expected a name that ends in {' or '.join(endings)}")
    writable_path(path)
    if path.exists() and not force:
        raise InputError(f"{path}: is there already; give another name, or --force to write over it")
    check_unclaimed(path)
