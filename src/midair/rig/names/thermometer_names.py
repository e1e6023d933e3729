"""Thermometers by name: ``lsl:NAME``, ``serial:PORT``, ``file:PATH``."""

from midair.devices import Thermometer
from midair.errors import UnknownDeviceError
from midair.registry import Registry

THERMOMETERS: Registry[type[Thermometer]] = Registry(
    "midair.thermometers",
    {
        "lsl": "midair.devices.sensors.lsl_thermometer:LslThermometer [lsl]",
        "serial": "midair.devices.sensors.serial_thermometer:SerialThermometer [serial]",
        "file": "midair.devices.sensors.thermometer:FileThermometer",
    },
)
"""Kinds of thermometers."""


def thermometer_named(name: str) -> Thermometer:
    """Make the thermometer that a name stands for; its first `read` opens it.

    UnknownDeviceError if the kind is unknown, MissingExtraError if its package is not installed.
    """
    kind, _, place = name.partition(":")
    if kind not in THERMOMETERS or not place:
        raise UnknownDeviceError(
            f"thermometer: expected {', '.join(f'{each}:PLACE' for each in THERMOMETERS)}, got {name!r}"
        )
    return THERMOMETERS[kind](place)
