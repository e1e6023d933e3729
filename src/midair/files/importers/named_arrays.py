"""Recordings in named arrays, the common part of NPZ and MAT files."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from midair.errors import BrokenFileError, MismatchError
from midair.files.importers.header import parse_header, recording_from
from midair.files.opened_take import ImportedData, ImportOptions, OpenedTake


def from_arrays(arrays: Mapping[str, Any], form: str, path: Path, given: ImportOptions) -> OpenedTake:
    """The recording in named arrays of midair, or in the only array of frames of another program."""
    if "midair" in arrays:
        return _own(arrays, path, given)
    name = _chosen(arrays, path, given)
    samples = np.asarray(arrays[name], np.float64)
    report: tuple[str, ...] = ()
    if samples.ndim == 1 or samples.shape[0] == 1:
        report = (f"Array {name} {samples.shape} was taken as one channel of {samples.size} frames.",)
        samples = samples.reshape(-1, 1)
    return ImportedData(samples=samples, form=form, settings={"array": name}, report=report).resolve(given, path)


def _chosen(arrays: Mapping[str, Any], path: Path, given: ImportOptions) -> str:
    """Name of the array of frames: the chosen one, or "samples", or the only one."""
    names = [name for name, array in arrays.items() if _frames(array)]
    found = ", ".join(f"{name} {np.shape(array)}" for name, array in arrays.items()) or "nothing"
    if given.stream is not None:
        if given.stream not in names:
            raise MismatchError(f"{path}: expected an array of frames called {given.stream!r}, got {found}")
        return given.stream
    for only in (["samples"] if "samples" in names else [], [name for name in names if arrays[name].ndim > 1], names):
        if len(only) == 1:
            return only[0]
    raise BrokenFileError(
        f"{path}: expected one array of numbers with axes (frame, channel) or (frame, row, column), or one called "
        f"samples, or the name of one as stream, got {found}"
    )


def _own(arrays: Mapping[str, Any], path: Path, given: ImportOptions) -> OpenedTake:
    header = parse_header(_text(arrays["midair"]), path)
    samples = np.asarray(arrays["samples"], np.float64)
    for name, stated in (("rate", header["rate_hz"]), ("unit", header["unit"])):
        have = _text(arrays[name]) if name == "unit" else np.asarray(arrays[name]).item()
        if have != stated:
            raise BrokenFileError(f"{path}: {name} was edited: expected {stated} as in the header, got {have}")
    recording = recording_from(header, samples, path)
    given.check(recording, path)
    return OpenedTake(recording=recording)


def _frames(array: Any) -> bool:
    """True for more than one real number with one to three axes."""
    return isinstance(array, np.ndarray) and array.dtype.kind in "fiu" and array.ndim in (1, 2, 3) and array.size > 1


def _text(array: Any) -> str:
    value: NDArray[Any] = np.asarray(array)
    if value.dtype.kind != "U" or value.size != 1:
        raise BrokenFileError(f"expected one piece of text, got {value.dtype} of shape {value.shape}")
    return str(value.reshape(-1)[0])
