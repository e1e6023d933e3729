"""Drives, `name.drive.h5`: transducer phases and levels, errors of the solution, and the target.

For AUTD3 units, phases and levels of single transducers are stored as the bytes that the units play, compressed; for
other arrays as float64 without rounding. Targets are stored as float32.
"""

import os
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from midair.errors import BrokenFileError, MismatchError, UnknownFormatError
from midair.files.atomic import parse_errors
from midair.files.native.hdf5 import (
    finite,
    name_numbers,
    new_file,
    read_group,
    signature,
    stored_dataset,
    write_frames,
    write_group,
)
from midair.files.native.provenance_json import from_json, to_json
from midair.files.native.raw_recording import open_file
from midair.files.native.schema import array_from, array_values, check_time, time_values
from midair.model import Acoustics, AmplitudeFrames, ControlGrid, Drive, Medium, Solution, Status
from midair.progress import report_progress
from midair.streaming import LazyFrames, block_ranges, blocks, each_frame

DRIVE_SUFFIX = ".drive.h5"

Frames = NDArray[np.float64] | LazyFrames

AUTD3_TRANSDUCERS = 249
"""Number of transducers of an AUTD3 unit, which plays phases in 256 steps to a turn and levels in 255 steps."""

_TURN = 256 / (2 * np.pi)
"""Steps of the phase in a radian."""


def save_solution(solution: Solution, path: str | os.PathLike[str], *, target: AmplitudeFrames | None = None) -> None:
    """Write a drive with its errors, the geometry of its array and, if given, its target, atomically.

    Raises UnknownFormatError or FileError if the name does not end in ``.drive.h5``, or the file cannot be written;
    MismatchError if target and drive differ in frames or rate.
    """
    parts = (solution.cut(first, last) for first, last in block_ranges(solution.drive.phase.shape))
    save_solutions(parts, path, frames=solution.drive.frames, target=target)


def save_solutions(
    parts: Iterable[Solution], path: str | os.PathLike[str], *, frames: int, target: AmplitudeFrames | None = None
) -> None:
    """Write a drive block by block as it is solved; the file gets its name after the last block.

    The blocks come in order and differ only in their frames; `frames` is the number of all, and `target` that of all.
    Raises the errors of `save_solution`.
    """
    if not os.fspath(path).lower().endswith(DRIVE_SUFFIX):
        raise UnknownFormatError(f"{path}: expected a name that ends in {DRIVE_SUFFIX} for a drive")
    coming = iter(parts)
    first = next(coming)
    if target is not None and (target.frames != frames or target.rate != first.drive.rate):
        raise MismatchError(
            f"target: expected {frames} frames at {first.drive.rate:g} Hz as in the drive, "
            f"got {target.frames} at {target.rate:g} Hz; save the target that was solved"
        )
    values, done = _frame_values(first), first.drive.frames
    # A compressed dataset does not exceed its size in memory.
    room = frames * (sum(each.nbytes for each in values.values()) // done + 8)
    room += 0 if target is None else 4 * frames * target.grid.count
    with new_file(path, room=room) as file:
        write_group(file, "drive", {**_drive_values(first.drive, frames), **values}, frames=frames)
        name_numbers(stored_dataset(file, "status"), get_args(Status))
        for part in report_progress(coming, frames, weight=lambda part: part.drive.frames):
            write_frames(file, _frame_values(part), done)
            done += part.drive.frames
        if done != frames:
            raise MismatchError(f"{path}: expected a drive of {frames} frames, got {done}")
        if target is not None:
            written = 0
            for block in blocks(target.amplitude):
                values = {"target": block.astype(np.float32)}
                if written:
                    write_frames(file, values, written)
                else:
                    write_group(file, "drive", {**_target_values(target), **values}, frames=frames)
                written += len(block)


def load_solution(path: str | os.PathLike[str], *, streamed: bool = False) -> Solution:
    """Read a drive with its errors, exactly as it was saved; phases and transducer levels lazily if `streamed`.

    Raises MissingFileError, BrokenFileError or UnknownFormatError if the file does not exist, is damaged or of another
    type, or was written by a newer midair; a subclass of InputError that names invalid values.
    """
    return solution_from(read_drive(Path(path), streamed=streamed), Path(path))


def read_drive(path: Path, *, streamed: bool) -> dict[str, Any]:
    """Stored values of a drive."""
    with open_file(path) as file:
        values = read_group(file, "drive", path, streamed=streamed)
        for stored, name, steps in (("phase_step", "phase", _TURN), ("level_step", "transducer_level", 255)):
            if stored in values:
                values[name] = each_frame(values.pop(stored), lambda byte, steps=steps: byte / steps)
        return values


def solution_from(values: Mapping[str, Any], path: Path) -> Solution:
    """Solution from its stored values."""
    with parse_errors(path, "a drive of midair"):
        check_time(values, path)
        level = values.get("level", values.get("transducer_level"))
        if level is None or ("level" in values and "transducer_level" in values):
            raise BrokenFileError(f"{path}: expected either level or transducer_level; the file is damaged")
        if "phase" not in values:
            raise BrokenFileError(f"{path}: expected either phase or phase_step; the file is damaged")
        if ("response_real" in values) != ("response_imag" in values):
            raise BrokenFileError(f"{path}: expected response_real and response_imag together; the file is damaged")
        measured = np.asarray(values.get("response_real", np.zeros(0)) + 1j * values.get("response_imag", np.zeros(0)))
        medium = Medium(**{attribute: values[name] for name, attribute in _AIR.items() if name in values})
        medium.check_speed(str(path))
        return Solution(
            drive=Drive(
                phase=finite(values["phase"], "phase"),
                level=_levels(level, path),
                rate=values["rate_hz"],
                array=replace(array_from(values), response=measured),
                acoustics=Acoustics(medium=medium, directivity=values["directivity"]),
                provenance=from_json(values["provenance"]),
            ),
            error=values["error"],
            iterations=values["iterations"],
            status=_status_from(values["status"], path),
        )


def load_target(path: str | os.PathLike[str], *, streamed: bool = False) -> AmplitudeFrames | None:
    """Read the target of a drive, lazily if `streamed`; None if the file has none.

    Errors are those of `load_solution`.
    """
    return target_from(read_drive(Path(path), streamed=streamed), Path(path))


def target_from(values: Mapping[str, Any], path: Path) -> AmplitudeFrames | None:
    """Target of a drive from its stored values."""
    if "target" not in values:
        return None
    needed = (*_GRID, "grid_centre_x_m", "grid_centre_y_m", "target_provenance")
    missing = [name for name in needed if name not in values]
    if missing:
        raise BrokenFileError(f"{path}: expected {', '.join(missing)} beside the target; the file is damaged")
    with parse_errors(path, "a drive of midair"):
        check_time(values, path)
        return AmplitudeFrames(
            amplitude=finite(values["target"], "target"),
            rate=values["rate_hz"],
            grid=ControlGrid(
                **{attribute: values[name] for name, attribute in _GRID.items()},
                centre=(values["grid_centre_x_m"], values["grid_centre_y_m"]),
            ),
            provenance=from_json(values["target_provenance"]),
        )


_GRID = {"grid_rows": "rows", "grid_columns": "columns", "grid_pitch_m": "pitch", "grid_height_m": "height"}
_AIR = {
    "air_density_kg_m3": "density",
    "air_speed_m_s": "speed",
    "air_attenuation_np_m": "attenuation",
    "air_alpha": "alpha",
    "air_temperature_c": "temperature",
    "air_humidity": "humidity",
}
"""Names in the file of the attributes of a grid and of the air."""


def _drive_values(drive: Drive, frames: int) -> dict[str, Any]:
    """Stored values of a drive of so many frames, without those of its frames."""
    array = drive.array
    return {
        **signature("drive", drive.provenance),
        **time_values(frames, drive.rate),
        **array_values(array),
        **({} if array.alike else {"response_real": array.response.real, "response_imag": array.response.imag}),
        "directivity": drive.acoustics.directivity,
        **{name: value for name, own in _AIR.items() if (value := getattr(drive.acoustics.medium, own)) is not None},
    }


def _frame_values(part: Solution) -> dict[str, np.ndarray]:
    """Stored values of the frames of a part."""
    drive, names = part.drive, get_args(Status)
    phase, level = np.asarray(drive.phase), np.asarray(drive.level)
    values: dict[str, np.ndarray] = {
        "error": part.error,
        "iterations": part.iterations,
        "status": np.array([names.index(status) for status in part.status], "i1"),
        "level" if level.ndim == 1 else "transducer_level": level,
    }
    if not (np.bincount(drive.array.unit) == AUTD3_TRANSDUCERS).all():
        return {**values, "phase": phase}
    if level.ndim == 2:
        values["level_step"] = _steps(values.pop("transducer_level"), 255)
    return {**values, "phase_step": _steps(phase, _TURN)}


def _steps(x: np.ndarray, steps: float) -> NDArray[np.uint8]:
    """Numbers in steps, modulo 256."""
    return np.mod(np.rint(x * steps), 256).astype(np.uint8)


def _target_values(target: AmplitudeFrames) -> dict[str, Any]:
    """Stored values of a target without those of its frames."""
    grid = target.grid
    return {
        **{name: getattr(grid, attribute) for name, attribute in _GRID.items()},
        "grid_centre_x_m": grid.centre[0],
        "grid_centre_y_m": grid.centre[1],
        "target_provenance": to_json(target.provenance),
        "point": np.arange(grid.count),
    }


def _levels(level: Frames, path: Path) -> NDArray[np.float64]:
    """Levels that are checked; lazy ones when they are read."""

    def checked(block: np.ndarray) -> np.ndarray:
        if not (block.min() >= 0 and block.max() <= 1):
            raise BrokenFileError(
                f"{path}: level: expected 0 to 1 of full drive, got {block.min():g} to {block.max():g}"
            )
        return block

    return each_frame(level, checked)


def _status_from(codes: np.ndarray, path: Path) -> tuple[Status, ...]:
    known: tuple[Status, ...] = get_args(Status)
    if codes.min() < 0 or codes.max() >= len(known):
        raise BrokenFileError(f"{path}: expected status 0 to {len(known) - 1}, got {codes.min()} to {codes.max()}")
    return tuple(known[code] for code in codes)
