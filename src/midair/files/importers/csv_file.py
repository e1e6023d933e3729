"""Comma-separated values: midair's own with a header that makes them exact, those of other programs, poses of a palm.

FabricSlide (Wang et al. 2022, doi 10.3389/fnbot.2022.808222): a robot arm slides a capacitive finger with 16 taxels
over fabrics and gratings. Columns: timestamp in ms, two proximity readings, channel1 to channel16 in raw counts, at
about 35.6 Hz. File names are material_F<force set-point>_V<velocity>mmps_<repeat>.

Cluster Haptic Texture Dataset (Eguchi et al., arXiv 2407.16206): time in s and acceleration X, Y, Z in g, or force in
N, at 6 kHz with uneven times. File names are <texture>_<direction>_<speed>_<force>_<repeat>. LMT Haptic Texture
Database: one number a line; only its file names are known here, <material>_<motion>_<axis>_<train or test><number>.
"""

import csv
import os
import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array
from midair.errors import BrokenFileError, InputError, NonFiniteError
from midair.files.atomic import atomic_file, write_file
from midair.files.importers.header import header_of, own_take
from midair.files.opened_take import Format, FormatLoss, ImportedData, ImportOptions, OpenedTake
from midair.files.text_files import read_text, without_formulas
from midair.model import PalmPath, Recording, SensorGrid
from midair.progress import report_progress
from midair.streaming import blocks
from midair.validation import is_number


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
            f"{_column(column, names)}; midair import --mend fills short gaps"
        )
    return values


def _number(row: _Row, column: int, names: tuple[str, ...], path: Path) -> float:
    field = row.fields[column].strip()
    where = f"in line {row.line}, {_column(column, names)}"
    if not field:
        raise NonFiniteError(
            f"{path}: expected a number, got an empty field {where}; midair import --mend fills short gaps"
        )
    if not _is_number(field):
        hint = "; write decimals with a point" if "," in field else ""
        raise BrokenFileError(f"{path}: expected a number, got {field[:40]!r} {where}{hint}")
    return float(field)


def _column(column: int, names: tuple[str, ...]) -> str:
    return f"column {names[column]!r}" if names else f"column {column + 1}"


def _is_number(field: str) -> bool:
    # Python reads 1_000 as 1000; other programs write no underscores in numbers.
    return "_" not in field and is_number(field)


MARK = "# midair "
"""First characters of midair's own files."""


def write_csv(recording: Recording, path: Path) -> tuple[FormatLoss, ...]:
    """Write the header as a comment, a row of names, and a row per frame, all numbers without loss."""
    sensor = recording.sensor
    cells = [
        f"row{row}_column{column} [{recording.unit}]" for row in range(sensor.rows) for column in range(sensor.columns)
    ]
    with atomic_file(path) as partial, partial.open("w", encoding="ascii", newline="\n") as file:
        file.write(f"{MARK}{without_formulas(header_of(recording))}\n")
        file.write(",".join(["time [s]", *cells]) + "\n")
        # repr gives the shortest text that is read back as the same number.
        first = 0
        for block in blocks(recording.samples, 4096):
            time = np.arange(first, first + len(block)) / recording.rate
            table = np.column_stack([time, block.reshape(len(block), -1)])
            file.writelines(",".join(map(repr, row)) + "\n" for row in table.tolist())
            first += len(block)
    return ()


def read_csv(path: Path, given: ImportOptions) -> OpenedTake:
    """Read a CSV of midair, of FabricSlide, or of any program that writes one channel per column.

    A column named time, timestamp or t gives the rate; brackets in the other names give the unit.
    """
    # utf-8-sig, because a byte-order mark would become a part of the first name.
    text = path.read_bytes().decode("utf-8-sig")
    if text.startswith(MARK):
        return _own(text, path, given)
    table = read_table(text, path, gaps=given.mending is not None)
    if table.names == FABRICSLIDE:
        layout = {} if given.sensor else {"layout": _LAYOUT}
        return ImportedData(
            samples=table.values[:, 3:],
            form="CSV of FabricSlide",
            stamps=table.values[:, 0],
            clock="time [ms]",
            unit="count",
            names=FABRICSLIDE[3:],
            sensor=SensorGrid(name="CPM-finger of FabricSlide"),
            notes={**_named(path)[0], **layout},
            settings={"left_out": FABRICSLIDE[1:3]},
            report=("Columns proximity1 and proximity2 were left out: not taxels.", *layout.values()),
        ).resolve(given, path)
    notes, report = _named(path)
    if table.names in _CLUSTER and notes:
        given = replace(given, rate=given.rate or 6000.0)
    units = tuple(found[1] if (found := _UNIT.search(name)) else "" for name in table.names)
    return ImportedData(
        samples=table.values, form="CSV", names=table.names, units=units, notes=notes, report=report
    ).resolve(given, path)


def _own(text: str, path: Path, given: ImportOptions) -> OpenedTake:
    first, _, rest = text.partition("\n")
    if not text.endswith("\n"):
        raise BrokenFileError(f"{path}: expected a line end at the end, got a truncated line; copy the file again")
    return own_take(first.removeprefix(MARK), read_table(rest, path).values[:, 1:], given, path)


_UNIT = re.compile(r"[\[(]\s*(?![\dxyzXYZ]?\s*[\])])([^\[\]()]*?)\s*[\])]\s*$")
"""A unit in brackets at the end of a name; a digit or an axis is none."""


CSV = Format(name="CSV", read=read_csv, write=write_csv, memory=4)
TXT = Format(name="text", read=read_csv, memory=4)


FABRICSLIDE = ("timestamp", "proximity1", "proximity2", *(f"channel{i}" for i in range(1, 17)))
"""Column names that identify its files."""

_LAYOUT = (
    "Neither the layout nor the pitch of the 16 taxels is documented: 4 x 4 in the order of the "
    "channels, 11 mm apart as in the paper's sensor, was assumed."
)


_CLUSTER = (("time", "X", "Y", "Z"), ("time", "force"))
"""Column names of acceleration and force of the Cluster Haptic Texture Dataset."""

_NAMES = {
    "FabricSlide": r"(?P<material>[^_]+)_F(?P<force>\d+)_V(?P<speed>-?\d+)mmps_(?P<repeat>\d+)",
    "Cluster Haptic Texture Dataset": r"(?P<texture>\d+)_(?P<direction_deg>\d+)_(?P<speed>[2-6]0)_(?P<force_mn>\d+)_"
    r"(?P<repeat>[01])",
    "LMT Haptic Texture Database": r"(?P<material>\w+?)_(?P<motion>Movement|Tapping)_(?:(?P<axis>[XYZ])_)?"
    r"(?P<part>train|test)(?P<repeat>\d+)",
}
"""Names of files of public sets, without their ending."""
_AFTER = {"speed": " mm/s", "force": ", unit not stated"}


def _named(path: Path) -> tuple[dict[str, str], tuple[str, ...]]:
    """Notes from the name of a file of a public set, and a sentence that says so."""
    for title, name in _NAMES.items():
        if found := re.fullmatch(name, path.stem):
            notes = {key: each + _AFTER.get(key, "") for key, each in found.groupdict().items() if each}
            said = ", ".join(f"{key} {each}" for key, each in notes.items())
            return {"set": title, **notes}, (f"Named as a file of the {title}: {said}.",)
    return {}, ()


NAMES = ("time", "x", "y", "z", "nx", "ny", "nz", "dx", "dy", "dz", "confidence")
"""Columns of the file."""


def load_palm_path(path: str | os.PathLike[str]) -> PalmPath:
    """Read the poses of a palm.

    Normals and directions of fingers are normalised; a length that differs by more than 1 % from 1 is refused. Raises
    MissingFileError or BrokenFileError if the file does not exist, or is not a table of poses with increasing times.
    """
    table = read_table(read_text(path, "a table of poses"), Path(path))
    if table.names != NAMES:
        raise BrokenFileError(f"{path}: expected the columns {','.join(NAMES)}, got {','.join(table.names) or 'none'}")
    rows = table.values.copy()
    rows[:, 4:7], rows[:, 7:10] = _unit(rows[:, 4:7]), _unit(rows[:, 7:10])
    try:
        return PalmPath.from_rows(rows)
    except InputError as wrong:
        raise BrokenFileError(f"{path}: {wrong}") from wrong


def save_palm_path(palm: PalmPath, path: str | os.PathLike[str]) -> None:
    """Write poses atomically, all numbers without loss. Raises FileError if the file cannot be written."""
    lines = [",".join(NAMES), *(",".join(map(repr, row)) for row in palm.rows.tolist())]
    write_file(path, "\n".join(lines) + "\n")


def _unit(vectors: Array) -> Array:
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    # Six digits of a file leave 1e-6; other lengths are for PalmPath to refuse.
    return np.where(np.abs(length - 1) < 1e-2, vectors / np.maximum(length, 0.5), vectors)
