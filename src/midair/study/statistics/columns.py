"""Checked access to the columns of a table."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from midair.errors import InputError, NonFiniteError, ShapeError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pandas import DataFrame, Series

Array = NDArray[np.float64]


def frame_of(table: DataFrame | Mapping[str, Any]) -> DataFrame:
    """DataFrame with the index 0, 1, 2, ...; raises ShapeError unless all columns have one axis and the same length."""
    from pandas import DataFrame, Series

    shapes = {str(name): np.shape(table[name]) for name in table}
    if any(len(shape) != 1 for shape in shapes.values()) or len(set(shapes.values())) > 1:
        came = ", ".join(f"{name} {shape}" for name, shape in shapes.items())
        raise ShapeError(f"table: expected columns of one axis and one length, got shapes {came}")
    return DataFrame({str(name): Series(table[name]).to_numpy() for name in table})


def column(frame: DataFrame, name: str) -> Series:
    """Column with a value in every row; raises InputError if it is missing, NonFiniteError if a value is."""
    values = _found(frame, name)
    if values.isna().any():
        first = int(values.isna().argmax())
        raise NonFiniteError(f"column {name!r}: expected a value in every row, got none in row {first}; remove the row")
    return values


def numbers(frame: DataFrame, name: str) -> Array:
    """Column as finite float64; raises InputError if missing, empty or not numeric, NonFiniteError if not finite."""
    column = _found(frame, name)
    try:
        values = np.array(column.to_numpy(float, na_value=np.nan))
    except (TypeError, ValueError) as wrong:
        raise InputError(f"column {name!r}: expected numbers, got {column[:3].tolist()}") from wrong
    if not values.size:
        raise InputError(f"column {name!r}: expected answers, got an empty table")
    if not np.isfinite(values).all():
        first = int(np.flatnonzero(~np.isfinite(values))[0])
        raise NonFiniteError(f"column {name!r}: expected finite numbers, got {values[first]} in row {first}; remove it")
    return values


def levels(values: Series | NDArray[Any]) -> tuple[list[Any], NDArray[np.int64]]:
    """Unique values in order of first appearance, and the index of each row's value."""
    from pandas import factorize

    # With a sentinel, a missing value would get the index -1, which is the last level.
    number, order = factorize(values, use_na_sentinel=False)
    return order.tolist(), number.astype(np.int64)


def _found(frame: DataFrame, name: str) -> Series:
    if name not in frame:
        raise InputError(f"table: expected a column {name!r}, got {', '.join(frame) or 'no columns'}")
    return frame.loc[:, name]
