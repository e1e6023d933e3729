"""Set-up of a motion stage that moves an object to the sensor, in TOML.

::

    heading = "+x"                # direction of strokes: +x, -x, +y or -y
    start_mm = [20.0, 50.0]       # x, y of the start of strokes
    contact_mm = -32.5            # z at which the object is in contact
    clear_mm = -20.0              # z without contact; z increases away from the sensor
    approach_mm_s = 5.0           # speed of the approach to the contact
    return_mm_s = 50.0            # speed of all other moves
    homing = "switches"           # default, or "by hand": the user moves the stage home before switching it on

    [travel]                      # limits of travel; a stroke beyond them is refused before any move
    x_mm = [0.0, 200.0]
    y_mm = [0.0, 120.0]
    z_mm = [-60.0, 0.0]

All positions are machine coordinates, as after ``MPos:`` in a status report of Grbl.
"""

import math
import os
from collections.abc import Mapping
from typing import Any, get_args

from midair.errors import BrokenFileError, InputError
from midair.files.text_files import read_toml
from midair.model import Heading, StageSetup

NUMBERS = ("contact_mm", "clear_mm", "approach_mm_s", "return_mm_s")
KEYS = ("heading", "start_mm", *NUMBERS, "homing", "travel")
AXES = ("x_mm", "y_mm", "z_mm")


def load_stage(path: str | os.PathLike[str]) -> StageSetup:
    """Read the set-up of a motion stage from a TOML file.

    Raises MissingFileError if the file does not exist; BrokenFileError if it is not TOML, or a key or value is invalid.
    """
    content = {"homing": "switches"} | read_toml(path, "a TOML file that describes a motion stage")
    try:
        _check_keys(content, KEYS, "")
        if not isinstance(travel := content["travel"], Mapping):
            raise InputError(f"travel: expected a table [travel] with {', '.join(AXES)}, got {travel!r}")
        _check_keys(travel, AXES, "travel.")
        mm = {name: _number(content[name], name) * 1e-3 for name in NUMBERS}
        return StageSetup(
            heading=_one_of(content["heading"], "heading", get_args(Heading)),
            start=_pair(content["start_mm"], "start_mm"),
            contact=mm["contact_mm"],
            clear=mm["clear_mm"],
            approach=mm["approach_mm_s"],
            back=mm["return_mm_s"],
            travel=(_pair(travel["x_mm"], "x_mm"), _pair(travel["y_mm"], "y_mm"), _pair(travel["z_mm"], "z_mm")),
            homing=_one_of(content["homing"], "homing", ("switches", "by hand")),
        )
    except InputError as wrong:
        raise BrokenFileError(f"{path}: {wrong}") from wrong


def _check_keys(content: Mapping[str, Any], known: tuple[str, ...], where: str) -> None:
    unknown, missing = sorted(set(content) - set(known)), [key for key in known if key not in content]
    if unknown or missing:
        got = f"got {where}{unknown[0]}" if unknown else f"{where}{missing[0]} is missing"
        raise InputError(f"expected the keys {', '.join(where + key for key in known)}; {got}")


def _number(value: object, name: str) -> float:
    # By type, because bool is a subclass of int.
    if type(value) not in (int, float) or not math.isfinite(float(value)):  # pyright: ignore[reportArgumentType]
        raise InputError(f"{name}: expected a number, got {value!r}")
    return float(value)  # pyright: ignore[reportArgumentType]  # checked above


def _pair(value: object, name: str) -> tuple[float, float]:
    if not isinstance(value, list) or len(value) != 2:  # pyright: ignore[reportUnknownArgumentType]
        raise InputError(f"{name}: expected two numbers in brackets, got {value!r}")
    first, second = (_number(each, name) * 1e-3 for each in value)  # pyright: ignore[reportUnknownVariableType]
    return first, second


def _one_of(value: object, name: str, known: tuple[str, ...]) -> Any:
    if value not in known:
        raise InputError(f"{name}: expected {' or '.join(known)}, got {value!r}")
    return value
