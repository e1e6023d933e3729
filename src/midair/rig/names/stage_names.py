"""Stages by the names that people give them: ``grbl:/dev/ttyUSB0``, ``grbl:COM3?baud=115200``."""

import importlib

from midair.devices import StageDevice
from midair.errors import InputError, MissingExtraError, UnknownDeviceError
from midair.rig.names.source_names import split_name


def stage_named(name: str) -> StageDevice:
    """The stage that a name means, not yet open.

    Parameters
    ----------
    name : str
        ``grbl:PORT``: a machine behind Grbl 1.1 at a serial port; ``?baud=`` where it does not speak at 115200.

    Raises
    ------
    UnknownDeviceError
        If nothing answers to the name.
    InputError
        If an option is unknown or cannot be used.
    MissingExtraError
        If pyserial is not installed.
    """
    kind, where, said = split_name(name)
    if kind != "grbl" or not where:
        raise UnknownDeviceError(f"--stage: expected grbl:PORT, such as grbl:/dev/ttyUSB0, got {name!r}")
    baud = said.pop("baud", "115200")
    if said or not baud.isdecimal() or not int(baud):
        raise InputError(f"{name}: expected the option baud, bits per second, got {next(iter(said), f'baud={baud}')}")
    try:
        module = importlib.import_module("midair.devices.motion_stages.grbl")
    except ModuleNotFoundError as wrong:
        raise MissingExtraError(
            f'grbl: expected the package {wrong.name}, it is not installed; pip install "midair[serial]"'
        ) from wrong
    return module.GrblStage(where, baud=int(baud))
