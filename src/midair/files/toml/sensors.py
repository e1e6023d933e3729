"""Description of a sensor in TOML, written by users and corrected by `midair identify`.

::

    name = "palm sensor 3"
    rows = 4
    columns = 4
    pitch_mm = 11.0
    unit = "V"                    # unit of the samples: V, count or Pa
    full_scale = 1.25             # level at which the source clips, in that unit; optional
    sensitivity = 0.02            # unit per Pa, nominal; optional
    order = [                     # channel of the source for each cell, row by row; default 0, 1, 2, ...
      0, 1, 2, 3,
      4, 5, 6, 7,
      8, 9, 10, 11,
      12, 13, 14, 15,
    ]
"""

import json
import os
from pathlib import Path
from typing import Any

from midair.errors import BrokenFileError, InputError
from midair.files.atomic import atomic_file
from midair.files.text_files import read_toml
from midair.model import SensorGrid, SensorWiring

_NUMBERS = {"rows", "columns", "pitch_mm", "full_scale", "sensitivity"}
_KEYS = {"name", "unit", "order", *_NUMBERS}


def load_sensor(path: str | os.PathLike[str]) -> SensorWiring:
    """Read a sensor from a TOML file; the defaults are 4 x 4 cells at 11 mm, in counts.

    Raises MissingFileError if the file does not exist; BrokenFileError if it is not TOML, or a key or value is invalid.
    """
    content = read_toml(path, "a TOML file that describes a sensor")
    _check_keys(content, path)
    try:
        return _wiring(content, Path(path).stem)
    except InputError as wrong:
        raise BrokenFileError(f"{path}: {wrong}") from wrong


def save_sensor(sensor: SensorWiring, path: str | os.PathLike[str]) -> None:
    """Write a sensor file atomically. Raises FileError if the file cannot be written."""
    with atomic_file(Path(path)) as partial:
        Path(partial).write_text(sensor_text(sensor), encoding="utf-8")


def sensor_text(sensor: SensorWiring) -> str:
    """Text of a sensor file."""
    columns = sensor.grid.columns
    rows = [sensor.order[first : first + columns] for first in range(0, len(sensor.order), columns)]
    lines = [
        f"name = {_quoted(sensor.grid.name)}",
        f"rows = {sensor.grid.rows}",
        f"columns = {columns}",
        f"pitch_mm = {sensor.grid.pitch * 1e3:.12g}",
        f'unit = "{sensor.unit}"',
        *([] if sensor.full_scale is None else [f"full_scale = {sensor.full_scale!r}"]),
        *([] if sensor.sensitivity is None else [f"sensitivity = {sensor.sensitivity!r}"]),
        "# Channel of the source for each cell, row by row.",
        "order = [",
        *("  " + ", ".join(map(str, row)) + "," for row in rows),
        "]",
    ]
    return "\n".join(lines) + "\n"


def _quoted(text: str) -> str:
    """A TOML basic string: the escapes of JSON are those of TOML, except DEL."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def _check_keys(content: dict[str, Any], path: str | os.PathLike[str]) -> None:
    unknown = sorted(set(content) - _KEYS)
    if unknown:
        raise BrokenFileError(f"{path}: expected the keys {', '.join(sorted(_KEYS))}, got {', '.join(unknown)}")
    for key, value in content.items():
        order = isinstance(value, list) and all(type(each) is int for each in value)
        fits = order if key == "order" else type(value) in ((int, float) if key in _NUMBERS else (str,))
        if not fits:
            kind = "whole numbers in brackets" if key == "order" else "a number" if key in _NUMBERS else "text"
            raise BrokenFileError(f"{path}: {key}: expected {kind}, got {value!r}")


def _wiring(content: dict[str, Any], name: str) -> SensorWiring:
    grid = SensorGrid(
        rows=content.get("rows", 4),
        columns=content.get("columns", 4),
        pitch=content.get("pitch_mm", 11.0) * 1e-3,
        name=content.get("name", name),
    )
    return SensorWiring(
        grid=grid,
        order=tuple(content.get("order", ())),
        unit=content.get("unit", "count"),
        full_scale=content.get("full_scale"),
        sensitivity=content.get("sensitivity"),
    )
