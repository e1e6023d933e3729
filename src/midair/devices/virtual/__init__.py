"""The virtual rig: an array, a sensor and the place where they meet, drivers like any other."""

from midair.devices.virtual.virtual_array import VirtualArray
from midair.devices.virtual.virtual_sensor import VirtualSensor
from midair.devices.virtual.virtual_skin import VirtualSkin
from midair.devices.virtual.virtual_units import VirtualUnits, virtual_immediate

__all__ = [
    "VirtualArray",
    "VirtualSensor",
    "VirtualSkin",
    "VirtualUnits",
    "virtual_immediate",
]
