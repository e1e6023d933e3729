"""Checked access to the columns of a table, and means of the cells of a within-subject design."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pandas import DataFrame, Series, factorize

from midair.array_types import Array
from midair.errors import InputError, NonFiniteError, ShapeError

Levels = tuple[list[Any], NDArray[np.int64]]


def frame_of(table: DataFrame | Mapping[str, Any]) -> DataFrame:
    """DataFrame with the index 0, 1, 2, ...; raises ShapeError unless all columns have one axis and the same length."""
    shapes = {str(name): np.shape(table[name]) for name in table}
    if any(len(shape) != 1 for shape in shapes.values()) or len(set(shapes.values())) > 1:
        came = ", ".join(f"{name} {shape}" for name, shape in shapes.items())
        raise ShapeError(f"table: expected columns of one axis and one length, got shapes {came}")
    return DataFrame({str(name): Series(table[name]).to_numpy() for name in table})


BLANK = ("", "n/a", "NA", "nan", "NaN", "null", "undefined")
"""Fields of a table without a value: empty, as in BIDS, as in R, and as Python and JavaScript write them."""


def is_blank(values: Series) -> NDArray[np.bool_]:
    """Whether each value is missing or a field of `BLANK`."""
    return (values.isna() | values.astype(str).str.strip().isin(BLANK)).to_numpy(bool)


def typed(column: Series) -> Series:
    """Column of text as booleans or numbers if all fields are; a number with a leading zero, such as 01, is a name."""
    if column.isin(["true", "false", "True", "False"]).all():
        return column.str.lower() == "true"
    if column.str.match(r"0\d").any():
        return column
    try:
        return column.astype(float)
    except ValueError:
        return column


def column(frame: DataFrame, name: str) -> Series:
    """Column with a value in every row; raises InputError if it is missing, NonFiniteError if a value is."""
    values = any_column(frame, name)
    if values.isna().any():
        first = int(values.isna().argmax())
        raise NonFiniteError(f"column {name!r}: expected a value in every row, got none in row {first}; remove the row")
    return values


def numbers(frame: DataFrame, name: str) -> Array:
    """Column as finite float64; raises InputError if missing, empty or not numeric, NonFiniteError if not finite."""
    column = any_column(frame, name)
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


def levels(values: Series | NDArray[Any]) -> Levels:
    """Unique values in order of first appearance, and the index of each row's value."""
    # With a sentinel, a missing value would get the index -1, which is the last level.
    number, order = factorize(values, use_na_sentinel=False)
    return order.tolist(), number.astype(np.int64)


def factors(frame: DataFrame, names: Sequence[str], *, option: str = "within") -> list[Levels]:
    """`levels` of each factor; raises InputError if one has a single level, with the name of the option to change."""
    found = [levels(column(frame, name)) for name in names]
    for name, (order, _) in zip(names, found, strict=True):
        if len(order) < 2:
            raise InputError(f"factor {name!r}: expected two or more levels, got {order}; remove it from `{option}`")
    return found


def any_column(frame: DataFrame, name: str) -> Series:
    """Column, with or without missing values; raises InputError if it does not exist."""
    if name not in frame:
        raise InputError(f"table: expected a column {name!r}, got {', '.join(frame) or 'no columns'}")
    return frame.loc[:, name]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CellMeans:
    """Mean of each participant in each cell of a complete within-subject design."""

    mean: Array
    """Shape (participant, level of the first factor, level of the second, ...), in the unit of the values."""
    participants: tuple[Any, ...]
    levels: tuple[tuple[Any, ...], ...]
    """Levels of each factor."""


def cell_means(
    table: DataFrame | Mapping[str, Any], *, value: str, participant: str, within: Sequence[str]
) -> CellMeans:
    """Average the trials of each participant in each cell.

    Raises InputError if a column is missing, a factor has one level or a cell is empty, NonFiniteError for a missing
    value.
    """
    data = frame_of(table)
    values = numbers(data, value)
    people, person = levels(column(data, participant))
    found = factors(data, within)
    shape = (len(people), *(len(order) for order, _ in found))
    cell = np.ravel_multi_index((person, *(number for _, number in found)), shape)
    count = np.bincount(cell, minlength=int(np.prod(shape))).reshape(shape)
    total = np.bincount(cell, weights=values, minlength=count.size).reshape(shape)
    if (count == 0).any():
        where = np.argwhere(count == 0)
        first = [order[i] for (order, _), i in zip(found, where[0][1:], strict=True)]
        what = ", ".join(f"{name}={level}" for name, level in zip(within, first, strict=True))
        raise InputError(
            f"cells: expected an answer in every cell, got none from participant {people[where[0][0]]} at {what}"
            f" ({len(where)} empty cells in all); exclude the participant, or use the mixed models of the R script"
        )
    return CellMeans(mean=total / count, participants=tuple(people), levels=tuple(tuple(order) for order, _ in found))
