"""Comma-separated values: midair's own with a header that makes them exact, and those of other programs.

FabricSlide (Wang et al. 2022, doi 10.3389/fnbot.2022.808222): a robot arm slides a capacitive finger with 16 taxels
over fabrics and gratings. Columns: timestamp in ms, two proximity readings, channel1 to channel16 in raw counts, at
about 35.6 Hz. File names are material_F<force set-point>_V<velocity>mmps_<repeat>.
"""

import re
from pathlib import Path
from typing import get_args

import numpy as np

from midair.errors import BrokenFileError
from midair.files.atomic import atomic_file
from midair.files.importers.header import header_of, parse_header, recording_from
from midair.files.importers.text_table import TextTable, read_table
from midair.files.opened_take import Format, FormatLoss, ImportedData, ImportOptions, OpenedTake, calibration_lost
from midair.files.text_files import without_formulas
from midair.files.timestamps import to_fixed_rate
from midair.model import Calibration, Recording, SensorGrid, Unit
from midair.streaming import blocks

MARK = "# midair "
"""First characters of midair's own files."""


def write_csv(recording: Recording, path: Path, calibration: Calibration | None) -> tuple[FormatLoss, ...]:
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
    return calibration_lost(calibration, "CSV")


def read_csv(path: Path, given: ImportOptions) -> OpenedTake:
    """Read a CSV of midair, of FabricSlide, or of any program that writes one channel per column.

    A column named time, timestamp or t gives the rate; a unit in brackets in every other name gives the unit.
    """
    # utf-8-sig, because a byte-order mark would become a part of the first name.
    text = path.read_bytes().decode("utf-8-sig")
    if text.startswith(MARK):
        return _own(text, path, given)
    table = read_table(text, path, gaps=given.mending is not None)
    if table.names == FABRICSLIDE:
        return _of_fabricslide(table, path, given).resolve(given, path)
    return _foreign(table, given).resolve(given, path)


def _own(text: str, path: Path, given: ImportOptions) -> OpenedTake:
    first, _, rest = text.partition("\n")
    if not text.endswith("\n"):
        raise BrokenFileError(f"{path}: expected a line end at the end, got a truncated line; copy the file again")
    table = read_table(rest, path)
    recording = recording_from(parse_header(first.removeprefix(MARK), path), table.values[:, 1:], path)
    given.check(recording, path)
    return OpenedTake(recording=recording)


def _foreign(table: TextTable, given: ImportOptions) -> ImportedData:
    clock = next((i for i, name in enumerate(table.names) if _TIME.fullmatch(name)), None)
    if clock is None:
        return ImportedData(samples=table.values, form="CSV", names=table.names, units=_units(table.names))
    seconds, report = _seconds(table, clock)
    names = tuple(name for i, name in enumerate(table.names) if i != clock)
    even = to_fixed_rate(seconds, np.delete(table.values, clock, axis=1), rate=given.rate)
    return ImportedData(
        samples=even.samples,
        form="CSV",
        rate=even.rate,
        names=names,
        units=_units(names),
        settings={"columns": names, "rate_hz": even.rate, "interpolation": "linear"},
        report=(*report, *even.report),
    )


_TIME = re.compile(r"(?:time|timestamp|t)[\s_]*(?:[\[(/]?\s*(s|sec|seconds|ms|us|µs|μs|ns)\s*[\])]?)?", re.IGNORECASE)
_SECONDS = {"s": 1.0, "sec": 1.0, "seconds": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "μs": 1e-6, "ns": 1e-9}


def _seconds(table: TextTable, clock: int) -> tuple[np.ndarray, tuple[str, ...]]:
    """Time stamps in s, and a report if their unit was assumed: ms for integers at least 2 apart, otherwise s."""
    stamps = table.values[:, clock]
    name = table.names[clock]
    found = _TIME.fullmatch(name)
    unit = found.group(1) if found else None
    if unit is not None:
        return stamps * _SECONDS[unit.lower()], ()
    whole = len(stamps) > 1 and (stamps == np.round(stamps)).all() and np.median(np.diff(stamps)) >= 2
    guessed = "ms" if whole else "s"
    return stamps * _SECONDS[guessed], (f"Column {name!r} does not state its unit: {guessed} was assumed.",)


def _units(names: tuple[str, ...]) -> tuple[Unit | None, ...]:
    """The unit in brackets after each name."""
    units: tuple[Unit, ...] = get_args(Unit)
    return tuple(next((unit for unit in units if name.endswith(f"[{unit}]")), None) for name in names)


CSV = Format(name="CSV", read=read_csv, write=write_csv, memory=4)


FABRICSLIDE = ("timestamp", "proximity1", "proximity2", *(f"channel{i}" for i in range(1, 17)))
"""Column names that identify its files."""

_NAME = re.compile(r"(?P<material>[^_]+)_F(?P<force>\d+)_V(?P<velocity>-?\d+)mmps_(?P<repeat>\d+)")
_LAYOUT = (
    "Neither the layout nor the pitch of the 16 taxels is documented: 4 x 4 in the order of the "
    "channels, 11 mm apart as in the paper's sensor, was assumed."
)


def _of_fabricslide(table: TextTable, path: Path, given: ImportOptions) -> ImportedData:
    """The 16 taxels at a fixed rate, without the proximity readings."""
    even = to_fixed_rate(table.values[:, 0] / 1e3, table.values[:, 3:], rate=given.rate)
    layout = {} if given.sensor else {"layout": _LAYOUT}
    return ImportedData(
        samples=even.samples,
        form="CSV of FabricSlide",
        rate=even.rate,
        unit="count",
        names=FABRICSLIDE[3:],
        sensor=SensorGrid(name="CPM-finger of FabricSlide"),
        notes={**_notes(path), **layout},
        settings={"left_out": FABRICSLIDE[1:3], "rate_hz": even.rate, "interpolation": "linear"},
        report=(
            *even.report,
            "Columns proximity1 and proximity2 were left out: not taxels.",
            *layout.values(),
        ),
    )


def _notes(path: Path) -> dict[str, str]:
    found = _NAME.fullmatch(path.stem)
    if found is None:
        return {}
    return {
        "material": found["material"],
        "force": f"set-point {found['force']}, unit not stated",
        "speed": f"{found['velocity']} mm/s",
        "repeat": found["repeat"],
    }
