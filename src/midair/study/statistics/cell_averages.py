"""Mean of each participant in each cell of a complete within-subject design."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from midair.errors import InputError
from midair.study.statistics.columns import column, frame_of, levels, numbers

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from pandas import DataFrame

Array = NDArray[np.float64]


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
    found = [levels(column(data, name)) for name in within]
    shape = (len(people), *(len(order) for order, _ in found))
    for name, (order, _) in zip(within, found, strict=True):
        if len(order) < 2:
            raise InputError(f"factor {name!r}: expected two or more levels, got {order}; remove it from `within`")
    cell = np.ravel_multi_index((person, *(number for _, number in found)), shape)
    count = np.bincount(cell, minlength=int(np.prod(shape))).reshape(shape)
    total = np.bincount(cell, weights=values, minlength=count.size).reshape(shape)
    if (count == 0).any():
        where = np.argwhere(count == 0)
        first = [order[i] for (order, _), i in zip(found, where[0][1:], strict=True)]
        what = ", ".join(f"{name}={level}" for name, level in zip(within, first, strict=True))
        raise InputError(
            f"cells: expected an answer in every cell, got none from participant {people[where[0][0]]} at {what}"
            f" ({len(where)} empty cells in all); exclude the participant, or use the mixed model"
        )
    return CellMeans(mean=total / count, participants=tuple(people), levels=tuple(tuple(order) for order, _ in found))
