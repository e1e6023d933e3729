"""Tables: named columns of one length, read from a dict of arrays or a pandas DataFrame alike."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from midair.errors import InputError, NonFiniteError, ShapeError

Array = NDArray[np.float64]


class Columns(Protocol):
    """What a table may come as: a dict of arrays, a `Table`, a pandas DataFrame."""

    def keys(self) -> Iterable[Any]:
        """Names of the columns."""
        ...

    def __getitem__(self, name: str, /) -> Any:
        """One column."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class Table(Mapping[str, NDArray[Any]]):
    """Named columns of one length.

    ``table["F"]`` is a column, ``table.row({"effect": "surface"})["F"]`` a number, ``pandas.DataFrame(dict(table))`` a
    frame.

    Attributes
    ----------
    columns : mapping of str to ndarray, shape (row,)
        Read-only, in order.
    """

    columns: Mapping[str, NDArray[Any]]

    def __post_init__(self) -> None:
        columns = {str(name): _column(str(name), values) for name, values in self.columns.items()}
        if len({len(values) for values in columns.values()}) > 1:
            sizes = ", ".join(f"{name} {len(values)}" for name, values in columns.items())
            raise ShapeError(f"table: expected columns of one length, got {sizes}")
        object.__setattr__(self, "columns", columns)

    @classmethod
    def of(cls, table: Columns) -> "Table":
        """Any mapping of columns as a `Table`."""
        return table if isinstance(table, Table) else cls({str(name): table[name] for name in table.keys()})  # noqa: SIM118

    @classmethod
    def from_rows(cls, rows: Iterable[Mapping[str, Any]]) -> "Table":
        """A table of rows that all have the same keys."""
        listed = list(rows)
        names = list(listed[0]) if listed else []
        return cls({name: np.array([row[name] for row in listed]) for name in names})

    def __getitem__(self, name: str, /) -> NDArray[Any]:
        if name not in self.columns:
            raise InputError(f"table: expected a column {name!r}, got {', '.join(self.columns) or 'no columns'}")
        return self.columns[name]

    def __contains__(self, name: object) -> bool:
        return name in self.columns

    def __iter__(self) -> Iterator[str]:
        return iter(self.columns)

    def __len__(self) -> int:
        return len(self.columns)

    @property
    def height(self) -> int:
        """Number of rows."""
        return len(next(iter(self.columns.values()))) if self.columns else 0

    @property
    def rows(self) -> list[dict[str, Any]]:
        """Each row as a dict of plain Python values."""
        lists = {name: values.tolist() for name, values in self.columns.items()}
        return [{name: lists[name][i] for name in lists} for i in range(self.height)]

    def row(self, match: Mapping[str, Any]) -> dict[str, Any]:
        """The one row whose columns have these values.

        Raises
        ------
        InputError
            If no row fits, or more than one.
        """
        found = self.where(match).rows
        if len(found) != 1:
            raise InputError(f"table: expected one row with {dict(match)}, got {len(found)}")
        return found[0]

    def where(self, match: Mapping[str, Any]) -> "Table":
        """The rows whose columns have these values."""
        keep = np.ones(self.height, bool)
        for name, value in match.items():
            keep &= np.array([item == value for item in self[name].tolist()], bool)
        return self.take(keep)

    def take(self, rows: NDArray[Any]) -> "Table":
        """Rows by a mask or by their numbers."""
        return Table({name: values[rows] for name, values in self.columns.items()})


def levels(values: NDArray[Any]) -> tuple[list[Any], NDArray[np.int64]]:
    """The different values in the order in which they first appear, and the number of each row's value."""
    listed = values.tolist()
    order = list(dict.fromkeys(listed))
    number = {value: i for i, value in enumerate(order)}
    return order, np.array([number[value] for value in listed], np.int64)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CellMeans:
    """Mean of every participant in every cell of a within-participant design.

    Attributes
    ----------
    mean : ndarray, shape (participant, level of the first factor, level of the second, ...)
        In the unit of the values.
    participants : tuple
        One a row.
    levels : tuple of tuple
        Of each factor.
    """

    mean: Array
    participants: tuple[Any, ...]
    levels: tuple[tuple[Any, ...], ...]


def cell_means(table: Columns, *, value: str, participant: str, within: Sequence[str]) -> CellMeans:
    """Average the trials of each participant in each cell.

    Parameters
    ----------
    table : mapping of columns
        One row an answer.
    value, participant, within
        Names of the columns.

    Returns
    -------
    Cells
        Complete: no cell is empty.

    Raises
    ------
    InputError
        If a factor has one level, or a participant lacks a cell (which is named).
    NonFiniteError
        If a value is missing or infinite.
    """
    data = Table.of(table)
    values = numbers(data, value)
    people, person = levels(data[participant])
    found = [levels(data[name]) for name in within]
    shape = (len(people), *(len(order) for order, _ in found))
    for name, (order, _) in zip(within, found, strict=True):
        if len(order) < 2:
            raise InputError(f"factor {name!r}: expected two or more levels, got {order}; leave it out of `within`")
    cell = np.ravel_multi_index((person, *(number for _, number in found)), shape)
    count = np.bincount(cell, minlength=int(np.prod(shape))).reshape(shape)
    total = np.bincount(cell, weights=values, minlength=count.size).reshape(shape)
    if (count == 0).any():
        where = np.argwhere(count == 0)
        first = [order[i] for (order, _), i in zip(found, where[0][1:], strict=True)]
        what = ", ".join(f"{name}={level}" for name, level in zip(within, first, strict=True))
        raise InputError(
            f"cells: expected an answer in every cell, got none from participant {people[where[0][0]]} at {what}"
            f" ({len(where)} empty in all); leave the participant out, or use the mixed model"
        )
    return CellMeans(mean=total / count, participants=tuple(people), levels=tuple(tuple(order) for order, _ in found))


def numbers(table: Table, name: str) -> Array:
    """A column as finite float64.

    Raises
    ------
    InputError
        If it holds something else than numbers.
    NonFiniteError
        If one is missing or infinite.
    """
    try:
        values = table[name].astype(float)
    except (TypeError, ValueError) as wrong:
        raise InputError(f"column {name!r}: expected numbers, got {table[name][:3].tolist()}") from wrong
    if not values.size:
        raise InputError(f"column {name!r}: expected answers, got an empty table")
    if not np.isfinite(values).all():
        first = int(np.flatnonzero(~np.isfinite(values))[0])
        raise NonFiniteError(f"column {name!r}: expected finite numbers, got {values[first]} in row {first}; remove it")
    return values


def _column(name: str, values: Any) -> NDArray[Any]:
    column = np.array(values)
    if column.ndim != 1:
        raise ShapeError(f"column {name!r}: expected one axis, got shape {column.shape}")
    if column.dtype == object and any(item is None or item != item for item in column.tolist()):
        raise NonFiniteError(f"column {name!r}: expected a value in every row, got a missing one; remove the row")
    column.flags.writeable = False
    return column
