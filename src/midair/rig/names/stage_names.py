"""Motion stages by name: ``grbl:/dev/ttyUSB0``, ``grbl:COM3?baud=115200``."""

from collections.abc import Callable, Mapping

from midair.devices import StageDevice
from midair.errors import InputError, UnknownDeviceError
from midair.registry import Registry
from midair.rig.names.sensor_names import split_name

STAGES: Registry[Callable[[str, Mapping[str, str]], StageDevice]] = Registry(
    "midair.stages", {"grbl": "midair.devices.motion_stages.grbl:grbl_stage [serial]"}
)
"""Functions that make a motion stage from a place and the options after the question mark, by kind."""


def stage_named(name: str) -> StageDevice:
    """Make the motion stage that a name stands for, not yet open.

    ``grbl:PORT`` is a machine with Grbl 1.1 at a serial port; ``?baud=`` if its rate is not 115200 bits per second.
    UnknownDeviceError, InputError or MissingExtraError if the name is unknown, an option is invalid, or pyserial is not
    installed.
    """
    kind, place, stated = split_name(name)
    if not place or kind not in STAGES:
        others = "".join(f", {each}:PLACE" for each in STAGES.others)
        raise UnknownDeviceError(f"--stage: expected grbl:PORT, such as grbl:/dev/ttyUSB0{others}, got {name!r}")
    try:
        return STAGES[kind](place, stated)
    except InputError as wrong:
        raise InputError(f"{name}: {wrong}") from wrong
