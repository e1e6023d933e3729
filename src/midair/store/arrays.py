"""A recording in named arrays: what NPZ and MAT files have in common."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from midair.errors import BrokenFileError
from midair.store.header import parse_header, recording_from
from midair.store.imported import Foreign, Given, Imported


def from_arrays(arrays: Mapping[str, Any], form: str, path: Path, given: Given) -> Imported:
    """The recording that named arrays hold: midair's own, or the one array that can be frames.

    Raises
    ------
    BrokenFileError
        If midair's arrays contradict each other, or none or several of another program's can be frames.
    """
    if "midair" in arrays:
        return _own(arrays, path, given)
    names = [name for name, array in arrays.items() if _frames(array)]
    if "samples" in names:
        names = ["samples"]
    if len(names) != 1:
        found = ", ".join(f"{name} {np.shape(array)}" for name, array in arrays.items()) or "nothing"
        raise BrokenFileError(
            f"{path}: expected one array of numbers with axes (frame, channel) or (frame, row, column), or one called "
            f"samples, got {found}"
        )
    samples = np.asarray(arrays[names[0]], np.float64)
    return Foreign(samples=samples, form=form, settings={"array": names[0]}).settle(given, path)


def _own(arrays: Mapping[str, Any], path: Path, given: Given) -> Imported:
    header = parse_header(_text(arrays["midair"]), path)
    samples = np.asarray(arrays["samples"], np.float64)
    for name, stated in (("rate", header["rate_hz"]), ("unit", header["unit"])):
        have = _text(arrays[name]) if name == "unit" else np.asarray(arrays[name]).item()
        if have != stated:
            raise BrokenFileError(f"{path}: {name} was edited: expected {stated}, as its header says, got {have}")
    recording = recording_from(header, samples, path)
    given.check(recording, path)
    return Imported(recording=recording)


def _frames(array: Any) -> bool:
    """Whether an array can be frames: numbers, real, with two or three axes, and more than one number."""
    return isinstance(array, np.ndarray) and array.dtype.kind in "fiu" and array.ndim in (2, 3) and array.size > 1


def _text(array: Any) -> str:
    value: NDArray[Any] = np.asarray(array)
    if value.dtype.kind != "U" or value.size != 1:
        raise BrokenFileError(f"expected one piece of text, got {value.dtype} of shape {value.shape}")
    return str(value.reshape(-1)[0])
