"""Checks of input values, and read-only copies of arrays."""

from collections.abc import Sequence
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from midair.errors import InputError, NonFiniteError, ShapeError
from midair.streaming import LazyFrames


def frozen_array(
    value: "ArrayLike | LazyFrames",
    name: str,
    axes: Sequence[str | int],
    dtype: DTypeLike = np.float64,
    *,
    finite: bool = True,
) -> NDArray[Any]:
    """A read-only copy of `value` whose axes and numbers have been checked; lazy frames are checked when read.

    Each entry of `axes` is an axis: a word for any length from 1 on, a number for a fixed length. Raises ShapeError or
    NonFiniteError.
    """
    if isinstance(value, LazyFrames):
        _check_shape(value.shape, name, axes)
        # Type checkers treat lazy frames as an array.
        return cast("NDArray[Any]", value)
    try:
        array = np.array(value, dtype=dtype, order="C")
    except (TypeError, ValueError) as wrong:
        raise ShapeError(f"{name}: expected numbers with axes {_axes(axes)}, got {type(value).__name__}") from wrong
    _check_shape(array.shape, name, axes)
    if finite:
        check_finite(array, name)
    array.flags.writeable = False
    return array


def check_finite(array: NDArray[Any], name: str, *, frame: int = 0) -> None:
    """Raise NonFiniteError if a number is NaN or infinite; `frame` is the number of the array's first frame."""
    if not np.isfinite(array).all():
        first = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        place = (first[0] + frame, *first[1:]) if first else first
        raise NonFiniteError(
            f"{name}: expected finite numbers, got {array[first]} at {place}; midair mend fills short gaps"
        )


def _check_shape(shape: tuple[int, ...], name: str, axes: Sequence[str | int]) -> None:
    fits = len(shape) == len(axes) and all(
        have == want if isinstance(want, int) else have > 0 for have, want in zip(shape, axes, strict=True)
    )
    if not fits:
        raise ShapeError(f"{name}: expected axes {_axes(axes)}, got shape {shape}")


def positive(value: float, name: str, unit: str = "") -> float:
    """Return `value` as a float if it is finite and above zero; otherwise raise InputError."""
    number = float(value)
    if not (np.isfinite(number) and number > 0):
        raise InputError(f"{name}: expected a number above 0{' ' + unit if unit else ''}, got {number:g}")
    return number


PITCHES = (1e-6, 0.2)
"""Allowed distances between grid points, in m."""


def length(value: float, name: str, limits: tuple[float, float]) -> float:
    """Return `value` as a float if it is within the limits, in m; otherwise raise InputError."""
    number, (low, high) = float(value), limits
    if not low <= number <= high:
        hint = f"; lengths are in metres, {number:g} mm is {number / 1e3:g}" if low <= number / 1e3 <= high else ""
        raise InputError(f"{name}: expected {low:g} to {high:g} m, got {number:g} m{hint}")
    return number


def _axes(axes: Sequence[str | int]) -> str:
    return "(" + ", ".join(str(axis) for axis in axes) + ")"
