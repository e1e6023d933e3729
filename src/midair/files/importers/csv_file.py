"""Tables as text: recordings of midair and of other programs, poses of a palm.

FabricSlide (Wang et al. 2022, doi 10.3389/fnbot.2022.808222): a robot arm slides a capacitive finger with 16 taxels
over fabrics and gratings. Columns: timestamp in ms, two proximity readings, channel1 to channel16 in raw counts, at
about 35.6 Hz. File names are material_F<force set-point>_V<velocity>mmps_<repeat>.
"""

import os
import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from midair.array_types import Array
from midair.errors import BrokenFileError, InputError
from midair.files.atomic import atomic_file, parse_errors, write_file
from midair.files.importers.text_table import decoded, read_table
from midair.files.opened_take import Format, FormatLoss, ImportedData, ImportOptions
from midair.files.text_files import read_text
from midair.model import PalmPath, Recording, SensorGrid
from midair.progress import report_progress
from midair.validation import within


def write_csv(recording: Recording, path: Path) -> tuple[FormatLoss, ...]:
    """Write a row of names, and a row per frame, all numbers without loss."""
    sensor = recording.sensor
    cells = [
        f"row{row}_column{column} [{recording.unit}]" for row in range(sensor.rows) for column in range(sensor.columns)
    ]
    head = ("# SIMULATED\n" if recording.provenance.simulated else "") + ",".join(["time [s]", *cells])
    table = np.column_stack([recording.time, recording.samples.reshape(recording.frames, -1)])
    with atomic_file(path) as partial, partial.open("w", encoding="utf-8") as file:
        file.write(f"{head}\n")
        for part in report_progress(np.array_split(table, len(table) // 1000 + 1), len(table) // 1000 + 1):
            # %s is the shortest text that is read back as the same number.
            np.savetxt(file, part, "%s", ",")
    return ()


def read_csv(path: Path, given: ImportOptions) -> ImportedData:
    """Read a table of FabricSlide, or of any program that writes one channel per column."""
    text, encoding = decoded(path.read_bytes())
    table = read_table(text, given, encoding=encoding)
    if table.names == FABRICSLIDE:
        layout = {} if given.sensor else {"layout": _LAYOUT}
        return replace(
            table,
            samples=table.samples[:, [0, *range(3, 19)]],
            form="CSV of FabricSlide",
            names=("time [ms]", *FABRICSLIDE[3:]),
            units=("ms", *16 * ["count"]),
            sensor=SensorGrid(name="CPM-finger of FabricSlide"),
            notes={**_notes(path), **layout},
            settings={"left_out": FABRICSLIDE[1:3]},
            report=("Columns proximity1 and proximity2 were left out: not taxels.", *layout.values()),
        )
    return table


CSV = Format(name="CSV", read=read_csv, write=write_csv, memory=4)
TXT = Format(name="text", read=read_csv, memory=4)
LVM = Format(name="LabVIEW text", read=read_csv, memory=4)


FABRICSLIDE = ("timestamp", "proximity1", "proximity2", *(f"channel{i}" for i in range(1, 17)))
"""Column names that identify its files."""

_LAYOUT = (
    "Neither the layout nor the pitch of the 16 taxels is documented: 4 x 4 in the order of the "
    "channels, 11 mm apart as in the paper's sensor, was assumed."
)

_FABRIC = re.compile(r"(?P<material>[^_]+)_F(?P<force>\d+)_V(?P<speed>-?\d+)mmps_(?P<repeat>\d+)")


def _notes(path: Path) -> dict[str, str]:
    """Notes from the name of a file of FabricSlide."""
    found = _FABRIC.fullmatch(path.stem)
    after = {"speed": " mm/s", "force": ", unit not stated"}
    return {key: each + after.get(key, "") for key, each in found.groupdict().items()} if found else {}


NAMES = ("time", "x", "y", "z", "nx", "ny", "nz", "dx", "dy", "dz", "confidence")
"""Columns of the file."""


def load_palm_path(path: str | os.PathLike[str]) -> PalmPath:
    """Read the poses of a palm.

    Normals and directions of fingers are normalised; a length that differs by more than 1 % from 1 is refused. Raises
    MissingFileError or BrokenFileError if the file does not exist, or is not a table of poses with increasing times.
    """
    with parse_errors(path, "a table of poses"):
        table = read_table(read_text(path, "a table of poses"))
        if table.names != NAMES:
            raise BrokenFileError(f"expected the columns {','.join(NAMES)}, got {','.join(table.names) or 'none'}")
        rows = table.samples.copy()
        rows[:, 4:7], rows[:, 7:10] = _unit(rows[:, 4:7]), _unit(rows[:, 7:10])
        try:
            within(float(np.abs(rows[:, 1:4]).max(initial=0)), "centre of the palm", 0, 10, unit="m")
            return PalmPath.from_rows(rows)
        except InputError as wrong:
            raise BrokenFileError(str(wrong)) from wrong


def save_palm_path(palm: PalmPath, path: str | os.PathLike[str]) -> None:
    """Write poses atomically, all numbers without loss. Raises FileError if the file cannot be written."""
    write_file(path, "\n".join([",".join(NAMES), *(",".join(map(repr, row)) for row in palm.rows.tolist())]) + "\n")


def _unit(vectors: Array) -> Array:
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    # Six digits of a file leave 1e-6; other lengths are for PalmPath to refuse.
    return np.where(np.abs(length - 1) < 1e-2, vectors / np.maximum(length, 0.5), vectors)
