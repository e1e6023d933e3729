"""Read a table of numbers from text, with errors that name line and column."""

import csv
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from midair.errors import BrokenFileError, NonFiniteError
from midair.files.text_files import is_number
from midair.progress import report_progress


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TextTable:
    """Columns of numbers."""

    names: tuple[str, ...]
    """Column names without surrounding spaces; () if the text has none."""
    values: NDArray[np.float64]
    """Shape (row, column), finite."""


class _Row(NamedTuple):
    line: int
    fields: list[str]


def read_table(text: str, path: Path, *, gaps: bool = False) -> TextTable:
    """Read numbers separated by commas, semicolons or tabs, with or without names; empty lines and # are skipped.

    With `gaps`, fields that are empty, NaN or infinite become NaN; otherwise they raise NonFiniteError.
    """
    rows = list(_rows(text, path))
    # A row is numeric if its first field is a number, or with gaps its first non-empty field.
    first = [field for field in rows[0].fields if field.strip() or not gaps] if rows else []
    names = () if not rows or _is_number(first[0]) else tuple(_stripped(rows.pop(0).fields))
    if not rows:
        raise BrokenFileError(f"{path}: expected rows of numbers, got none")
    width = len(names) or len(_stripped(rows[0].fields))
    for row in rows:
        _fit(row, width, path)
    return TextTable(names=names, values=_numbers(rows, names, path, gaps=gaps))


def _rows(text: str, path: Path) -> Iterator[_Row]:
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    first = next((line for line in lines if line.strip() and not line.startswith("#")), "")
    # The most frequent separator; a comma if there is none.
    reader = csv.reader(
        report_progress(lines, len(lines)), delimiter=max(",;\t", key=first.count), skipinitialspace=True
    )
    try:
        for fields in reader:
            if any(field.strip() for field in fields) and not fields[0].startswith("#"):
                yield _Row(line=reader.line_num, fields=fields)
    except csv.Error as wrong:
        raise BrokenFileError(
            f"{path}: expected comma-separated values, got line {reader.line_num}: {wrong}"
        ) from wrong


def _stripped(fields: list[str]) -> list[str]:
    """Fields without surrounding spaces, and without the empty field after a final comma."""
    fields = [field.strip() for field in fields]
    return fields[:-1] if len(fields) > 1 and not fields[-1] else fields


def _fit(row: _Row, width: int, path: Path) -> None:
    if len(row.fields) == width + 1 and not row.fields[-1].strip():
        del row.fields[-1]
    if len(row.fields) != width:
        raise BrokenFileError(
            f"{path}: expected {width} fields in line {row.line}, got {len(row.fields)}; "
            "the file is truncated or its rows differ"
        )


_SOME = 4096
"""Number of rows that are parsed at once."""


def _numbers(rows: list[_Row], names: tuple[str, ...], path: Path, *, gaps: bool) -> NDArray[np.float64]:
    if gaps:
        for row in rows:
            row.fields[:] = [field if field.strip() else "nan" for field in row.fields]
    try:
        some = [rows[first : first + _SOME] for first in range(0, len(rows), _SOME)]
        parts = [
            np.array([row.fields for row in part], np.float64) for part in report_progress(some, len(rows), weight=len)
        ]
        values = np.concatenate(parts)
        if any("_" in "".join(row.fields) for row in rows):  # NumPy accepts them
            raise ValueError("expected numbers, got underscores")
    except ValueError:
        # One by one, to locate the field that is not a number.
        values = np.array([[_number(row, i, names, path) for i in range(len(row.fields))] for row in rows])
    if gaps:
        values[~np.isfinite(values)] = np.nan
    elif not np.isfinite(values).all():
        row, column = (int(i) for i in np.argwhere(~np.isfinite(values))[0])
        raise NonFiniteError(
            f"{path}: expected finite numbers, got {rows[row].fields[column].strip()} in line {rows[row].line}, "
            f"{_column(column, names)}; midair mend fills short gaps"
        )
    return values


def _number(row: _Row, column: int, names: tuple[str, ...], path: Path) -> float:
    field = row.fields[column].strip()
    where = f"in line {row.line}, {_column(column, names)}"
    if not field:
        raise NonFiniteError(f"{path}: expected a number, got an empty field {where}; midair mend fills short gaps")
    if not _is_number(field):
        hint = "; write decimals with a point" if "," in field else ""
        raise BrokenFileError(f"{path}: expected a number, got {field[:40]!r} {where}{hint}")
    return float(field)


def _column(column: int, names: tuple[str, ...]) -> str:
    return f"column {names[column]!r}" if names else f"column {column + 1}"


def _is_number(field: str) -> bool:
    # Python reads 1_000 as 1000; other programs write no underscores in numbers.
    return "_" not in field and is_number(field)
