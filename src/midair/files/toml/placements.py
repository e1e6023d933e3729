"""Placement of an array's units in TOML.

::

    name = "my array"

    [[unit]]
    position_mm = [0, 0, 0]        # position of the unit's first transducer
    rotation_deg = [0, 0, 0]       # about the fixed x, then y, then z axis; optional

Units are in the order of their wiring. The array is shifted so that its centre, the mean of all transducers, is the
origin.
"""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from midair.errors import BrokenFileError
from midair.files.text_files import read_toml
from midair.model import Placement


def load_placement(path: str | os.PathLike[str]) -> Placement:
    """Read a placement from a TOML file.

    Raises MissingFileError if the file does not exist; BrokenFileError if it is not TOML, or a key or value is invalid.
    """
    content = read_toml(path, "a TOML file with the placement of the units")
    name, units = content.pop("name", Path(path).stem), content.pop("unit", None)
    if content or not isinstance(units, list) or not units or not all(isinstance(unit, dict) for unit in units):
        raise BrokenFileError(
            f"{path}: expected name and one [[unit]] or more, got {', '.join(content) or 'no unit'}; "
            "write position_mm for each unit in the order of the wiring"
        )
    places = [_unit(unit, number, Path(path)) for number, unit in enumerate(units)]
    return Placement(
        position=np.array([place for place, _ in places]) * 1e-3,
        rotation=np.radians([turn for _, turn in places]),
        name=str(name),
    )


def _unit(unit: Mapping[str, Any], number: int, path: Path) -> tuple[list[float], list[float]]:
    place, turn = unit.get("position_mm"), unit.get("rotation_deg", [0, 0, 0])
    unknown = set(unit) - {"position_mm", "rotation_deg"}
    if unknown or not _is_three_numbers(place) or not _is_three_numbers(turn):
        raise BrokenFileError(
            f"{path}: unit {number}: expected position_mm and optional rotation_deg, three numbers each, got {unit}"
        )
    return place, turn  # pyright: ignore[reportReturnType]  # checked by _is_three_numbers


def _is_three_numbers(value: object) -> bool:
    # By type, because bool is a subclass of int.
    return isinstance(value, list) and len(value) == 3 and all(type(each) in (int, float) for each in value)
