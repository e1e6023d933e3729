"""The one way from a take to a solved drive: calibrate, cut, add the lead, solve, write."""

import secrets
import shlex
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from midair.errors import UnitError
from midair.files import DRIVE_SUFFIX, OpenedTake, load_solution, load_target, open_take, save_solutions
from midair.model import AmplitudeFrames, PressureFrames, Progress, Solution, TransducerArray
from midair.physics import check_frame_rate
from midair.pipeline import calibrated_pressure, reproduce_stream, required_lead, weaker_settings
from midair.pressure_level import store_predicted
from midair.recordings import unreproduced
from midair.settings import Settings
from midair.targets import add_lead


def calibrated_take(path: str | Path) -> OpenedTake:
    """The take in a file; UnitError if it lacks the calibration that makes pressures of it."""
    take, name = open_take(path), Path(path).name
    if take.calibration is None and take.recording.unit != "Pa":
        said = f"{name}: expected a calibration with a recording in {take.recording.unit}, got none"
        raise UnitError(f"{said}; state one: midair calibrate {shlex.quote(name)} --sensitivity 20mV/Pa")
    return take


def pressure_of(
    take: OpenedTake | str | Path, settings: Settings, start: float = 0.0, duration: float | None = None
) -> PressureFrames:
    """Calibrated pressure of a part of a take, `start` and `duration` in s.

    Its provenance states what the band leaves out of this part. Raises InputError if the part is not in the take.
    """
    opened = take if isinstance(take, OpenedTake) else calibrated_take(take)
    part = calibrated_pressure(opened.recording, opened.calibration, settings, start, duration)
    first, last = (
        start * opened.recording.rate,
        None if duration is None else (start + duration) * opened.recording.rate,
    )
    frames = slice(round(first), last if last is None else round(last))
    told = unreproduced(opened.recording, opened.calibration, settings.calibration.band, frames)
    return replace(part, provenance=part.provenance.then("not reproduced", told))


def pressure_to_solve(
    take: OpenedTake | str | Path,
    settings: Settings,
    start: float = 0.0,
    duration: float | None = None,
    *,
    lead: float | None = None,
) -> PressureFrames:
    """`pressure_of` with `lead` s before and after it, by default those that the settings need."""
    check_frame_rate(settings.target.rate)
    part = pressure_of(take, settings, start, duration)
    return add_lead(part, required_lead(settings) if lead is None else lead)


def solve_to_file(
    pressure: PressureFrames,
    array: TransducerArray,
    settings: Settings,
    path: Path,
    *,
    progress: Progress | None = None,
    confirm: Callable[[], object] = bool,
) -> tuple[AmplitudeFrames, Solution]:
    """Solve a pressure with its lead and write the drive; return its target, and the solution in lazy frames.

    A drive above the level at the ears that the settings state is solved again with less gain. The file gets its name
    when it is complete, after `confirm`, which may raise an error to keep the file that is there. Raises the errors of
    `pipeline.reproduce_stream` and `save_solutions`.
    """
    fresh = path.with_name(f".{secrets.token_hex(4)}{DRIVE_SUFFIX}")
    try:
        while True:
            target, parts = reproduce_stream(pressure, array, settings, early=False, progress=progress)
            save_solutions(parts, fresh, frames=target.frames, target=target)
            drive = load_solution(fresh, streamed=True).drive
            # Those of the drive have the gain that was found.
            weaker = weaker_settings(drive, Settings.of(drive.provenance) or settings)
            if weaker is None:
                break
            settings = weaker
        store_predicted(fresh)
        confirm()
        fresh.replace(path)
    finally:
        fresh.unlink(missing_ok=True)
    # From the file: lazy frames would be computed again.
    return load_target(path, streamed=True) or target, load_solution(path, streamed=True)
