"""Drives, `name.drive.h5`: what the array is told, how well it was solved for, and what was wanted.

Phases are kept as float64, exactly as they were solved: 5000 frames of 996 transducers take 40 MB, and no reader has to
wonder what was rounded.
"""

import os
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from midair.errors import BrokenFileError, MismatchError, UnknownFormatError
from midair.files.native.axes import check_time, time_values
from midair.files.native.hdf5 import (
    finite,
    fixed_text,
    new_file,
    open_file,
    plain_text,
    read_group,
    signature,
    write_group,
)
from midair.files.native.provenance_json import from_json, to_json
from midair.lazy_frames import LazyFrames, each_frame, from_iterator
from midair.model import (
    Acoustics,
    AmplitudeFrames,
    ControlGrid,
    Directivity,
    Drive,
    Medium,
    Provenance,
    Solution,
    Status,
    TransducerArray,
)
from midair.temp_frames import TempFrames

DRIVE_SUFFIX = ".drive.h5"
"""Of a drive's file."""


def save_solution(solution: Solution, path: str | os.PathLike[str], *, target: AmplitudeFrames | None = None) -> None:
    """Write a drive with its errors and, if given, the target that it was solved for.

    Parameters
    ----------
    solution : Solution
        The solution to write, with the whole geometry of its array.
    path : str or PathLike
        Ends in ``.drive.h5``; replaced in one piece if it is there.
    target : AmplitudeFrames, optional
        What was wanted, frame by frame.

    Raises
    ------
    UnknownFormatError
        If the name ends differently.
    MismatchError
        If the target has other frames or another rate than the drive.
    FileError
        If the file cannot be written.
    """
    _check_name(path)
    values = {**_drive_values(solution.drive), **_solution_values(solution)}
    if target is not None:
        _check_target(target, solution.drive)
        values |= _target_values(target)
    _write(values, path)


def save_solutions(
    parts: Iterable[Solution],
    path: str | os.PathLike[str],
    *,
    frames: int,
    target: AmplitudeFrames | None = None,
) -> None:
    """Write a drive that comes in parts, each as soon as it is there; the file gets its name with the last one.

    Of parts that are written their level a frame, error, iterations and status stay in memory: 25 bytes a frame.

    Parameters
    ----------
    parts : iterable of Solution
        One after another, alike in all but their frames.
    path : str or PathLike
        As in `save_solution`.
    frames : int
        How many there are in all parts together.
    target : AmplitudeFrames, optional
        What was wanted, of all parts together.

    Raises
    ------
    UnknownFormatError, MismatchError, FileError
        As in `save_solution`.
    """
    _check_name(path)
    coming = iter(parts)
    first = next(coming)
    if target is not None:
        _check_target(target, replace(first.drive, phase=first.drive.phase[:1], level=first.drive.level[:1]), frames)
    told = _Told()
    with TempFrames(first.drive.array.count) as spool:
        phases = from_iterator(told.listen(chain([first], coming), spool), (frames, first.drive.array.count))
        values = {**_drive_values(first.drive), **_solution_values(first), **time_values(frames, first.drive.rate)}
        # Phases stand first in the table: once they are written, all that is beside them is known.
        values |= {"phase": phases, **told.later(frames, spool, own_level=first.drive.level.ndim == 2)}
        if target is not None:
            values |= _target_values(target)
        points = 0 if target is None else target.grid.count
        _write(values, path, room=8 * frames * (first.drive.array.count + points + 4))


class _Told:
    """What parts of a solution say beside their phases, frame by frame."""

    def __init__(self) -> None:
        self.parts: dict[str, list[np.ndarray]] = {name: [] for name in ("level", "error", "iterations", "status")}

    def listen(self, parts: Iterable[Solution], spool: TempFrames) -> Iterator[np.ndarray]:
        """The phases of each part; the rest is kept, levels of single transducers on the disk."""
        for part in parts:
            values = _solution_values(part)
            for name in ("error", "iterations", "status"):
                self.parts[name].append(values[name])
            if part.drive.level.ndim == 2:
                spool.append(part.drive.level)
            else:
                self.parts["level"].append(part.drive.level)
            yield part.drive.phase

    def later(self, frames: int, spool: TempFrames, *, own_level: bool) -> dict[str, LazyFrames]:
        """What was kept, read once it is all there."""

        def of(name: str) -> LazyFrames:
            return LazyFrames(lambda first, last: np.concatenate(self.parts[name])[first:last], (frames,))

        level = {"transducer_level": spool.reel(frames)} if own_level else {"level": of("level")}
        return level | {name: of(name) for name in ("error", "iterations", "status")}


def _write(values: Mapping[str, Any], path: str | os.PathLike[str], *, room: int = 0) -> None:
    with new_file(path, room=room) as file:
        write_group(file, "drive", values)
        # What the numbers mean, in the way of the CF conventions.
        file["status"].attrs["flag_values"] = np.arange(len(get_args(Status)), dtype="i1")
        file["status"].attrs["flag_meanings"] = fixed_text(" ".join(get_args(Status)))


def load_solution(path: str | os.PathLike[str], *, streamed: bool = False) -> Solution:
    """The drive of a file, with its errors.

    Parameters
    ----------
    path : str or PathLike
        A ``.drive.h5`` of midair.
    streamed : bool
        Whether its phases, and levels of single transducers, are reels: read when somebody asks for them.

    Returns
    -------
    Solution
        As it was saved, to the last bit.

    Raises
    ------
    MissingFileError, BrokenFileError, UnknownFormatError
        If the file is not there, is damaged or of another kind, or is newer than this midair.
    InputError
        Its leaf that says what of the numbers cannot be used.
    """
    with open_file(path) as file:
        values = read_group(file, "drive", Path(path), streamed=streamed)
        check_time(values, Path(path))
        return Solution(
            drive=_drive_from(values, Path(path)),
            error=values["error"],
            iterations=values["iterations"],
            status=_status_from(values["status"], plain_text(file["status"].attrs.get("flag_meanings")), Path(path)),
        )


def load_target(path: str | os.PathLike[str], *, streamed: bool = False) -> AmplitudeFrames | None:
    """The target that a drive was solved for, as a reel if `streamed`; None when its file has none.

    Raises
    ------
    MissingFileError, BrokenFileError, UnknownFormatError
        If the file is not there, is damaged or of another kind, or is newer than this midair.
    """
    with open_file(path) as file:
        values = read_group(file, "drive", Path(path), streamed=streamed)
        if "target" not in values:
            return None
        missing = [name for name in _TARGET if name not in values]
        if missing:
            raise BrokenFileError(f"{path}: expected {', '.join(missing)} beside the target; the file is damaged")
        check_time(values, Path(path))
        return AmplitudeFrames(
            amplitude=finite(values["target"], "target"),
            rate=values["rate_hz"],
            grid=_grid_from(values),
            provenance=from_json(values["target_provenance"]),
        )


_TARGET = (
    "grid_rows",
    "grid_columns",
    "grid_pitch_m",
    "grid_height_m",
    "grid_centre_x_m",
    "grid_centre_y_m",
    "target_provenance",
)


def _check_name(path: str | os.PathLike[str]) -> None:
    if not os.fspath(path).lower().endswith(DRIVE_SUFFIX):
        raise UnknownFormatError(f"{path}: expected a name that ends in {DRIVE_SUFFIX} for a drive")


def _check_target(target: AmplitudeFrames, drive: Drive, frames: int | None = None) -> None:
    frames = drive.frames if frames is None else frames
    if target.frames != frames or target.rate != drive.rate:
        raise MismatchError(
            f"target: expected {frames} frames at {drive.rate:g} Hz as in the drive, "
            f"got {target.frames} at {target.rate:g} Hz; save the target that was solved"
        )


def _drive_values(drive: Drive) -> dict[str, Any]:
    array = drive.array
    return {
        **signature("drive", drive.provenance),
        **time_values(drive.frames, drive.rate),
        "array_name": array.name,
        "array_pressure_pa_m": array.pressure,
        "array_frequency_hz": array.frequency,
        **_acoustic_values(drive.acoustics),
        "transducer": np.arange(array.count),
        "axis": np.arange(3),
        "transducer_position": array.position,
        "transducer_normal": array.normal,
        "transducer_unit": array.unit,
        **({} if array.alike else {"response_real": array.response.real, "response_imag": array.response.imag}),
        "phase": drive.phase,
        "level" if drive.level.ndim == 1 else "transducer_level": drive.level,
    }


def _acoustic_values(acoustics: Acoustics) -> dict[str, Any]:
    medium = acoustics.medium
    values = {
        "directivity": acoustics.directivity,
        "air_density_kg_m3": medium.density,
        "air_speed_m_s": medium.speed,
        "air_attenuation_np_m": medium.attenuation,
        "air_alpha": medium.alpha,
        "air_temperature_c": medium.temperature,
        "air_humidity": medium.humidity,
    }
    return {name: value for name, value in values.items() if value is not None}


def _solution_values(solution: Solution) -> dict[str, Any]:
    names = get_args(Status)
    return {
        "error": solution.error,
        "iterations": solution.iterations,
        "status": np.array([names.index(status) for status in solution.status], "i1"),
    }


def _target_values(target: AmplitudeFrames) -> dict[str, Any]:
    grid = target.grid
    return {
        "grid_rows": grid.rows,
        "grid_columns": grid.columns,
        "grid_pitch_m": grid.pitch,
        "grid_height_m": grid.height,
        "grid_centre_x_m": grid.centre[0],
        "grid_centre_y_m": grid.centre[1],
        "target_provenance": to_json(target.provenance),
        "point": np.arange(grid.count),
        "target": target.amplitude,
    }


def _drive_from(values: Mapping[str, Any], path: Path) -> Drive:
    level = values.get("level", values.get("transducer_level"))
    if level is None or ("level" in values and "transducer_level" in values):
        raise BrokenFileError(f"{path}: expected either level or transducer_level; the file is damaged")
    if ("response_real" in values) != ("response_imag" in values):
        raise BrokenFileError(f"{path}: expected response_real and response_imag together; the file is damaged")
    measured = np.asarray(values.get("response_real", np.zeros(0)) + 1j * values.get("response_imag", np.zeros(0)))
    array = TransducerArray(
        position=values["transducer_position"],
        normal=values["transducer_normal"],
        unit=values["transducer_unit"],
        pressure=values["array_pressure_pa_m"],
        frequency=values["array_frequency_hz"],
        response=measured,
        name=values["array_name"],
    )
    provenance = from_json(values["provenance"])
    return Drive(
        phase=finite(values["phase"], "phase"),
        level=_levels(level, path),
        rate=values["rate_hz"],
        array=array,
        acoustics=_acoustics_from(values, provenance, path),
        provenance=provenance,
    )


def _levels(level: "np.ndarray | LazyFrames", path: Path) -> NDArray[np.float64]:
    """Levels that are checked when they are read, which the drive itself does of those in memory."""

    def checked(block: np.ndarray) -> np.ndarray:
        if not (block.min() >= 0 and block.max() <= 1):
            raise BrokenFileError(
                f"{path}: level: expected 0 to 1 of full drive, got {block.min():g} to {block.max():g}"
            )
        return block

    return each_frame(level, checked) if isinstance(level, LazyFrames) else level


_AIR = ("directivity", "air_density_kg_m3", "air_speed_m_s", "air_attenuation_np_m", "air_alpha")


def _acoustics_from(values: Mapping[str, Any], provenance: Provenance, path: Path) -> Acoustics:
    """The air and directivity of a drive; for one of before drives carried them, the paper's air, then the only one."""
    missing = [name for name in _AIR if name not in values]
    if len(missing) == len(_AIR):
        told = {step.settings.get("directivity") for step in provenance.steps if step.stage == "solve"}
        known: tuple[Directivity, ...] = get_args(Directivity)
        return next((Acoustics(directivity=kind) for kind in known if kind in told), Acoustics())
    if missing:
        raise BrokenFileError(f"{path}: expected {', '.join(missing)} beside the rest of the air; the file is damaged")
    acoustics = Acoustics(
        medium=Medium(
            density=values["air_density_kg_m3"],
            speed=values["air_speed_m_s"],
            attenuation=values["air_attenuation_np_m"],
            alpha=values["air_alpha"],
            temperature=values.get("air_temperature_c"),
            humidity=values.get("air_humidity"),
        ),
        directivity=values["directivity"],
    )
    acoustics.medium.check_speed(str(path))
    return acoustics


def _grid_from(values: Mapping[str, Any]) -> ControlGrid:
    return ControlGrid(
        rows=values["grid_rows"],
        columns=values["grid_columns"],
        pitch=values["grid_pitch_m"],
        height=values["grid_height_m"],
        centre=(values["grid_centre_x_m"], values["grid_centre_y_m"]),
    )


def _status_from(codes: np.ndarray, meanings: str, path: Path) -> tuple[Status, ...]:
    names = meanings.split()
    if not names or any(name not in get_args(Status) for name in names):
        raise BrokenFileError(f"{path}: expected {' '.join(get_args(Status))} as meanings of status, got {meanings!r}")
    if codes.min() < 0 or codes.max() >= len(names):
        raise BrokenFileError(f"{path}: expected status 0 to {len(names) - 1}, got {codes.min()} to {codes.max()}")
    known: tuple[Status, ...] = get_args(Status)
    return tuple(known[known.index(names[code])] for code in codes)
