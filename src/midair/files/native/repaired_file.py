"""Repair recordings and drives: keep what can be read, and mark frames whose checksum does not match."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from midair.errors import BrokenFileError
from midair.files.atomic import check_not_recording
from midair.files.native.calibration_file import load_calibration
from midair.files.native.checksums import Ranges, ranges_text
from midair.files.native.drive_file import read_drive, save_solution, solution_from, target_from
from midair.files.native.hdf5 import kind_of, open_file
from midair.files.native.recording_file import load_played, load_pressure, read_values, take_from, write_recording
from midair.files.native.schema import time_values
from midair.model import Event, PressureFrames
from midair.streaming import LazyFrames, blocks, read_frames

Part = TypeVar("Part")


def repair(path: str | os.PathLike[str]) -> tuple[str, ...]:
    """Close a recording whose writer was killed, and keep the undamaged frames of a recording or a drive.

    Damaged frames of a recording hold the last good frame and are listed as lost; those of a drive are silent. Other
    damaged parts are left out. The file is replaced atomically, with checksums. Returns sentences on what was repaired;
    none if the file was closed correctly and is undamaged. Raises MissingFileError, BrokenFileError, UnknownFormatError
    or FileError if no frame can be read, the file cannot be written, or a program is still recording into it.
    """
    place = Path(path)
    check_not_recording(place)
    with open_file(place) as file:
        kind = kind_of(file)
    if kind == "midair drive":
        return _repair_drive(place)
    if kind in ("midair calibration", "midair array"):
        raise BrokenFileError(
            f"{path}: expected a recording or a drive, got a {kind}; copy the file again, or measure again"
        )
    return _repair_recording(place)


def _repair_recording(path: Path) -> tuple[str, ...]:
    damage: dict[str, Ranges] = {}
    with open_file(path) as file:
        values, report = read_values(file, path, streamed=True, damage=damage)
    notes = [*report]
    lost = [(first, min(last, len(values["samples"]))) for first, last in damage.get("samples", ())]
    if "provenance" in damage:
        notes.append("The provenance was edited or damaged and is kept as it is.")
    if "time" in damage:
        values |= time_values(len(values["samples"]), values["rate_hz"])
    for axis, text in (("event", "list of events"), ("stage", "list of stage positions")):
        names = [name for name in values if name.split("_")[0] == axis]
        if not damage.keys().isdisjoint(names):
            notes.append(f"The {text} was damaged and left out.")
            values = {name: value for name, value in values.items() if name not in names}
    if lost:
        values["samples"] = _held(values["samples"], lost, path)
        count = sum(last - first for first, last in lost)
        notes.append(
            f"{count} of {len(values['samples'])} frames were damaged in every channel, {ranges_text(lost)}: they hold "
            "the last good frame and are listed as lost."
        )
    take = take_from(values, path, [Event(kind="lost", frame=first, frames=last - first) for first, last in lost])
    calibration = _undamaged(lambda: load_calibration(path), "calibration", notes)
    pressure = _undamaged(lambda: _pressure(path), "calibrated pressure", notes)
    played = _undamaged(lambda: load_played(path), "live touch", notes)
    write_recording(take.recording, path, calibration, pressure, played=played)
    return tuple(notes)


def _held(samples: LazyFrames, lost: Ranges, path: Path) -> LazyFrames:
    """Samples whose lost frames hold the last good one, or at the start the first."""
    good = np.ones(len(samples), bool)
    for first, last in lost:
        good[first:last] = False
    if not good.any():
        raise BrokenFileError(f"{path}: expected an undamaged frame, got none; copy the file again")
    held = np.maximum.accumulate(np.where(good, np.arange(len(good)), int(np.argmax(good))))
    frames = {int(place): samples.read(int(place), int(place) + 1)[0] for place in np.unique(held[~good])}

    def read(first: int, last: int) -> np.ndarray:
        block = samples.read(first, last).copy()
        for at in np.flatnonzero(~good[first:last]):
            block[at] = frames[int(held[first + at])]
        return block

    return LazyFrames(read, samples.shape, stored=samples.stored)


def _undamaged(read: Callable[[], Part], what: str, notes: list[str]) -> Part | None:
    """A part of a recording; None, and a note, if it is damaged."""
    try:
        return read()
    except BrokenFileError as wrong:
        notes.append(f"The {what} was damaged and left out ({wrong}).")
        return None


def _pressure(path: Path) -> PressureFrames | None:
    found = load_pressure(path, streamed=True)
    # Lazy frames are checked only when they are read.
    for _ in blocks(found.pressure) if found else ():
        pass
    return found


def _repair_drive(path: Path) -> tuple[str, ...]:
    damage: dict[str, Ranges] = {}
    values = read_drive(path, streamed=True, damage=damage)
    geometry = [name for name in damage if name.startswith(("transducer_", "response_")) and name != "transducer_level"]
    if geometry:
        raise BrokenFileError(
            f"{path}: expected an undamaged array, got damage in {', '.join(geometry)}; copy the file or solve again"
        )
    notes: list[str] = []
    if not damage.keys().isdisjoint(("provenance", "target_provenance")):
        notes.append("The provenance was edited or damaged and is kept as it is.")
    if "target" in damage:
        notes.append("The target was damaged and left out.")
        del values["target"]
    frames = len(values["error"])
    values |= time_values(frames, values["rate_hz"]) if "time" in damage else {}
    silent = {"phase": 0.0, "level": 0.0, "transducer_level": 0.0, "error": 1.0, "iterations": 0}
    silent["status"] = values["flag_meanings"].split().index("silent")
    lost = np.zeros(frames, bool)
    for first, last in (each for name in silent for each in damage.get(name, ())):
        lost[first:last] = True
    if lost.any():
        edges = np.flatnonzero(np.diff(np.concatenate([[False], lost, [False]]).astype(np.int8))).reshape(-1, 2)
        values |= {name: _silenced(values[name], lost, level) for name, level in silent.items() if name in values}
        ranges = [(int(first), int(last)) for first, last in edges]
        notes.append(f"{lost.sum()} of {frames} frames were damaged, {ranges_text(ranges)}: they are silent.")
    save_solution(solution_from(values, path), path, target=target_from(values, path))
    return tuple(notes)


def _silenced(x: "np.ndarray | LazyFrames", lost: np.ndarray, value: float) -> Any:
    def read(first: int, last: int) -> np.ndarray:
        block = np.array(read_frames(x, first, last))
        block[lost[first:last]] = value
        return block

    return LazyFrames(read, x.shape, stored=x.stored) if isinstance(x, LazyFrames) else read(0, len(x))
