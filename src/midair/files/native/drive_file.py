"""Drives, `name.drive.h5`: transducer phases and levels, errors of the solution, and the target.

For AUTD3 units, phases and levels of single transducers are stored as the bytes that the units play, compressed; for
other arrays as float64 without rounding. Targets are rounded to 13 binary digits, of which float32 compresses well.
"""

import json
import os
from collections.abc import Generator, Iterable, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from midair.errors import BrokenFileError, MismatchError, UnknownFormatError
from midair.files.native.hdf5 import (
    changed_file,
    fixed_text,
    new_file,
    plain_text,
    read_group,
    write_frames,
    write_group,
)
from midair.files.native.raw_recording import open_file
from midair.files.native.schema import built, stored_values
from midair.files.text_files import json_of
from midair.model import AmplitudeFrames, Drive, Solution
from midair.progress import report_progress
from midair.streaming import block_ranges, blocks, each_frame

DRIVE_SUFFIX = ".drive.h5"

AUTD3_TRANSDUCERS = 249
"""Number of transducers of an AUTD3 unit, which plays phases in 256 steps to a turn and levels in 255 steps."""

_TURN = 256 / (2 * np.pi)
"""Steps of the phase in a radian."""

_SPLITTER = np.float32(2**11 + 1)
"""Factor by which a float32 is split into 13 binary digits and a rest (Dekker 1971, Numerische Mathematik 18, 224)."""


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
        write_group(file, "drive", {**_drive_values(first.drive), **values}, frames=frames)
        for part in report_progress(coming, frames, weight=lambda part: part.drive.frames):
            write_frames(file, _frame_values(part), done)
            done += part.drive.frames
        if done != frames:
            raise MismatchError(f"{path}: expected a drive of {frames} frames, got {done}")
        if target is not None:
            written = 0
            for block in blocks(target.amplitude):
                values = {"target": _rounded(block)}
                if written:
                    write_frames(file, values, written)
                else:
                    known = stored_values("drive", SimpleNamespace(target=target))
                    write_group(file, "drive", {**known, **values}, frames=frames)
                written += len(block)


def load_solution(path: str | os.PathLike[str], *, streamed: bool = False) -> Solution:
    """Read a drive with its errors, exactly as it was saved; phases and transducer levels lazily if `streamed`.

    Raises MissingFileError, BrokenFileError or UnknownFormatError if the file does not exist, is damaged or of another
    type, or was written by a newer midair; a subclass of InputError that names invalid values.
    """
    with _opened(path, streamed=streamed) as values:
        level = values.get("level", values.get("transducer_level"))
        if level is None or ("level" in values and "transducer_level" in values):
            raise BrokenFileError("expected either level or transducer_level; the file is damaged")
        if "phase" not in values:
            raise BrokenFileError("expected either phase or phase_step; the file is damaged")
        drive = built(Drive, "drive", values, phase=values["phase"], level=each_frame(level, _checked))
        drive.acoustics.medium.check_speed(str(path))
        return built(Solution, "drive", values, drive=drive)


def load_target(path: str | os.PathLike[str], *, streamed: bool = False) -> AmplitudeFrames | None:
    """Read the target of a drive, lazily if `streamed`; None if the file has none.

    Errors are those of `load_solution`.
    """
    with _opened(path, streamed=streamed) as values:
        if "target" not in values:
            return None
        return built(AmplitudeFrames, "drive", values, "target", rate=values["rate_hz"])


def store_prediction(path: Path, values: Mapping[str, object]) -> None:
    """Add what the model predicts for a drive to its file, which nothing else has open; FileError if it fails."""
    with changed_file(path) as file:
        file.attrs["predicted"] = fixed_text(json.dumps(values))


def load_prediction(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Values of `store_prediction`, none if it has none; errors are those of `load_solution`."""
    with open_file(path) as file:
        held = json_of(plain_text(file.attrs.get("predicted")) or "{}")
        if not isinstance(held, dict):
            raise BrokenFileError(f"expected predicted to be an object in JSON, got {held!r}")
        return held


@contextmanager
def _opened(path: str | os.PathLike[str], *, streamed: bool) -> Generator[dict[str, Any]]:
    """Stored values of a drive."""
    with open_file(path) as file:
        values = read_group(file, "drive", Path(path), streamed=streamed)
        for stored, name, steps in (("phase_step", "phase", _TURN), ("level_step", "transducer_level", 255)):
            if stored in values:
                values[name] = each_frame(values.pop(stored), lambda byte, steps=steps: byte / steps)
        yield values


def _drive_values(drive: Drive) -> dict[str, Any]:
    """Stored values of a drive without those of its frames."""
    left_out = ("response_real", "response_imag") if drive.array.alike else ()
    return {name: value for name, value in stored_values("drive", drive).items() if name not in left_out}


def _rounded(target: NDArray[Any]) -> NDArray[Any]:
    """A target to 1.2e-4 of each number: phases of 8 bits miss it by far more, and the file is two fifths smaller."""
    exact = target.astype(np.float32)
    large = _SPLITTER * exact
    return large - (large - exact)


def _frame_values(part: Solution) -> dict[str, np.ndarray]:
    """Stored values of the frames of a part."""
    drive, stored = part.drive, stored_values("drive", part)
    phase, level = np.asarray(drive.phase), np.asarray(drive.level)
    values: dict[str, np.ndarray] = {name: np.asarray(stored[name]) for name in ("error", "iterations", "status")}
    values["level" if level.ndim == 1 else "transducer_level"] = level
    if not (np.bincount(drive.array.unit) == AUTD3_TRANSDUCERS).all():
        return {**values, "phase": phase}
    if level.ndim == 2:
        values["level_step"] = _steps(values.pop("transducer_level"), 255)
    return {**values, "phase_step": _steps(phase, _TURN)}


def _steps(x: np.ndarray, steps: float) -> NDArray[np.uint8]:
    """Numbers in steps, modulo 256."""
    return np.mod(np.rint(x * steps), 256).astype(np.uint8)


def _checked(level: np.ndarray) -> np.ndarray:
    if not (level.min() >= 0 and level.max() <= 1):
        raise BrokenFileError(f"level: expected 0 to 1 of full drive, got {level.min():g} to {level.max():g}")
    return level
